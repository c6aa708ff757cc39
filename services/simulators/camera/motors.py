"""Pan, tilt and digital zoom: what moves, how far, and where that is. Pure; the time comes in.

Pan is kept as its travel `p`, degrees from one end stop's side; the camera reads (180 - p) mod 360. So the dead arc
of readings, which the camera can never cross, is simply what lies outside the travel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from services.simulators.camera.profiles import Profile
from services.simulators.true_camera import WorldCamera

ZOOM_MAX = 8.0
MOMENT_S = 1e-3
ZOOM_STEP = 2.0  # the status tells five levels apart: 0, 2, 4, 6, 8
# signs of travel, tilt and zoom of each code, in a picture that is neither flipped nor mirrored
CODES: dict[str, tuple[int, int, int]] = {
    "Up": (0, 1, 0),
    "Down": (0, -1, 0),
    "Left": (-1, 0, 0),
    "Right": (1, 0, 0),
    "LeftUp": (-1, 1, 0),
    "RightUp": (1, 1, 0),
    "LeftDown": (-1, -1, 0),
    "RightDown": (1, -1, 0),
    "ZoomTele": (0, 0, 1),
    "ZoomWide": (0, 0, -1),
}


class Pose(NamedTuple):
    """Pan and tilt in degrees as the camera reads them, without rounding; zoom 0 (widest) to 8."""

    pan: float
    tilt: float
    zoom: float


class Axes(NamedTuple):
    """One number for each motor: travel of pan and tilt in degrees (or degrees/s), zoom in levels (or levels/s)."""

    travel: float
    tilt: float
    zoom: float


@dataclass(frozen=True)
class Motion:
    """What the motors are doing: with speeds until stopped, or towards a goal with at most these speeds."""

    code: str
    speeds: Axes
    goal: Axes | None = None


def magnification(zoom: float) -> float:
    """How much larger than at the widest zoom: 1 to 3."""
    return 1.0 + zoom / 4.0


def reading(pose: Pose) -> Pose:
    """What the camera says about a pose: tenths of degrees, five levels of zoom."""
    return Pose(round(pose.pan, 1) % 360.0, round(pose.tilt, 1), round(pose.zoom / ZOOM_STEP) * ZOOM_STEP)


class Motors:
    """Holds the position and what moves. Every call brings it to `now` first, which must not go back."""

    def __init__(self, camera: WorldCamera, profile: Profile, now: float) -> None:
        low, high = camera.pan_dead_arc
        self._least = Axes((180.0 - low) % 360.0, camera.tilt_range[0], 0.0)
        self._most = Axes((180.0 - high) % 360.0, camera.tilt_range[1], ZOOM_MAX)
        self._profile, self._now = profile, now
        self._fastest = self._speeds(8, 8, profile.zoom_speed)
        self.motion: Motion | None = None
        self._at = self._within(self.travel(Pose(*camera.starts_at)))

    def travel(self, pose: Pose) -> Axes:
        """The axes' positions at readings."""
        return Axes((180.0 - pose.pan) % 360.0, pose.tilt, pose.zoom)

    def pose(self, now: float) -> Pose:
        """Where the motors truly stand."""
        self.advance(now)
        return Pose((180.0 - self._at.travel) % 360.0, self._at.tilt, self._at.zoom)

    def rates(self, now: float) -> Pose:
        """How fast the readings change: degrees/s, levels/s; zero on an axis that stands."""
        self.advance(now)
        if self.motion is None:
            return Pose(0.0, 0.0, 0.0)
        travel, tilt, zoom = (
            (b - a) / MOMENT_S for a, b in zip(self._at, self._after(self.motion, MOMENT_S)[0], strict=True)
        )
        return Pose(-travel, tilt, zoom)

    def advance(self, now: float) -> None:
        """Moves on to `now`; a motion that has reached its goal or its end stops is over."""
        seconds, self._now = max(now - self._now, 0.0), max(now, self._now)
        if self.motion is not None:
            self._at, ended = self._after(self.motion, seconds)
            self.motion = None if ended else self.motion

    def start(self, code: str, vertical: int, horizontal: int, now: float, *, flip: bool, mirror: bool) -> bool:
        """Begins to turn or zoom until stopped, instead of what it did; False when the camera ignores that."""
        self.advance(now)
        travel, tilt, zoom = CODES[code]
        if not zoom and (horizontal < 1 or (travel and tilt and vertical < 1)):
            return False
        speeds = self._speeds(horizontal, vertical if travel and tilt else horizontal, self._profile.zoom_speed)
        signs = Axes(-travel if mirror else travel, -tilt if flip else tilt, zoom)
        self.motion = Motion(code, Axes(*(a * b for a, b in zip(speeds, signs, strict=True))))
        return True

    def stop(self, code: str, now: float) -> None:
        """Ends the motion that was started with this code, and no other."""
        self.advance(now)
        if self.motion is not None and self.motion.code == code:
            self.motion = None

    def go(self, goal: Pose, now: float) -> None:
        """Drives all axes to a pose, clamped to the stops; never through the dead arc."""
        self.advance(now)
        self.motion = Motion("goto", self._fastest, self._within(self.travel(goal)))

    def halt(self, now: float) -> None:
        """Ends whatever moves (power off)."""
        self.advance(now)
        self.motion = None

    def place(self, pose: Pose, now: float) -> None:
        """Puts the camera there at once (the tests' side door)."""
        self.halt(now)
        self._at = self._within(self.travel(pose))

    def _speeds(self, pan: int, tilt: int, zoom: float) -> Axes:
        return Axes(self._profile.speed(pan), self._profile.speed(tilt) * self._profile.tilt_share, zoom)

    def _after(self, motion: Motion, seconds: float) -> tuple[Axes, bool]:
        """Where the axes are after so long, and whether they then stand for good."""
        if motion.goal is None:
            there = self._within(Axes(*(a + v * seconds for a, v in zip(self._at, motion.speeds, strict=True))))
            on = zip(there, motion.speeds, self._least, self._most, strict=True)
            return there, all(at == (low if v < 0 else high) for at, v, low, high in on if v)
        steps = zip(self._at, motion.goal, motion.speeds, strict=True)
        there = Axes(*(goal if abs(goal - at) <= v * seconds else at + (v if goal > at else -v) * seconds
                       for at, goal, v in steps))  # fmt: skip
        return there, there == motion.goal

    def _within(self, axes: Axes) -> Axes:
        return Axes(*(min(max(a, low), high) for a, low, high in zip(axes, self._least, self._most, strict=True)))
