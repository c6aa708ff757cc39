"""The PTZ service: one node, one configuration, the generic spaces. Pure; the time comes in.

-1 to 1 is the whole travel: x grows to the right in the picture of a camera that hangs as it should (so does the
reading), y grows upwards; zoom is 0 to 1.
"""

from __future__ import annotations

import re
from datetime import UTC, datetime
from math import isfinite
from xml.etree.ElementTree import Element
from xml.sax.saxutils import escape

from services.simulators.camera.device import Device
from services.simulators.camera.motors import CODES, ZOOM_MAX, Axes, Pose
from services.simulators.camera.onvif.soap import Fault, tag, text

PROFILE, CONFIGURATION, NODE = "MediaProfile000", "PTZ000", "PTZNODE000"
SPACES = "http://www.onvif.org/ver10/tptz"
TOP = 8  # a speed of 1 is the fastest of the CGI side's levels
DEFAULT_S = 10.0  # a continuous move without a timeout
DURATION = re.compile(r"PT(?:(\d+)H)?(?:(\d+)M)?(?:(\d+(?:\.\d+)?)S)?")
OFFERED = (  # the kinds of spaces, and whether they have two axes
    ("AbsolutePanTiltPositionSpace", "PanTiltSpaces/PositionGenericSpace", ("X", "Y"), -1),
    ("AbsoluteZoomPositionSpace", "ZoomSpaces/PositionGenericSpace", ("X",), 0),
    ("ContinuousPanTiltVelocitySpace", "PanTiltSpaces/VelocityGenericSpace", ("X", "Y"), -1),
    ("ContinuousZoomVelocitySpace", "ZoomSpaces/VelocityGenericSpace", ("X",), -1),
)


