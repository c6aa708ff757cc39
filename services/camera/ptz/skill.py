"""All that is learnt about one camera's motors: its axes, which way is which, how long answers take, what it honours.

Not here: how an axis learns (`pace.py`), where this is kept over a restart (`kept.py`).
"""

from __future__ import annotations

from collections import deque
from copy import deepcopy
from dataclasses import dataclass, field
from math import hypot
from statistics import median
from typing import Literal

from services.camera.device import Reply
from services.camera.ptz.pace import HALF_CHANGE, PAN_RATES, READ_LATE, TILT_RATES, ZOOM_RATES, Pace
from services.camera.ptz.planes import POINT, TURN, VIEW, Scale, scale_of
from services.camera.ptz.zoom_rate import ZoomRate

RelativeForm = Literal["moveRelatively", "Position"]
Honours = Literal["unknown", "no", "pan", "yes"]  # of a way to let the firmware drive; pan: it ignores tilt
DRIVES = (45.0, 27.0, 4.0)  # degrees/s, levels/s: the firmware's own moves, a guess to begin with
KEEP = 120  # answers, for how long they take
LONGEST_S = 30.0  # no answer takes so long, its connection gives up before
LATENCY_S, SPREAD_S = 0.3, 0.1  # of an answer, before any was measured
TAIL_S = 1.0  # an answer may always come so much later than usual: busy Wi-Fi does that to two in a hundred
TAIL_PART = 3.3  # of the usual time, where that is long
LATE_PART = 0.85  # of how late an answer may be, where a motion that it begins is ended only after it
AGAIN_PART = 0.5  # of that, for a second one in a row
FORGETS, WORSE = 0.998, 1.2  # of the latest answer: kept with each one more; and it may be later the next time
SOONER_S, LATER_S, MOST_LATE_S = 0.008, 0.04, 0.5
NEAR_DEG, NEARER_DEG = 0.42, 0.35  # a reading so near has arrived: 0.5 promised, resolution and dither taken off
THERE_DEG = 0.15  # what is farther off than so is not quite where it should be
DITHER_DEG = 0.1  # a reading at rest may be so far off where they dither
STILL_DEG = 0.05
STEADY = 6  # readings at rest that were alike show that they do not dither
LEVEL = 1.0  # zoom is read in coarse steps: a reading may be so far from the truth
ZOOM_SLOWS_S = 0.1  # zoom takes so long to its speed, and to rest
ZOOM_DOUBT, ZOOM_UNSURE = 0.1, 0.5  # of DRIVES' zoom, at first: for when to look, and for when it surely rests
OTHER_PART = 0.06  # of the top speed: the firmware's own moves may be as much faster, or slower
STEP_LONGER = 1.5  # than is reckoned
GRIDS = (2.0, 1.0)  # some firmware tells zoom in coarse steps


def _scales() -> dict[RelativeForm, Scale]:
    """The relative forms, the one that may go farther first; of both their source tells little.

    moveRelatively is taken for the like of moveAbsolutely, whose share of 1 is half a turn; Position for the picture's.
    """
    return {"moveRelatively": scale_of(TURN, VIEW, POINT), "Position": scale_of(POINT, VIEW, TURN)}


def _zoom() -> Pace:
    """Coarse readings hardly teach how long zoom takes to be as fast as ever, so it is guessed for the rate."""
    pace = Pace(ZOOM_RATES)
    pace.mean[len(ZOOM_RATES) + HALF_CHANGE] = ZOOM_SLOWS_S / (2 * ZOOM_RATES[0])
    return pace


def _drives() -> tuple[Pace, Pace, Pace]:
    """Zoom is seen on its way only where it is slower than is thought: a guess that is little doubted is best there."""
    pan, tilt, zoom = (Pace((top,)) for top in DRIVES)
    zoom.suppose(DRIVES[2], ZOOM_DOUBT, ZOOM_SLOWS_S / (2 * DRIVES[2]))
    return pan, tilt, zoom


@dataclass
class Sense:
    """Which way the reading goes when the camera is told right, down or in: +1 or -1; `sure` once it was seen."""

    sign: int = 1
    sure: bool = False


