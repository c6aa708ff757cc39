"""Cameras of any brand that speak ONVIF Profile S with PTZ. How SOAP is said and signed is `web/soap.py`.

Directions are the picture's (x to the right, y up). Positions are degrees where the camera has a space in degrees. The
generic space (-1 to 1) is the whole travel: on pan from one side of `pan_dead_arc` to the other, growing to the right
as the reading does; on tilt from the top (1, the least reading) to the bottom of `tilt_range`; zoom 0 to 1 is
`zoom_range`. Number n of our presets is the one that is named `apartment-n`, or else the camera's token n.
ONVIF does not tell how the picture is flipped, so there the configuration counts.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import inf, isfinite, nan
from xml.etree.ElementTree import Element
from xml.sax.saxutils import escape

import httpx

from services.camera import device
from services.camera.address import Address
from services.camera.capabilities import Capabilities, GetCapabilities
from services.camera.device import Away, Camera, Identity, Reading, Refused, Start, StreamAddress
from services.camera.errands import GetPresets
from services.camera.web.connection import SNAPSHOT, connection, fetch
from services.camera.web.digest import Login
from services.camera.web.gate import Gate
from services.camera.web.soap import DEVICE, FIRST, SCHEMA, Soap, local

MEDIA = "http://www.onvif.org/ver10/media/wsdl"
PTZ = "http://www.onvif.org/ver20/ptz/wsdl"
ITSELF_S = 30  # a motion whose stop is lost ends by itself after this: longer than the longest way at a middling speed
Bounds = tuple[float, float]
GENERIC: Bounds = (-1.0, 1.0)


@dataclass(frozen=True)
class Profile:
    """What the camera calls its picture and motors together, and the bounds of its position spaces."""

    token: str
    pan: Bounds
    tilt: Bounds
    zoom: Bounds

    @property
    def in_degrees(self) -> bool:
        """Whether the space is wider than the generic one."""
        return self.pan[1] - self.pan[0] > GENERIC[1] - GENERIC[0] + 0.1


class Onvif:
    """A Camera; where its services are, and its profile, are asked for once."""

    def __init__(
        self, address: Address, gate: Gate, transport: httpx.BaseTransport | None = None, *, urgent: bool = False
    ) -> None:
        self.address = address
        self.http = connection(address, Login(address.user, address.password, gate, urgent=urgent), transport)
        self.soap = Soap(self.http, address, gate, urgent=urgent)
        self._paths: dict[str, str] = {DEVICE: FIRST}
        self._profile: Profile | None = None
        self._node_token = ""

    def close(self) -> None:
        """Ends the connection."""
        self.http.close()

    def send(self, request: device.Request) -> object:
        """One request of ours, mostly one of the camera's; DeviceError as in `device.py`."""
        match request:
            case Start():
                return self._command("ContinuousMove", f"{velocity(request)}{_token('Timeout', f'PT{ITSELF_S}S')}")
            case device.TurnFor(right, down, zoom, seconds):
                speeds = vector("Velocity", right / 100, -down / 100, zoom / 100)
                return self._command("ContinuousMove", speeds + _token("Timeout", f"PT{seconds:.2f}S"))
            case device.MoveTo(pan, tilt, zoom, form="PositionABS"):
                where = position(Reading(pan, tilt, zoom), self._known_profile(), self.address)
                return self._command("AbsoluteMove", vector("Position", *where))
            case device.Stop():
                return self._command("Stop", "<PanTilt>true</PanTilt><Zoom>true</Zoom>")
            case device.Status():
                return read_reading(self._ptz("GetStatus"), self._known_profile(), self.address)
            case device.GotoPreset(number):
                return self._goto(number)
            case device.SavePreset(number):  # without a token the camera chooses one
                return self._command("SetPreset", f"<PresetName>apartment-{number}</PresetName>{self._preset(number)}")
            case device.ClearPreset(number):
                known = self._preset(number)
                return self._command("RemovePreset", known) if known else None
            case GetPresets():
                return frozenset(self._presets())
            case device.Snapshot():
                return self._snapshot()
            case device.FindStream():
                return self._stream()
            case device.Identify():
                return self._identify()
            case GetCapabilities("motors"):
                return read_capabilities(self._node())
            case device.Reboot():
                self._ask(DEVICE, "SystemReboot")
                return None
            case _:
                raise Refused(f"ONVIF has no {type(request).__name__}")

    def _ask(self, service: str, action: str, inner: str = "") -> Element:
        return self.soap.call(self._path(service), service, action, inner)

    def _path(self, service: str) -> str:
        """Where a service is; not on the host that the camera believes to have, which may be hidden by a router."""
        if service not in self._paths:
            told = self._ask(DEVICE, "GetServices", "<IncludeCapability>false</IncludeCapability>")
            for one in told.iterfind(f"{{{DEVICE}}}Service"):
                where = one.findtext(f"{{{DEVICE}}}XAddr") or ""
                self._paths.setdefault(one.findtext(f"{{{DEVICE}}}Namespace") or "", where)
        if service not in self._paths:
            raise Refused(f"the camera does not offer {service}")
        return local(self._paths[service])

    def _known_profile(self) -> Profile:
        """The first profile with motors."""
        if self._profile is None:
            told = self._ask(MEDIA, "GetProfiles").iterfind(f"{{{MEDIA}}}Profiles")
            mine = next((one for one in told if one.findtext(f"{SCHEMA}PTZConfiguration/{SCHEMA}NodeToken")), None)
            if mine is None:
                raise Refused("the camera has no ONVIF profile with motors")
            self._node_token = mine.findtext(f"{SCHEMA}PTZConfiguration/{SCHEMA}NodeToken") or ""
            self._profile = read_profile(mine.get("token", ""), self._node())
        return self._profile

    def _node(self) -> Element:
        if not self._node_token:
            self._known_profile()
        return self._ask(PTZ, "GetNode", _token("NodeToken", self._node_token))

    def _ptz(self, action: str, inner: str = "") -> Element:
        return self._ask(PTZ, action, _token("ProfileToken", self._known_profile().token) + inner)

    def _command(self, action: str, inner: str) -> object:
        self._ptz(action, inner)
        return None

    def _presets(self) -> dict[int, str]:
        return read_presets(self._ptz("GetPresets"))

    def _preset(self, number: int) -> str:
        """The camera's token for a number of ours; nothing when nothing is kept there."""
        token = self._presets().get(number)
        return "" if token is None else _token("PresetToken", token)

    def _goto(self, number: int) -> object:
        if not (known := self._preset(number)):
            raise Refused(f"the camera has no preset {number}")
        return self._command("GotoPreset", known)

    def _snapshot(self) -> bytes:
        told = self._ask(MEDIA, "GetSnapshotUri", _token("ProfileToken", self._known_profile().token))
        answer = fetch(self.http, local(told.findtext(f".//{SCHEMA}Uri") or ""), SNAPSHOT)
        if answer.status_code == 401:
            raise Away("the camera answered 401 without a reason to doubt the password")
        if not answer.content.startswith(b"\xff\xd8"):
            raise Away(f"expected a JPEG, got {answer.status_code} {answer.content[:40]!r}")
        return answer.content

    def _stream(self) -> StreamAddress:
        """On the host that the configuration names and its port; only the path is the camera's word."""
        setup = f'<Stream xmlns="{SCHEMA[1:-1]}">RTP-Unicast</Stream>'
        setup += f'<Transport xmlns="{SCHEMA[1:-1]}"><Protocol>RTSP</Protocol></Transport>'
        mine = _token("ProfileToken", self._known_profile().token)
        told = self._ask(MEDIA, "GetStreamUri", f"<StreamSetup>{setup}</StreamSetup>{mine}")
        host = httpx.URL(self.address.url).host
        where = f"[{host}]" if ":" in host else host
        return StreamAddress(f"rtsp://{where}:{self.address.rtsp_port}{local(told.findtext(f'.//{SCHEMA}Uri') or '')}")

    def _identify(self) -> Identity:
        told = self._ask(DEVICE, "GetDeviceInformation")
        keys = ("Model", "SerialNumber", "FirmwareVersion")
        model, serial, version = (told.findtext(f"{{{DEVICE}}}{key}") or "" for key in keys)
        return Identity(model, serial, version)


