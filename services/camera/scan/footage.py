"""Which pictures of a moving stream belong to which visit of a scan, and when a visit has lasted long enough. Pure.

A picture arrives most of a second after it was exposed, and how long exactly is known to a few tenths only. So a camera
that has stood still long enough moves on before its pictures have arrived, and what is sorted out later is sorted by
the pictures themselves: two that show the same pose have no motion between them. When the picture begins to move after
a command, that tells how late it is, better each time. Not here: where pictures come from (`live.py`).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import fmean, median, pstdev

from services.camera.video.likeness import Likeness
from services.camera.video.newest import Frame

FIRST_SPARES_S, MOST_SPARE_S = (-0.05, 0.2), 0.6  # how much longer than its pictures need visits last; taken as known
SPARES = 18  # visits that teach it; more are forgotten
SPREADS = 2.5  # so many standard deviations above their mean: a picture too few costs another visit, many spares
TAUGHT = 8  # departures that teach how late the picture is
NEAR_S = 0.8  # a picture that begins to move so near to a command does so because of it
LEAST_UNSURE_S = 0.05
FIRST_PERIOD_S = 0.1  # between two pictures, before any came
HELD = 16  # pictures, 5 MB each, of which it is not known yet whose they are
STEADY, FLASH = 1.2, 4.0  # grey levels from one picture to the next: less, and the light has settled; more is no drift
STEADY_FRAMES = 3.0  # until one is as light as the one before: an encoder spreads a change over a few
LATE_S = 1.5  # a picture that is so much later than usual is lost


@dataclass(eq=False)
class Visit:
    """The camera at rest somewhere: from `since`, until it may have moved on. `wanted` pictures of it; `got` so many.

    `steady`: the picture's light has to have settled too (its mode was changed). `teaches`: how long visits have to be.
    """

    wanted: int
    since: float
    steady: bool = False
    until: float | None = None
    planned: float | None = None  # when it was expected to turn, as the command for it was sent
    departed: float | None = None  # by then it surely turned
    got: int = 0
    seen: int = 0  # pictures that show it, those included that were not wanted any more
    given_up: bool = False
    teaches: bool = True

    @property
    def over(self) -> bool:
        """Whether no picture of it is awaited any longer."""
        return self.got >= self.wanted or self.given_up


@dataclass(frozen=True, eq=False)
class Glimpse:
    """A picture that has come: how it compares with the one before, and by how many grey levels it is lighter."""

    frame: Frame
    like: Likeness
    step: float


@dataclass(eq=False)
class _Run:
    """Successive pictures of one pose; `visit` once it is known which one they belong to."""

    glimpses: deque[Glimpse] = field(default_factory=lambda: deque(maxlen=HELD))
    proven: bool = False  # that it is one pose
    visit: Visit | None = None
    last: Glimpse | None = None


class Footage:
    """Visits are opened and left in turn; `take` is given every picture, and returns those that are wanted."""

    def __init__(self) -> None:
        self.visits: list[Visit] = []
        self.period = FIRST_PERIOD_S
        self._spares: deque[float] = deque(maxlen=SPARES)
        self._offsets: deque[tuple[float, float]] = deque(maxlen=TAUGHT)  # least and most that exposures are off
        self._departures: list[float] = []
        self._stamps: deque[float] = deque(maxlen=24)
        self._run = _Run()

    def begin(self) -> None:
        """A new scan, or a new stream: what was learnt stays."""
        self.visits, self._departures, self._run = [], [], _Run()
        self._stamps.clear()

    def open(self, visit: Visit) -> None:
        """The camera has come to rest."""
        self.visits.append(visit)

    def leave(self, earliest: float, latest: float, *, turns: bool = True) -> None:
        """The visit that was open is over: something began in between that ends it, mostly a motion."""
        for visit in self.visits:
            if visit.until is None:
                visit.until, visit.departed = earliest, latest
        if turns:
            self._departures.append(latest)

    def long_enough(self, visit: Visit) -> float:
        """From when on the camera may turn again: enough pictures were exposed, as far as one can tell."""
        spares = (*FIRST_SPARES_S, *self._spares)
        spare = fmean(spares) + SPREADS * pstdev(spares)
        frames = visit.wanted + (STEADY_FRAMES if visit.steady else 0.0)
        return visit.since + frames * self.period + spare

    def take(self, glimpse: Glimpse) -> list[tuple[Visit, Frame]]:
        """One more picture, in the order of their coming; what is now known to be of a visit that wants it."""
        self._stamps.append(glimpse.frame.exposure.at)
        if len(self._stamps) >= 4:
            self.period = max(0.01, median(b - a for a, b in pairwise(self._stamps)))
        given: list[tuple[Visit, Frame]] = []
        if glimpse.like == "moved" or abs(glimpse.step) > FLASH:
            given = self._end_run(glimpse)
        else:
            self._run.proven = self._run.proven or glimpse.like == "same"
        self._run.glimpses.append(glimpse)
        self._run.last = glimpse
        return given + self._sort()

    def at(self, frame: Frame) -> float:
        """When it was exposed, as far as was learnt."""
        return frame.exposure.at + self.offset

    @property
    def offset(self) -> float:
        """What exposures are off, seconds."""
        return median([(low + high) / 2 for low, high in self._offsets]) if self._offsets else 0.0

    def unsure(self, frame: Frame) -> float:
        """By how much that may be wrong, seconds."""
        if not self._offsets:
            return frame.exposure.uncertainty
        middle = self.offset
        spread = median([abs((low + high) / 2 - middle) for low, high in self._offsets])
        width = median([high - low for low, high in self._offsets])
        return max(LEAST_UNSURE_S, 1.5 * spread, width / 2)

    def pending(self, now: float, latency: float) -> list[Visit]:
        """The visits of which pictures may still come."""
        for visit in self.visits:
            ends = visit.until if visit.until is not None else visit.since + visit.wanted * self.period + LATE_S
            passed = visit.until is not None and bool(self._stamps) and (
                self._stamps[-1] + self.offset > visit.until + NEAR_S + 2 * self.period
            )  # fmt: skip
            visit.given_up = visit.given_up or passed or now > ends + latency + LATE_S
        return [visit for visit in self.visits if not visit.over]

    def _sort(self) -> list[tuple[Visit, Frame]]:
        """The pictures of the run that are known to be wanted; they leave it."""
        run = self._run
        if run.visit is None and run.proven:
            run.visit = next((visit for one in run.glimpses if (visit := self._core(one.frame))), None)
        given = []
        for one in list(run.glimpses)[:-1] if not run.proven else list(run.glimpses):
            visit = run.visit or (None if one.like == "moved" else self._core(one.frame))
            if visit is not None:
                run.glimpses.remove(one)
                given += self._give(visit, one)
        return given

    def _give(self, visit: Visit, one: Glimpse) -> list[tuple[Visit, Frame]]:
        if visit.steady and (abs(one.step) > STEADY or self.at(one.frame) < visit.since - self.unsure(one.frame)):
            return []
        visit.seen += 1
        if visit.over:
            return []
        visit.got += 1
        return [(visit, one.frame)]

    def _core(self, frame: Frame) -> Visit | None:
        """The visit during which a picture was surely exposed."""
        at, unsure = self.at(frame), self.unsure(frame)
        for visit in self.visits:
            if visit.since + unsure < at and (visit.until is None or at < visit.until - unsure):
                return visit
        return None

    def _end_run(self, moved: Glimpse) -> list[tuple[Visit, Frame]]:
        """Another pose, or another light: the pictures of the last one are given to the visit that they fit best."""
        run, self._run = self._run, _Run()
        if not run.proven or run.last is None:
            return []
        if moved.like == "moved":
            self._learn_offset(run.last.frame, moved.frame)
        given = []
        if run.visit is None and len(run.glimpses) > 1:
            run.visit = self._nearest(self.at(run.glimpses[0].frame), self.at(run.last.frame))
            if run.visit is not None:
                given = [one for glimpse in run.glimpses for one in self._give(run.visit, glimpse)]
        if run.visit is not None:
            self._learn_spare(run.visit)
            ended = run.visit.until is not None and self.at(moved.frame) > run.visit.until
            run.visit.given_up = run.visit.given_up or ended
        return given

    def _nearest(self, first: float, last: float) -> Visit | None:
        """The visit that has most in common with a time."""

        def common(visit: Visit) -> float:
            return (last if visit.until is None else min(last, visit.until)) - max(first, visit.since)

        best = max(self.visits, key=common, default=None)
        return best if best is not None and common(best) > -NEAR_S / 4 else None

    def _learn_offset(self, still: Frame, moved: Frame) -> None:
        """Between these two the camera began to turn: the command for it tells when that was."""
        seen = (self.at(still) + self.at(moved)) / 2
        told = next((one for one in self._departures if abs(one - seen) < NEAR_S), None)
        if told is not None:
            self._departures = [one for one in self._departures if one > told]
            self._offsets.append((told - moved.exposure.at, told - still.exposure.at))

    def _learn_spare(self, visit: Visit) -> None:
        """How much longer a visit lasted than its pictures needed: the first one came late, or some were lost."""
        ended = visit.planned or visit.departed
        if ended is not None and visit.seen and not visit.steady and visit.teaches:
            visit.teaches = False
            spare = ended - visit.since - visit.seen * self.period
            self._spares.append(min(MOST_SPARE_S, max(-MOST_SPARE_S, spare)))
