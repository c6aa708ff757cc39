"""The regulator as a plan: from readings and what is learnt of the motors to the next request.

Pan and tilt turn at once, each with a speed of its own; a start that replaces a running motion ends one axis, or all
of them when it is zoom's turn. So a goal mostly costs one fast leg that ends somewhere near, zoom while the camera is
looked at, and a slow leg that ends within tolerance; where it came to rest is read, never believed.
The parts of a move: `turning.py`, `zooming.py`, and the firmware's own moves, `driving.py`. Not here: which speeds
(`leg.py`), what is learnt (`pace.py`, `skill.py`), the ranges (`goal.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

from services.camera.device import Reading, Status
from services.camera.plan import Plan, wait
from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.driving import Driving
from services.camera.ptz.goal import Goal, Limits, Pose
from services.camera.ptz.helm import PROMISED, Helm
from services.camera.ptz.homing import Homing
from services.camera.ptz.hopping import Hopping
from services.camera.ptz.outlook import LEG
from services.camera.ptz.skill import DITHER_DEG, THERE_DEG, Skill
from services.camera.ptz.stand import settle
from services.camera.ptz.turning import Turning
from services.camera.ptz.zooming import Zooming
from services.errors import DeviceError

MOST_LEGS = 30  # the deadline ends most moves that do not come to an end
STUCK = 3  # legs without effect
MOVED = 0.15  # degrees or levels


@dataclass(frozen=True)
class Arrival:
    """Where a move ended: read at rest, or on its last degree, where its end was foretold; `at`: it rests by then.

    `reading` is that of the rest; where it was foretold nobody has told whether it moves. `rests` is since when, as far
    as that was reckoned; 0: it did not turn.
    """

    reading: Reading
    at: float
    clamped: bool = False
    rests: float = 0.0


def goto(
    goal: Goal,
    limits: Limits,
    skill: Skill,
    until: float,
    *,
    near: Reading | None = None,
    presets: Mapping[int, Pose] | None = None,
) -> Plan[Arrival]:
    """Moves there and returns when it rests within tolerance; DeviceError when that does not come to be.

    `until` is the deadline; `near` is a reading of a moment ago, at rest, which saves one; `presets` are the camera's
    stored ones as far as it is known where they look, as readings.
    """
    return Move(goal, limits, skill, until, presets or {}).plan(near)


class Move:
    """One move, put together from its parts."""

    def __init__(self, goal: Goal, limits: Limits, skill: Skill, until: float, presets: Mapping[int, Pose]) -> None:
        self.helm = Helm(goal, limits, skill, until)
        self.zooming = Zooming(self.helm)
        self.turning = Turning(self.helm, self.zooming)
        self.homing = Homing(self.helm, self.turning.watch)
        self.driving = Driving(self.helm, presets)
        self.hopping = Hopping(self.helm)

    def plan(self, near: Reading | None) -> Plan[Arrival]:
        """See `goto`."""
        reading, now = yield from self._begin(near)
        for _ in range(MOST_LEGS):
            out = self._out(reading)
            while self._just_beside(reading, out):
                reply = yield from self.helm.send(Status())
                reading, now = cast(Reading, reply.result), reply.received
                out = self._out(reading)
            if not out and self.helm.zoom_ends is None:
                return Arrival(reading, now, self.helm.goal.clamped, self.helm.rests)
            if now > self.helm.until or self.helm.stuck >= STUCK:
                raise DeviceError(
                    self._failed(reading, "in time" if now > self.helm.until else "the camera does not turn")
                )
            before = self.helm.limits.pose(reading)
            driven = yield from self._driven(reading, out, now)
            if driven is not None:
                reading, now = driven
                self.helm.turned = {PAN, TILT}
                self._notice(before, self.helm.limits.pose(reading), out)
                continue
            if {PAN, TILT} & set(out):
                now = yield from self.turning.turn([axis for axis in out if axis != ZOOM], now, zoom=ZOOM in out)
            elif self.helm.zoom_ends is None:
                now = yield from self.zooming.begin()
            else:
                now = yield from self.zooming.see_through(now)
            reading, now = yield from self.helm.rest((yield from self.zooming.settle(now)))
            self._notice(before, self.helm.limits.pose(reading), out)
        raise DeviceError(self._failed(reading, f"with {MOST_LEGS} motions"))

    def _driven(self, reading: Reading, out: list[int], now: float) -> Plan[tuple[Reading, float] | None]:
        """What the firmware does by itself, all or the end of it; None: nothing that is known of."""
        driven = yield from self.driving.drive(reading, now)
        if driven is None and self.helm.zoom_ends is None:
            driven = yield from self.hopping.hop(now)
        return driven or (yield from self.homing.home(out, now))

    def _begin(self, near: Reading | None) -> Plan[tuple[Reading, float]]:
        """Where it stands to begin with; a reading of a moment ago is as good as one now."""
        if near is None:
            reading, now = yield from settle()
            self.helm.commands += 2
        else:
            reading, now = near, (yield from wait(0.0))
            if near.moving is None and self._hardly_there(near):
                reply = yield from self.helm.send(Status())
                reading, now = cast(Reading, reply.result), reply.received
            here, foretold = self.helm.limits.pose(reading), self.helm.skill.foretold
            if foretold is not None and reading.moving is not None:
                self.helm.skill.ended(max(abs(here[axis] - foretold[axis]) for axis in (PAN, TILT)))
            self.helm.foretold = reading.moving is None
        self.helm.stand(reading)
        return reading, now

    def _hardly_there(self, reading: Reading) -> bool:
        """Whether it would be there already, but for what a rest that was foretold may be off."""
        pose = self.helm.limits.pose(reading)
        off = max(abs(self.helm.goal.pose[axis] - pose[axis]) for axis in (PAN, TILT))
        return self.helm.near - THERE_DEG < off <= self.helm.near

    def _out(self, reading: Reading) -> list[int]:
        """The axes that are not where they should be; zoom only while it does not turn.

        One that had arrived and was not turned since is not out because its reading dithers.
        """
        pose, dither = self.helm.limits.pose(reading), 2 * DITHER_DEG if self.helm.skill.dithers else 0.0
        near = [self.helm.near + (0.0 if axis in self.helm.turned else dither) for axis in (PAN, TILT)]
        out = [axis for axis in (PAN, TILT) if abs(self.helm.goal.pose[axis] - pose[axis]) > near[axis]]
        self.helm.turned = set(out)
        if self.helm.zoom_ends is None and abs(self.helm.goal.pose[ZOOM] - pose[ZOOM]) > self.helm.zoom_near:
            out.append(ZOOM)
        return out

    def _just_beside(self, reading: Reading, out: list[int]) -> bool:
        """Whether another look may tell that it is there, where there are too few commands for another leg.

        No reading that dithers is farther off than `near` leaves room for, so one that is near tells it.
        """
        helm, off = self.helm, [abs(self.helm.goal.pose[axis] - self.helm.limits.pose(reading)[axis]) for axis in out]
        few = PROMISED - LEG < helm.commands < PROMISED
        still = bool(out) and ZOOM not in out and helm.zoom_ends is None
        return helm.skill.dithers and few and still and max(off) <= helm.near + DITHER_DEG

    def _notice(self, before: Pose, after: Pose, out: list[int]) -> None:
        """Counts legs without effect; zoom may turn without a change of its coarse reading."""
        if max(abs(b - a) for b, a in zip(before, after, strict=True)) > MOVED:
            self.helm.stuck = 0
        elif self.helm.zoom_ends is None and out:
            self.helm.stuck += 1

    def _failed(self, reading: Reading, why: str) -> str:
        return (
            f"did not arrive at {self.helm.goal}, {why}; "
            f"it is at pan {reading.pan:.1f} tilt {reading.tilt:.1f} zoom {reading.zoom:g}"
        )