def connect(address: Address, gate: Gate, *, urgent: bool = False) -> Camera:
    """A client for the camera there; nothing is sent yet. `urgent`: it is the one that moves the motors."""
    return Onvif(address, gate, urgent=urgent)


def velocity(request: Start) -> str:
    """The speeds of a motion, 1 to 8, as eighths of the top speed."""
    right, down, zoom = request.direction.value
    pan_speed = min(8, max(1, request.speed)) / 8
    tilt_speed = min(8, max(1, request.tilt_speed or request.speed)) / 8 if right else pan_speed
    return vector("Velocity", right * pan_speed, -down * tilt_speed, zoom)


def vector(kind: str, x: float, y: float, z: float) -> str:
    """Numbers for each motor; speeds of zero are left out, for a camera may stop that motor for them."""
    turn = f'<PanTilt xmlns="{SCHEMA[1:-1]}" x="{x:.5f}" y="{y:.5f}"/>' if kind == "Position" or x or y else ""
    zoom = f'<Zoom xmlns="{SCHEMA[1:-1]}" x="{z:.5f}"/>' if kind == "Position" or z else ""
    return f"<{kind}>{turn}{zoom}</{kind}>"


def read_profile(token: str, node: Element) -> Profile:
    """A profile with the bounds that its motors' node tells."""
    pan = _bounds(node, "AbsolutePanTiltPositionSpace", "XRange", GENERIC)
    tilt = _bounds(node, "AbsolutePanTiltPositionSpace", "YRange", GENERIC)
    return Profile(token, pan, tilt, _bounds(node, "AbsoluteZoomPositionSpace", "XRange", (0.0, 1.0)))


