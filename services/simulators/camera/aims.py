"""Commands that name a position or a speed and not only a direction: absolute, relative, in the picture, timed. Pure.

Inferred: a relative step of 8191 goes from the picture's middle to its edge, a share of 1 of moveRelatively is half
a turn, and moveAbsolutely means readings where PositionABS means the travel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import atan, degrees, inf, isfinite

from services.simulators.camera.messages import Request
from services.simulators.camera.motors import ZOOM_MAX, Axes, Pose, magnification, travel
from services.simulators.camera.profiles import Profile
from services.simulators.camera.track import Rail
from services.simulators.true_camera import Lens

PLANE = 8191.0  # of a relative step
PICTURE = 8192.0  # from the left or upper edge of the picture to the other
LEAST_SHARE = 4.0  # of 100: a timed move that is slower is ignored
LONGEST_S = 3600.0
HALF_TURN = 180.0


@dataclass(frozen=True)
class Drive:
    """Where each motor is to go, and with which speed."""

    goal: Axes
    level: int = 8


@dataclass(frozen=True)
class Speeds:
    """Shares of the top speeds of travel, tilt and zoom, and for how long."""

    shares: Axes
    seconds: float

    def axes(self, rails: tuple[Rail, Rail, Rail]) -> Axes:
        """The same in degrees/s and levels/s."""
        return Axes(*(share * rail.speeds[-1] for share, rail in zip(self.shares, rails, strict=True)))


@dataclass(frozen=True)
class Stand:
    """How the camera stands: its lens, its pose, and which way travel and tilt go to the right and down."""

    lens: Lens
    pose: Pose
    signs: tuple[int, int]

    def towards(self, x: float, y: float, zoom: float) -> Axes:
        """The motors' goal for a point of the picture, in halves of its width and height from the middle."""
        larger = magnification(self.pose.zoom)
        right = degrees(atan(x * self.lens.width / (2 * self.lens.fx * larger)))
        down = degrees(atan(y * self.lens.height / (2 * self.lens.fy * larger)))
        return self.turned(right, down, zoom)

    def turned(self, right: float, down: float, zoom: float) -> Axes:
        """The motors' goal so many degrees to the right and down."""
        here, (pan, tilt) = travel(self.pose), self.signs
        return Axes(here.pan + pan * right, here.tilt + tilt * down, zoom)


def read(request: Request, code: str, profile: Profile, stand: Stand) -> Drive | Speeds | None:
    """What a command asks for; None: it is ignored; ValueError: this firmware refuses it."""
    takes, how = COMMANDS[code]
    if not takes(profile):
        raise ValueError(f"{code} is not implemented")
    return how(request, profile, stand)


def _numbers(request: Request, most: float) -> tuple[float, float, float]:
    numbers = tuple(request.number(f"arg{index}") for index in (1, 2, 3))
    if not all(isfinite(number) and abs(number) <= most for number in numbers):
        raise ValueError(f"out of range: {numbers}")
    return numbers[0], numbers[1], numbers[2]


def _absolute(request: Request, profile: Profile, stand: Stand) -> Drive:
    """`arg1` is the travel, not the reading: asked for 180, the camera reads 0."""
    pan, tilt, zoom = _numbers(request, 360.0)
    if profile.position_abs == "pan-only":
        return Drive(Axes(pan, stand.pose.tilt, zoom))
    level = int(request.number("arg4", 8))
    return Drive(Axes(pan, tilt + profile.position_abs_tilt_off, zoom), level)


def _relative(request: Request, profile: Profile, stand: Stand) -> Drive:
    x, y, zoom = _numbers(request, PLANE)
    return Drive(stand.towards(x / PLANE, y / PLANE, stand.pose.zoom + zoom))


def _by_shares(request: Request, profile: Profile, stand: Stand) -> Drive:
    x, y, zoom = _numbers(request, 1.0)
    return Drive(stand.turned(HALF_TURN * x, HALF_TURN * y, stand.pose.zoom + ZOOM_MAX * zoom))


def _to_shares(request: Request, profile: Profile, stand: Stand) -> Drive:
    x, y, zoom = _numbers(request, 1.0)
    return Drive(travel(Pose((HALF_TURN * x) % 360.0, -HALF_TURN * y, ZOOM_MAX * max(zoom, 0.0))))


def _at_rectangle(request: Request, profile: Profile, stand: Stand) -> Drive:
    """Its middle comes to the middle of the picture, and as large as it fits."""
    (left, right), (top, bottom) = (
        [request.number(f"{point}[{axis}]") for point in ("startPoint", "endPoint")] for axis in (0, 1)
    )
    if not all(0 <= value <= PICTURE for value in (left, right, top, bottom)):
        raise ValueError("outside the picture")
    side = max(abs(right - left), abs(bottom - top)) / PICTURE
    larger = magnification(stand.pose.zoom) / side if side else magnification(stand.pose.zoom)
    return Drive(stand.towards((left + right) / PICTURE - 1.0, (top + bottom) / PICTURE - 1.0, 4.0 * (larger - 1.0)))


def _timed(request: Request, profile: Profile, stand: Stand) -> Speeds | None:
    shares = [value / 100.0 if abs(value) >= LEAST_SHARE else 0.0 for value in _numbers(request, 100.0)]
    seconds = request.number("arg4")
    if not 0.0 <= seconds <= LONGEST_S:
        raise ValueError(f"{seconds} s")
    right, up, zoom = shares
    axes = Axes(stand.signs[0] * right, -stand.signs[1] * up, zoom)
    return Speeds(axes, seconds or inf) if any(shares) else None


Takes = Callable[[Profile], bool]
How = Callable[[Request, Profile, Stand], Drive | Speeds | None]
COMMANDS: dict[str, tuple[Takes, How]] = {
    "PositionABS": (lambda profile: profile.position_abs != "bad-request", _absolute),
    "Position": (lambda profile: profile.position_relative == "works", _relative),
    "Continuously": (lambda profile: profile.continuously, _timed),
    "moveAbsolutely": (lambda profile: profile.moves == "readings", _to_shares),
    "moveRelatively": (lambda profile: profile.moves != "none", _by_shares),
    "moveDirectly": (lambda profile: profile.moves == "readings", _at_rectangle),
}
