"""Learning the zoom as a plan: every level from both sides, each picture against the widest of the same place.

What a level magnifies by differs from visit to visit where the camera's levels are only ranges; the table says by how
much. The comparing is `vision/zoom.py`; the table's file is `levels.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import sqrt

from services.camera.device import Away, Reading, Refused
from services.camera.plan import Plan
from services.camera.ptz.goal import Goal, Limits
from services.camera.ptz.move import goto
from services.camera.ptz.skill import Skill
from services.camera.ptz.stand import settle
from services.camera.ptz.zooming import widest
from services.vision.zoom import WIDEST, Level, Magnification

STEPS = 4  # between the narrowest and the widest: the status of these cameras tells five levels apart
ROUNDS = 2  # up and down again
MOVE_S = 60.0
FEWEST = 2  # visits that make a level
# By these the scatter of so few visits is widened to a standard deviation that holds (Student's t, 68 of 100).
WIDENED = {2: 1.84, 3: 1.32, 4: 1.20}

Look = Callable[[float], Plan[tuple[bytes, float]]]
"""Plans a picture of a camera at rest, given the time; and the time then."""
Compare = Callable[[bytes, bytes], Plan[tuple[Magnification, float]]]
"""Plans the magnification of the second picture over the first; Refused when it cannot be told."""


@dataclass(frozen=True)
class Visit:
    """One arrival at a level: the zoom that was read, and what it truly was."""

    zoom: float
    seen: Magnification


@dataclass
class Climb:
    """One calibration of the zoom. `tell` hears of every visit; `wide` is what the last ones were compared with."""

    limits: Limits
    skill: Skill
    look: Look
    compare: Compare
    tell: Callable[[Climb], None] = lambda climb: None
    rounds: int = ROUNDS
    visits: list[Visit] = field(default_factory=list)
    wide: bytes = b""
    said: str = ""
    trouble: str = ""

    @property
    def progress(self) -> float:
        """0 to 1."""
        return min(1.0, len(self.visits) / (self.rounds * 2 * STEPS))

    def plan(self) -> Plan[tuple[Level, ...]]:
        """Ends where it began, with the table; Refused when no level could be compared."""
        began, now = yield from settle()
        low, high = self.limits.zoom
        ways = [low + (high - low) * step / STEPS for step in range(1, STEPS + 1)]
        for _ in range(self.rounds):
            self.wide, now = yield from self._widest(began, now)
            for zoom in (*ways, *reversed(ways)):
                now = yield from self._visit(began, zoom, now)
        yield from goto(self._goal(began, began.zoom), self.limits, self.skill, now + MOVE_S)
        found = table(self.visits, low)
        if len(found) < 2:
            raise Refused(f"no zoomed picture could be compared with the wide one: {self.trouble or 'too few visits'}")
        return found

    def _goal(self, began: Reading, zoom: float) -> Goal:
        pan, tilt, _ = self.limits.pose(began)
        low, high = self.limits.tilt
        return self.limits.goal(pan % 360.0, min(high, max(low, tilt)), zoom)

    def _widest(self, began: Reading, now: float) -> Plan[tuple[bytes, float]]:
        yield from goto(self._goal(began, self.limits.zoom[0]), self.limits, self.skill, now + MOVE_S)
        now = yield from widest(self.limits, self.skill, now)
        return (yield from self.look(now))

    def _visit(self, began: Reading, zoom: float, now: float) -> Plan[float]:
        arrival = yield from goto(self._goal(began, zoom), self.limits, self.skill, now + MOVE_S)
        zoomed, now = yield from self.look(arrival.at)
        try:
            seen, now = yield from self.compare(self.wide, zoomed)
        except (Refused, Away) as error:  # nothing with an outline there, or half a picture
            self.trouble = str(error)
            self._say(arrival.reading, self.trouble)
            return now
        self.visits.append(Visit(arrival.reading.zoom, seen))
        self._say(arrival.reading, f"{seen.times:.3f} times, {seen.relative:.2%} unsure")
        return now

    def _say(self, reading: Reading, what: str) -> None:
        self.said = f"zoom {reading.zoom:g}: {what}"
        self.tell(self)


def table(visits: Sequence[Visit], low: float) -> tuple[Level, ...]:
    """The levels that were visited often enough; the widest is what all are compared with."""
    by_zoom: dict[float, list[Magnification]] = {}
    for visit in visits:
        by_zoom.setdefault(visit.zoom, []).append(visit.seen)
    levels = [Level(zoom, _usual(seen)) for zoom, seen in sorted(by_zoom.items()) if zoom > low and len(seen) >= FEWEST]
    return (Level(low, WIDEST), *levels)


def _usual(seen: Sequence[Magnification]) -> Magnification:
    """The mean of the visits; its standard deviation is that of one more visit."""
    count = len(seen)
    times, right, down = (sum(getattr(one, name) for one in seen) / count for name in ("times", "right", "down"))
    scatter = sum((one.times - times) ** 2 for one in seen) / (count - 1) * (1 + 1 / count)
    measured = sum(one.sigma**2 for one in seen) / count
    return Magnification(times, sqrt(scatter * WIDENED.get(count, 1.15) ** 2 + measured), right, down)