def read_capabilities(node: Element) -> Capabilities:
    """What the motors' node tells; every ContinuousMove can be told when to end."""
    kinds = {one.tag.removeprefix(SCHEMA) for one in node.iterfind(f".//{SCHEMA}SupportedPTZSpaces/*")}
    most = node.findtext(f".//{SCHEMA}MaximumNumberOfPresets") or ""
    return Capabilities(
        presets=int(most) if most.isdecimal() else 0,
        absolute="AbsolutePanTiltPositionSpace" in kinds,
        relative="RelativePanTiltTranslationSpace" in kinds,
        timed="ContinuousPanTiltVelocitySpace" in kinds,
        zoom="ContinuousZoomVelocitySpace" in kinds,
    )


def read_presets(told: Element) -> dict[int, str]:
    """The camera's tokens by number; a name of ours counts more than what the token is."""
    kept = {one.get("token", ""): one.findtext(f"{SCHEMA}Name") or "" for one in told.iterfind(f"{{{PTZ}}}Preset")}
    plain = {int(token): token for token in kept if re.fullmatch("[0-9]{1,9}", token)}
    return plain | {int(name[10:]): token for token, name in kept.items() if re.fullmatch("apartment-[0-9]{1,9}", name)}


def read_reading(told: Element, profile: Profile, address: Address) -> Reading:
    """Degrees as the camera reads them, by the convention above; Away when the camera tells no position."""
    found, zoomed = (told.find(f".//{SCHEMA}Position/{SCHEMA}{part}") for part in ("PanTilt", "Zoom"))
    if found is None:
        raise Away("expected a position in the camera's status, got none")
    x, y, z = _number(found, "x"), _number(found, "y"), 0.0 if zoomed is None else _number(zoomed, "x")
    if profile.in_degrees:
        pan, tilt = x, -y
    else:
        (low, high), (dead, after) = address.tilt_range, address.pan_dead_arc
        pan = after + _share(x, profile.pan) * (360.0 - (after - dead))
        tilt = high - _share(y, profile.tilt) * (high - low)
    wide, close = address.zoom_range
    words = {node.text for node in told.iterfind(f".//{SCHEMA}MoveStatus/*")}
    moving = True if "MOVING" in words else False if "IDLE" in words else None
    zoom = wide + _share(z, profile.zoom) * (close - wide)
    return Reading(round(pan, 2) % 360.0, round(tilt, 2), round(zoom, 2), moving)


def position(goal: Reading, profile: Profile, address: Address) -> tuple[float, float, float]:
    """The other way: readings in the camera's spaces, never beyond their bounds."""
    (low, high), (dead, after), (wide, close) = address.tilt_range, address.pan_dead_arc, address.zoom_range
    if profile.in_degrees:
        x, y = (goal.pan + 180.0) % 360.0 - 180.0, -goal.tilt
    else:
        x = _within(((goal.pan - after) % 360.0) / (360.0 - (after - dead)), profile.pan)
        y = _within((high - goal.tilt) / (high - low), profile.tilt)
    return x, y, _within((goal.zoom - wide) / (close - wide), profile.zoom)


def _within(share: float, bounds: Bounds) -> float:
    return bounds[0] + min(max(share, 0.0), 1.0) * (bounds[1] - bounds[0])


def _share(value: float, bounds: Bounds) -> float:
    return (value - bounds[0]) / (bounds[1] - bounds[0])


def _token(tag: str, text: str) -> str:
    return f"<{tag}>{escape(text)}</{tag}>"


def _number(node: Element, key: str) -> float:
    try:
        number = float(node.get(key, ""))
    except ValueError:
        number = nan
    if not isfinite(number):
        raise Away(f"expected a number from the camera, got {node.get(key)!r}")
    return number


def _bounds(node: Element, space: str, axis: str, otherwise: Bounds) -> Bounds:
    """The bounds of the first such space; `otherwise` when they are not told or make no sense."""
    ends = [node.findtext(f".//{SCHEMA}{space}/{SCHEMA}{axis}/{SCHEMA}{end}") for end in ("Min", "Max")]
    try:
        low, high = (float(end or "") for end in ends)
    except ValueError:
        return otherwise
    return (low, high) if -inf < low < high < inf else otherwise
