"""Pan, tilt and digital zoom: what moves, where that is, and what has been asked of it. Pure; the time comes in.

Pan is kept as its travel `p`, degrees from one end stop's side; the camera reads (180 - p) mod 360. So the dead arc
of readings, which the camera can never cross, is simply what lies outside the travel. How one motor moves is in
`track`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from services.simulators.camera.profiles import Profile
from services.simulators.camera.track import Moment, Rail, Track, go, run, stand
from services.simulators.true_camera import WorldCamera

ZOOM_MAX = 8.0
REMEMBERED_S = 10.0  # how far back a status may look
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

    pan: float
    tilt: float
    zoom: float


@dataclass(frozen=True)
class Motion:
    """What the motors do since a command: its code, and a track for pan (its travel), tilt and zoom each."""

    code: str
    began: float
    tracks: tuple[Track, Track, Track]


@dataclass(frozen=True)
class Worked:
    """What the motors have done: how far each went, how long each was pushed against an end stop, motions begun."""

    travelled: Axes
    pushed_s: Axes
    motions: int


def travel(pose: Pose) -> Axes:
    """The motors' positions at readings."""
    return Axes((180.0 - pose.pan) % 360.0, pose.tilt, pose.zoom)


def magnification(zoom: float) -> float:
    """How much larger than at the widest zoom: 1 to 3."""
    return 1.0 + zoom / 4.0


def reading(pose: Pose) -> Pose:
    """What the camera says about a pose: tenths of degrees, five levels of zoom."""
    return Pose(round(pose.pan, 1) % 360.0, round(pose.tilt, 1), round(pose.zoom / ZOOM_STEP) * ZOOM_STEP)


class Motors:
    """Three motors on their rails, and what they were told last; times must not go back, but the past can be seen."""

    def __init__(self, camera: WorldCamera, profile: Profile, now: float) -> None:
        self.rails = rails(camera, profile)
        self._past: deque[Motion] = deque()
        self._travelled = self._pushed = Axes(0.0, 0.0, 0.0)
        self._motions = 0
        self.place(Pose(*camera.starts_at), now)

    def pose(self, at: float) -> Pose:
        """Where the motors truly stood at that time."""
        pan, tilt, zoom = (moment.position for moment in self._moments(at))
        return Pose((180.0 - pan) % 360.0, tilt, zoom)

    def rates(self, at: float) -> Pose:
        """How fast the readings changed: degrees/s, levels/s; zero on an axis that stands."""
        pan, tilt, zoom = (moment.speed for moment in self._moments(at))
        return Pose(-pan, tilt, zoom)

    @property
    def code(self) -> str:
        """Of the last motion; empty when it was stopped."""
        return self._past[-1].code

    @property
    def rests_at(self) -> float:
        """When the last motion ends, if nobody stops it."""
        return max(track.ends for track in self._past[-1].tracks)

    def worked(self, now: float) -> Worked:
        """What they have done so far."""
        tracks = self._past[-1].tracks
        travelled = (old + track.travelled(now) for old, track in zip(self._travelled, tracks, strict=True))
        pushed = (old + track.pushed(now) for old, track in zip(self._pushed, tracks, strict=True))
        return Worked(Axes(*travelled), Axes(*pushed), self._motions)

    def start(self, code: str, vertical: int, horizontal: int, now: float, *, flip: bool, mirror: bool) -> bool:
        """Begins to turn or zoom until stopped, instead of what it did; False when the camera ignores that."""
        pan, tilt, zoom = CODES[code]
        if not zoom and (horizontal < 1 or (pan and tilt and vertical < 1)):
            return False
        signs = Axes(-pan if mirror else pan, -tilt if flip else tilt, zoom)
        levels = (horizontal, vertical if pan and tilt else horizontal, 1)
        speeds = (sign * rail.speed(level) for sign, rail, level in zip(signs, self.rails, levels, strict=True))
        self.turn(code, Axes(*speeds), now)
        return True

    def turn(self, code: str, speeds: Axes, now: float, seconds: float = inf) -> None:
        """Begins to turn with these speeds (of travel, tilt and zoom), for so long or until stopped."""
        self._begin(code, now, lambda axis, rail, at: run(rail, at, now, speeds[axis], seconds))
        self._motions += 1

    def stop(self, code: str, now: float) -> None:
        """Slows down the motion that was started with this code, and no other."""
        if self.code == code:
            self.halt(now)

    def go(self, goal: Pose, now: float, code: str = "GotoPreset", level: int = 8) -> None:
        """Drives all axes to a pose, clamped to the stops; never through the dead arc."""
        self.drive(travel(goal), now, code, level)

    def drive(self, goal: Axes, now: float, code: str, level: int = 8) -> None:
        """The same, to positions of the motors."""
        self._begin(code, now, lambda axis, rail, at: go(rail, at, now, goal[axis], rail.speed(level)))
        self._motions += 1

    def halt(self, now: float) -> None:
        """Slows down whatever moves."""
        self._begin("", now, lambda axis, rail, at: run(rail, at, now, 0.0))

    def place(self, pose: Pose, now: float) -> None:
        """Puts the camera there at once, at rest, as if it had always been there (power-on, the tests' side door)."""
        if self._past:
            self._note(now)
        self._past.clear()
        pan, tilt, zoom = (stand(rail.within(at), now) for rail, at in zip(self.rails, travel(pose), strict=True))
        self._past.append(Motion("", now, (pan, tilt, zoom)))

    def _moments(self, at: float) -> list[Moment]:
        motion = next((motion for motion in reversed(self._past) if motion.began <= at), self._past[0])
        moments = (track.at(max(at, motion.began)) for track in motion.tracks)
        return [Moment(rail.within(place), speed) for rail, (place, speed) in zip(self.rails, moments, strict=True)]

    def _begin(self, code: str, now: float, track: Callable[[int, Rail, Moment], Track]) -> None:
        now_at = self._moments(now)
        self._note(now)
        pan, tilt, zoom = (track(axis, self.rails[axis], now_at[axis]) for axis in range(3))
        self._past.append(Motion(code, now, (pan, tilt, zoom)))
        while len(self._past) > 1 and self._past[1].began < now - REMEMBERED_S:
            self._past.popleft()

    def _note(self, now: float) -> None:
        """Keeps the sums of the motion that ends now."""
        worked = self.worked(now)
        self._travelled, self._pushed = worked.travelled, worked.pushed_s


def rails(camera: WorldCamera, profile: Profile) -> tuple[Rail, Rail, Rail]:
    """The motors of a camera with this firmware: pan (its travel), tilt and zoom."""
    low, high = camera.pan_dead_arc
    tilt_speeds = tuple(speed * profile.tilt_share for speed in profile.pan_speeds)
    return (
        Rail((180.0 - low) % 360.0, (180.0 - high) % 360.0, profile.pan_speeds, profile.pan_acceleration),
        Rail(*camera.tilt_range, tilt_speeds, profile.tilt_acceleration),
        Rail(0.0, ZOOM_MAX, (profile.zoom_speed,), profile.zoom_acceleration),
    )
