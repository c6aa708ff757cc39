"""Answers ONVIF messages: device and media service here, the PTZ service in `motors`. Pure; the time comes in."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.sax.saxutils import escape

from services.simulators.camera.device import Device
from services.simulators.camera.messages import Answer
from services.simulators.camera.onvif.motors import CONFIGURATION, NODE, PROFILE, SPACES, PtzService
from services.simulators.camera.onvif.soap import NAMES, SOAP, Fault, Signatures, framed, refused, tag, text

PATHS = {"tds": "/onvif/device_service", "trt": "/onvif/media_service", "tptz": "/onvif/ptz_service"}
SOURCE = "VideoSource000"
OPEN = ("GetSystemDateAndTime", "GetServices", "GetCapabilities")  # before any login (access class PRE_AUTH)

Operation = Callable[[Element, float], str]


class Onvif:
    """One camera's services."""

    def __init__(self, device: Device, user: str, password: str) -> None:
        self._device, self._signatures = device, Signatures(user, password)
        motors = PtzService(device)
        self.rtsp_port: int | None = None  # where the stream is, once that runs
        self._host = ""  # as the client calls it: for the addresses that are told
        device_service: dict[str, Operation] = {
            "GetSystemDateAndTime": self._time, "GetServices": self._services, "GetCapabilities": self._capabilities,
            "GetDeviceInformation": self._information, "SystemReboot": self._reboot,
        }  # fmt: skip
        media: dict[str, Operation] = {
            "GetProfiles": self._profiles,
            "GetSnapshotUri": self._snapshot_uri,
            "GetStreamUri": self._stream_uri,
        }
        ptz: dict[str, Operation] = {
            "GetNodes": motors.node, "GetNode": motors.node, "GetStatus": motors.status, "Stop": motors.stop,
            "ContinuousMove": motors.continuous, "AbsoluteMove": motors.absolute, "GetPresets": motors.presets,
            "SetPreset": motors.set_preset, "GotoPreset": motors.goto_preset, "RemovePreset": motors.remove_preset,
        }  # fmt: skip
        self._operations: dict[str, dict[str, Operation]] = {"tds": device_service, "trt": media, "tptz": ptz}

    def set_account(self, user: str, password: str) -> None:
        """Whom it lets in from now on."""
        self._signatures = Signatures(user, password)

    def answer(self, body: bytes, host: str, now: float) -> Answer:
        """One message to any of the services; `host` is how the client called the camera."""
        self._host = host
        try:
            message = ElementTree.fromstring(body)
            asked = message.find(f"{{{SOAP}}}Body/*")
            if asked is None:
                raise Fault("Well-formed Error", "env:Sender", "ter:WellFormed")
            return framed(self._act(message, asked, now))
        except ElementTree.ParseError:
            return refused(Fault("Well-formed Error", "env:Sender", "ter:WellFormed"))
        except Fault as fault:
            return refused(fault)

    def _act(self, message: Element, asked: Element, now: float) -> str:
        space, _, action = asked.tag[1:].partition("}")
        service = next((name for name in PATHS if NAMES[name] == space), "tds")
        if action not in OPEN:
            self._signatures.check(message, now)
        act = self._operations[service].get(action)
        if act is None:
            raise Fault("Action not implemented", "env:Receiver", "ter:ActionNotSupported")
        if asked.find("{*}ProfileToken") is not None and text(asked, "ProfileToken") != PROFILE:
            raise Fault("No such profile token", "env:Sender", "ter:InvalidArgVal", "ter:NoProfile")
        return tag(f"{service}:{action}Response", act(asked, now))

    def _time(self, asked: Element, now: float) -> str:
        utc = datetime.fromtimestamp(now, UTC)
        time, date = (
            "".join(tag(f"tt:{part}", str(getattr(utc, part.lower()))) for part in parts)
            for parts in (("Hour", "Minute", "Second"), ("Year", "Month", "Day"))
        )
        inner = tag("tt:DateTimeType", "NTP") + tag("tt:DaylightSavings", "false")
        inner += tag("tt:UTCDateTime", tag("tt:Time", time) + tag("tt:Date", date))
        return tag("tds:SystemDateAndTime", inner)

    def _services(self, asked: Element, now: float) -> str:
        version = tag("tds:Version", tag("tt:Major", "2") + tag("tt:Minor", "60"))
        told = ((tag("tds:Namespace", NAMES[name]), tag("tds:XAddr", self._at(path))) for name, path in PATHS.items())
        return "".join(tag("tds:Service", space + address + version) for space, address in told)

    def _capabilities(self, asked: Element, now: float) -> str:
        kinds = {"Device": "tds", "Media": "trt", "PTZ": "tptz"}
        inner = "".join(tag(f"tt:{kind}", tag("tt:XAddr", self._at(PATHS[name]))) for kind, name in kinds.items())
        return tag("tds:Capabilities", inner)

    def _information(self, asked: Element, now: float) -> str:
        profile = self._device.profile
        facts = {
            "Manufacturer": "Amcrest",
            "Model": profile.model,
            "FirmwareVersion": f"{profile.firmware}, Build Date {profile.built}",
            "SerialNumber": self._device.camera.serial,
            "HardwareId": "1.00",
        }
        return "".join(tag(f"tds:{key}", escape(value)) for key, value in facts.items())

    def _reboot(self, asked: Element, now: float) -> str:
        self._device.reboot(now)
        return tag("tds:Message", "Rebooting")

    def _profiles(self, asked: Element, now: float) -> str:
        lens = self._device.camera.lens
        bounds = f'<tt:Bounds x="0" y="0" width="{lens.width}" height="{lens.height}"/>'
        used = tag("tt:UseCount", "1")
        source = tag("tt:Name", SOURCE) + used + tag("tt:SourceToken", SOURCE) + bounds
        turning = tag("tt:DefaultContinuousPanTiltVelocitySpace", f"{SPACES}/PanTiltSpaces/VelocityGenericSpace")
        turning += tag("tt:DefaultPTZTimeout", "PT10S")
        motors = tag("tt:Name", CONFIGURATION) + used + tag("tt:NodeToken", NODE) + turning
        inner = tag("tt:Name", PROFILE) + tag("tt:VideoSourceConfiguration", source, token=SOURCE)
        inner += tag("tt:PTZConfiguration", motors, token=CONFIGURATION)
        return tag("trt:Profiles", inner, token=PROFILE, fixed="true")

    def _stream_uri(self, asked: Element, now: float) -> str:
        host = self._host.rpartition(":")[0] or self._host
        port = self.rtsp_port
        if port is None:
            raise Fault("No stream", "env:Receiver", "ter:Action", "ter:IncompleteConfiguration")
        inner = tag(
            "tt:Uri", escape(f"rtsp://{host}:{port}/cam/realmonitor?channel=1&subtype=0&unicast=true&proto=Onvif")
        )
        return tag("trt:MediaUri", inner + self._validity())

    @staticmethod
    def _validity() -> str:
        never = tag("tt:InvalidAfterConnect", "false") + tag("tt:InvalidAfterReboot", "false")
        return never + tag("tt:Timeout", "PT0S")

    def _snapshot_uri(self, asked: Element, now: float) -> str:
        return tag("trt:MediaUri", tag("tt:Uri", self._at("/cgi-bin/snapshot.cgi?channel=1")) + self._validity())

    def _at(self, path: str) -> str:
        return escape(f"http://{self._host}{path}")