@dataclass
class Timing:
    """How long answers take."""

    took: deque[float] = field(default_factory=lambda: deque(maxlen=KEEP))
    count: int = 0
    usual: float = LATENCY_S
    spread: float = SPREAD_S
    worst: float = 0.0  # how much later than usual one came; forgotten slowly

    def learn(self, seconds: float) -> None:
        """Takes in one answer."""
        self.count += 1
        self.worst = max(FORGETS * self.worst, seconds - self.usual)
        self.took.append(seconds)
        ordered = sorted(self.took)
        if len(ordered) >= 3:
            self.usual = median(ordered)
        if len(ordered) >= 8:
            low, high = ordered[len(ordered) // 10], ordered[len(ordered) - 1 - len(ordered) // 10]
            self.spread = max(0.01, 0.6 * (high - low))

    def late(self, reply: Reply) -> float:
        """How much later than usual an answer came, seconds."""
        return reply.received - reply.sent - self.usual

    @property
    def tail(self) -> float:
        """How much later than usual an answer may come: what happened, or more."""
        return max(TAIL_S, TAIL_PART * self.usual, WORSE * self.worst, self.spread)


Motors = tuple[tuple[Pace, Pace, Pace], tuple[Pace, Pace, Pace], Timing, float]


@dataclass
class Skill:
    """What is learnt about one camera. `zoomed` is where zoom truly is, as far as its coarse reading leaves open."""

    paces: tuple[Pace, Pace, Pace] = field(default_factory=lambda: (Pace(PAN_RATES), Pace(TILT_RATES), _zoom()))
    senses: tuple[Sense, Sense, Sense] = field(default_factory=lambda: (Sense(), Sense(), Sense(sure=True)))
    timing: Timing = field(default_factory=Timing)
    picture: tuple[bool, bool] = (False, False)  # flip and mirror, with which the senses were seen
    surprise: float = 0.1  # s: how far off a place of rest is reckoned, over the speed before it
    diagonals: bool = True
    steady: int = 0  # readings of an axis at rest that were alike; -1: two were not, they dither
    always_moving: bool = False  # it says that it moves while it rests
    says_moving: bool = False  # it was seen to say so at all
    says_late: bool = False  # and when its position was the last one already: what it says is no newer than that
    zoom_steps: list[float] = field(default_factory=list)  # readings of zoom between its ends
    zoomed: tuple[float, float] | None = None  # reading, and the true value behind it
    drives: tuple[Pace, Pace, Pace] = field(default_factory=_drives)
    zoom_rate: ZoomRate = field(default_factory=lambda: ZoomRate(DRIVES[2], ZOOM_UNSURE))  # how slow that may be
    exact: int = 0  # moves by the firmware, in a row, that ended where they should
    foretold: tuple[float, float, float] | None = None  # where the latest surely ends, and nobody has read it there
    arrives_late: float = 0.02  # s after it is reckoned there, to look whether a drive has ended
    honours: dict[str, Honours] = field(default_factory=dict)  # by form
    beside: dict[str, tuple[float, float]] = field(default_factory=dict)  # by form: pan and tilt off what was asked
    presets: dict[int, tuple[float, float, float]] = field(default_factory=dict)  # readings where each was seen to be
    scales: dict[RelativeForm, Scale] = field(default_factory=_scales)

    def motors(self) -> Motors:
        """What is known of the motors and the answers by now, for `forget`."""
        return deepcopy((self.paces, self.drives, self.timing, self.surprise))

    def forget(self, known: Motors) -> None:
        """What was learnt of them since was wrong."""
        self.paces, self.drives, self.timing, self.surprise = deepcopy(known)

    def timed(self, seconds: float) -> None:
        """An answer took so long; what is usual may change with it, and what was learnt against that stays as true.

        No answer takes LONGEST_S, nor less than nothing: the clock was set meanwhile.
        """
        if not 0.0 <= seconds <= LONGEST_S:
            return
        before = self.timing.usual
        self.timing.learn(seconds)
        for pace in (*self.paces, *self.drives):
            pace.measure_late_from(self.timing.usual - before)

    def seen_at(self, reply: Reply) -> float:
        """The time of which the reading tells that an answer brought."""
        return self.paces[0].seen_at(reply.sent, self.timing.late(reply))

    def forget_senses(self, *, flip: bool, mirror: bool) -> None:
        """The picture's options changed, and these swap the motors: guess, and look at the next motion."""
        self.picture = (flip, mirror)
        self.senses[0].sign, self.senses[0].sure = (1 if mirror else -1), False
        self.senses[1].sign, self.senses[1].sure = (1 if flip else -1), False

    def believe(self, *, absolute: bool | None, relative: bool | None) -> None:
        """What the camera says that it does not take is not tried; what it says that it takes is tried all the same."""
        for form, takes in (("moveAbsolutely", absolute), ("moveRelatively", relative)):
            if takes is False:
                self.honours.setdefault(form, "no")

    def drive(self, axis: int) -> Pace:
        """How fast the firmware drives by itself: as after a start at top speed, until something better is known."""
        own, told = self.drives[axis], self.paces[axis]
        top = told.speeds[-1]
        part = hypot(told.doubt(top) / told.rate(top), OTHER_PART)
        if part < own.doubt(1) / own.rate(1):
            own.suppose(told.rate(top), part, told.other(HALF_CHANGE))
            if axis == 2 and part < self.zoom_rate.known()[1]:
                self.zoom_rate = ZoomRate(told.rate(top), part)
        return own

    @property
    def hops(self) -> bool:
        """Whether the firmware is known to go on by parts of the picture."""
        return any(self.honours.get(form) == "yes" for form in self.scales)

    def least(self, axis: int) -> float:
        """The smallest step: a start, and its end as soon as it was answered."""
        return self.paces[axis].rate(1) * self.timing.usual

    @property
    def step_s(self) -> float:
        """How long zoom may turn on its own and be read the same, in coarse steps."""
        return STEP_LONGER * self.zoom_step / self.drive(2).rate(1)

    @property
    def zoom_step(self) -> float:
        """The step in which zoom is told, as far as is known: the coarsest, until it was seen to be finer."""
        return self.zoom_grid or GRIDS[0]

    @property
    def read_late(self) -> float:
        """How long after it was asked for a reading tells of, as is learnt; not of a time after its usual answer."""
        return min(self.timing.usual, self.paces[0].other(READ_LATE))

    @property
    def near(self) -> float:
        """As near as that a reading has arrived, degrees."""
        return NEAR_DEG if self.steady >= STEADY else NEARER_DEG

    @property
    def dithers(self) -> bool:
        """Whether readings of an axis at rest were seen to differ."""
        return self.steady < 0

    def hear(self, moving: bool | None) -> None:
        """What it says of its motion."""
        self.says_moving |= moving is True
        self.always_moving &= moving is not False

    def tells_rest(self, moving: bool | None) -> bool:
        """Whether what the camera says of its motion tells by itself that it rests: its word was seen to change."""
        return moving is False and self.says_moving and not self.always_moving

    def tells_motion(self, moving: bool | None) -> bool:
        """Whether it says that it moves, and does not say so at rest, too."""
        return moving is True and not self.always_moving

    def tells_end(self, moving: bool | None) -> bool:
        """Whether it tells that the position beside it is the last one: what it says may be newer than that."""
        return self.says_late and self.tells_rest(moving)

    def see_still(self, change: float) -> None:
        """Two readings of an axis at rest differ by so much."""
        if self.steady >= 0:
            self.steady = -1 if abs(change) > STILL_DEG else self.steady + 1

    def expect_arrival(self, *, there: bool) -> None:
        """The first look at a drive's end: a little sooner the next time, or later; about one in six comes too soon."""
        change = -SOONER_S if there else LATER_S
        self.arrives_late = min(MOST_LATE_S, max(-SOONER_S * 10, self.arrives_late + change))

    def see_zoom(self, reading: float, ends: tuple[float, float]) -> None:
        """Takes in a reading of zoom: whether they come in steps shows between the ends."""
        if reading not in ends and reading not in self.zoom_steps:
            self.zoom_steps = [*self.zoom_steps[-7:], reading]

    def ended(self, off: float) -> None:
        """A move by the firmware was read at its end, so many degrees from where that should be."""
        self.exact, self.foretold = self.exact + 1 if off <= THERE_DEG else 0, None

    def lead_zoom(self, reading: float, to: float) -> None:
        """The firmware drove zoom there by itself: so it stands there, unless its reading is of another step."""
        self.zoomed = (reading, to) if abs(reading - to) <= LEVEL else None

    @property
    def zoom_grid(self) -> float:
        """The step in which zoom is told; 0: fine, or not known yet."""
        if not self.zoom_steps:
            return 0.0
        fits = (grid for grid in GRIDS if all(abs(one / grid - round(one / grid)) < 0.01 for one in self.zoom_steps))
        return next(fits, 0.0)

    def zoom_truth(self, reading: float) -> float:
        """Where zoom is: the reading, or what is known better since it only tells steps."""
        if self.zoomed is not None and self.zoomed[0] == reading:
            return self.zoomed[1]
        return reading