class PtzService:
    """Positions and speeds of the generic spaces, made those of the motors."""

    def __init__(self, device: Device) -> None:
        self._device, self._ptz = device, device.ptz

    def node(self, asked: Element, now: float) -> str:
        """The one node, and the bounds of its spaces."""
        if asked.tag.endswith("}GetNode") and text(asked, "NodeToken") != NODE:
            raise Fault("No such PTZ node", "env:Sender", "ter:InvalidArgVal", "ter:NoEntity")
        spaces = ""
        for kind, name, axes, least in OFFERED:
            ends = tag("tt:Min", str(least)) + tag("tt:Max", "1")
            spaces += tag(
                f"tt:{kind}", tag("tt:URI", f"{SPACES}/{name}") + "".join(tag(f"tt:{a}Range", ends) for a in axes)
            )
        inner = tag("tt:Name", NODE) + tag("tt:SupportedPTZSpaces", spaces)
        inner += tag("tt:MaximumNumberOfPresets", str(self._device.profile.preset_max)) + tag(
            "tt:HomeSupported", "false"
        )
        return tag("tptz:PTZNode", inner, token=NODE)

    def status(self, asked: Element, now: float) -> str:
        """Where it looks, and whether it moves."""
        pose, rates = self._device.motion(now)
        words = ["MOVING" if moves else "IDLE" for moves in (rates.pan or rates.tilt, rates.zoom)]
        moving = tag("tt:PanTilt", words[0]) + tag("tt:Zoom", words[1])
        utc = datetime.fromtimestamp(now, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        inner = tag("tt:Position", self._vector(pose)) + tag("tt:MoveStatus", moving) + tag("tt:UtcTime", utc)
        return tag("tptz:PTZStatus", inner)

    def continuous(self, asked: Element, now: float) -> str:
        """Turns at these speeds until a stop, or until the timeout is over."""
        x, y, z = (_axis(asked, "Velocity", part, key, 0.0, -1.0) for part, key in AXES)
        if not (x or y or z):
            return self.stop(asked, now)
        signs = (_sign(x), _sign(y), 0) if x or y else (0, 0, _sign(z))
        code = next(code for code, axes in CODES.items() if axes == signs)
        inverts, tables = self._device.profile.mirror_inverts_motors, self._device.tables
        flip, mirror = (-1 if inverts and tables.flag(f"VideoInOptions[0].{key}") else 1 for key in ("Flip", "Mirror"))
        levels = (max(1, round(TOP * abs(value))) for value in (x, y, z))
        ways = (mirror * signs[0], flip * signs[1], signs[2])
        motors = self._ptz.motors
        speeds = (way * rail.speed(level) for way, rail, level in zip(ways, motors.rails, levels, strict=True))
        motors.turn(code, Axes(*speeds), now, seconds(text(asked, "Timeout")))
        return ""

    def absolute(self, asked: Element, now: float) -> str:
        """Goes to a position; what is left out stays."""
        here = self._shares(self._device.motion(now)[0])
        x, y, z = (_axis(asked, "Position", part, key, at, 0.0 if part == "Zoom" else -1.0)
                   for (part, key), at in zip(AXES, here, strict=True))  # fmt: skip
        camera = self._device.camera
        (dead, after), (top, bottom) = camera.pan_dead_arc, camera.tilt_range
        pan = (after + (x + 1.0) / 2.0 * (dead - after + 360.0)) % 360.0
        self._go(Pose(pan, top + (1.0 - y) / 2.0 * (bottom - top), z * ZOOM_MAX), now)
        return ""

    def stop(self, asked: Element, now: float) -> str:
        """Ends every motion, of whatever kind."""
        self._ptz.motors.halt(now)
        return ""

    def presets(self, asked: Element, now: float) -> str:
        """The list; tokens are the numbers of the CGI side."""
        return "".join(
            tag("tptz:Preset", tag("tt:Name", escape(name)) + tag("tt:PTZPosition", self._vector(pose)), token=number)
            for number, (name, pose) in sorted(self._ptz.presets.items())
        )

    def set_preset(self, asked: Element, now: float) -> str:
        """Keeps the pose; the device gives out new tokens itself, so one that it does not know is refused."""
        pose, rates = self._device.motion(now)
        if any(rates):
            raise Fault("PTZ is moving", "env:Receiver", "ter:Action", "ter:MovingPTZ")
        kept, free = self._ptz.presets, range(1, self._device.profile.preset_max + 1)
        number = self._number(asked) if text(asked, "PresetToken") else next((n for n in free if n not in kept), 0)
        if not number:
            raise Fault("Maximum number of presets reached", "env:Receiver", "ter:Action", "ter:TooManyPresets")
        old = kept[number][0] if number in kept else f"Preset{number}"
        kept[number] = (text(asked, "PresetName") or old, pose)
        return tag("tptz:PresetToken", str(number))

    def goto_preset(self, asked: Element, now: float) -> str:
        """Goes to a preset."""
        self._go(self._ptz.presets[self._number(asked)][1], now)
        return ""

    def remove_preset(self, asked: Element, now: float) -> str:
        """Forgets a preset."""
        del self._ptz.presets[self._number(asked)]
        return ""

    def _go(self, pose: Pose, now: float) -> None:
        self._ptz.motors.go(pose, now)

    def _number(self, asked: Element) -> int:
        said = text(asked, "PresetToken")
        if not said.isdigit() or int(said) not in self._ptz.presets:
            raise Fault("No such preset token", "env:Sender", "ter:InvalidArgVal", "ter:NoToken")
        return int(said)

    def _shares(self, pose: Pose) -> tuple[float, float, float]:
        camera = self._device.camera
        (dead, after), (top, bottom) = camera.pan_dead_arc, camera.tilt_range
        x = 2.0 * ((pose.pan - after) % 360.0) / (dead - after + 360.0) - 1.0
        return min(x, 1.0), 1.0 - 2.0 * (pose.tilt - top) / (bottom - top), pose.zoom / ZOOM_MAX

    def _vector(self, pose: Pose) -> str:
        x, y, z = self._shares(pose)
        turned = f'<tt:PanTilt x="{x:.6f}" y="{y:.6f}" space="{SPACES}/PanTiltSpaces/PositionGenericSpace"/>'
        return f'{turned}<tt:Zoom x="{z:.6f}" space="{SPACES}/ZoomSpaces/PositionGenericSpace"/>'


AXES = (("PanTilt", "x"), ("PanTilt", "y"), ("Zoom", "x"))


def seconds(duration: str) -> float:
    """An `xs:duration` in seconds, as far as motors need it: PT1M2.5S."""
    found = DURATION.fullmatch(duration)
    if not duration:
        return DEFAULT_S
    if found is None or not any(found.groups()):
        raise Fault("Timeout is not a duration", "env:Sender", "ter:InvalidArgVal")
    return sum(float(part or 0.0) * unit for part, unit in zip(found.groups(), (3600.0, 60.0, 1.0), strict=True))


def _axis(asked: Element, kind: str, part: str, key: str, otherwise: float, least: float) -> float:
    """One number of a vector; a Fault when it is none or outside the space."""
    found = asked.find(f"{{*}}{kind}/{{*}}{part}")
    if found is None:
        return otherwise
    try:
        value = float(found.get(key, ""))
    except ValueError:
        value = float("nan")
    if not isfinite(value) or not least <= value <= 1.0:
        code = "ter:InvalidPosition" if kind == "Position" else "ter:InvalidVelocity"
        raise Fault("Value out of bounds", "env:Sender", "ter:InvalidArgVal", code)
    return value


def _sign(value: float) -> int:
    return (value > 0) - (value < 0)
