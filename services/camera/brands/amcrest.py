"""Amcrest cameras: the client that sends what `dahua/` builds and reads; DeviceError when the camera will not."""

from __future__ import annotations

import httpx

from services.camera.address import Address
from services.camera.alarm.listener import Ear
from services.camera.brands.dahua import errands, picture, ptz, replies, streams, system
from services.camera.device import (
    Away,
    Camera,
    ClearPreset,
    Direction,
    Errand,
    FindStream,
    GetPicture,
    GotoPreset,
    Identify,
    Identity,
    MoveOver,
    MoveTo,
    Picture,
    Reboot,
    Refused,
    Request,
    SavePreset,
    SetPicture,
    Snapshot,
    Start,
    Status,
    Stop,
    TurnFor,
)
from services.camera.errands import GetPresets
from services.camera.sound.desk import Sound
from services.camera.web.connection import COMMAND, SNAPSHOT, connection, fetch, knock, respelt
from services.camera.web.dahua import DahuaEar, DahuaSound
from services.camera.web.digest import Login
from services.camera.web.gate import Gate
from services.errors import DeviceError


class Amcrest:
    """A Camera; `channel` None: found out by asking for the status with 1, then 0."""

    def __init__(
        self,
        address: Address,
        transport: httpx.BaseTransport | None = None,
        gate: Gate | None = None,
        *,
        urgent: bool = False,
    ) -> None:
        self.address = address
        self.login = Login(address.user, address.password, gate or Gate(), urgent=urgent)
        self.http = connection(address, self.login, transport)
        self.channel = address.channel
        self.running: str | None = None  # the code of the motion that may be under way
        self._stops = 0  # in a row that had no answer
        self._encodes = False  # brackets; most firmware reads them as they are
        self._in_day_night: bool | None = None  # the firmware keeps the mode in VideoInDayNight; None: not known yet

    def close(self) -> None:
        """Ends the connection."""
        self.http.close()

    def send(self, request: Request) -> object:
        """One request of ours, mostly one of the camera's; DeviceError as in `device.py`."""
        match request:
            case Start():
                return self._start(request)
            case TurnFor() | MoveTo() | MoveOver():
                return self._drive(request)
            case Stop():
                return self._stop(request)
            case Status():
                return ptz.read_status(self._status())
            case GotoPreset(number) | SavePreset(number) | ClearPreset(number):
                code = {GotoPreset: "GotoPreset", SavePreset: "SetPreset", ClearPreset: "ClearPreset"}[type(request)]
                self.running = code if isinstance(request, GotoPreset) else self.running
                return self._command(ptz.preset(code, number, self._known_channel()))
            case GetPresets():
                return ptz.read_presets(self._get(ptz.presets(self._known_channel())).text)
            case Snapshot():
                return self._snapshot()
            case GetPicture():
                return self._picture()
            case SetPicture():
                return self._set_picture(request)
            case FindStream(source):
                return streams.address(self.address, source)
            case Identify():
                return self._identify()
            case Reboot():
                return self._command(system.magic("reboot"))
            case Errand():
                return self._talk(errands.dialogue(request))

    def _get(self, target: str, timeout: httpx.Timeout = COMMAND) -> httpx.Response:
        """A refusal may be for how the brackets are spelt: the other way is tried, and kept where that is taken."""
        spelt = respelt(target) if self._encodes else target
        try:
            return replies.check(fetch(self.http, spelt, timeout))
        except Refused as refused:
            if "[" not in target:
                raise
            try:
                answer = replies.check(fetch(self.http, respelt(spelt), timeout))
            except Refused:
                raise refused from None
            self._encodes = not self._encodes
            return answer

    def _command(self, target: str, timeout: httpx.Timeout = COMMAND) -> object:
        body = self._get(target, timeout).text
        if not replies.is_ok(body):
            raise Refused(f"expected OK from the camera, got {' '.join(body.split())[:80]!r}")
        return None

    def _start(self, request: Start) -> object:
        channel = self._known_channel()
        self.running = ptz.code_of(request.direction)
        return self._command(ptz.start(request, channel))

    def _drive(self, request: TurnFor | MoveTo | MoveOver) -> object:
        channel = self._known_channel()
        if isinstance(request, TurnFor):
            self.running = "Continuously"
            return self._command(ptz.turn_for(request, channel))
        if isinstance(request, MoveTo):
            self.running = request.form
            return self._command(ptz.move_to(request, channel))
        self.running = request.form
        return self._command(ptz.move_over(request, channel))

    def _stop(self, request: Stop) -> object:
        channel = self._known_channel()
        if self.running in ptz.UNSTOPPABLE:  # a start takes its place, and that can be stopped
            self._start(Start(Direction.LEFT))
        refused: list[Refused] = []
        self._stops += 1
        known = ptz.code_of(request.direction) if request.direction else self.running
        codes = [known] if known is not None and not request.every else [*map(ptz.code_of, Direction)]
        for code in codes:
            try:
                self._command(ptz.stop(code, channel), knock(self._stops))
            except Refused as error:  # firmware that refuses to stop what does not run
                refused.append(error)
        self._stops = 0
        if len(refused) == len(codes):
            raise refused[0]
        return None

    def _known_channel(self) -> int:
        if self.channel is None:
            self._status()
        return self.channel or 0

    def _status(self) -> str:
        if self.channel is not None:
            return self._get(ptz.status(self.channel)).text
        fault: DeviceError = Refused("the camera tells its position on neither channel 1 nor 0")
        for channel in (1, 0):
            try:
                body = self._get(ptz.status(channel)).text
            except Refused:
                continue
            try:
                ptz.read_status(body)
            except Away as no_position:  # not lost: it has answered
                fault = no_position
                continue
            self.channel = channel
            return body
        raise fault

    def _snapshot(self) -> bytes:
        body = self._get("/cgi-bin/snapshot.cgi", SNAPSHOT).content
        if not body.startswith(b"\xff\xd8"):
            raise Away(f"expected a JPEG, got {body[:40]!r}")
        return body

    def _picture(self) -> Picture:
        options = self._get(picture.PICTURE_TABLE).text
        if "DayNightColor" in options:
            self._in_day_night = False
            return picture.read_picture(options)
        try:
            modes = self._get(picture.MODE_TABLE).text
        except Refused:
            return picture.read_picture(options)
        self._in_day_night = "VideoInDayNight" in modes
        return picture.read_picture(options, modes)

    def _set_picture(self, request: SetPicture) -> Picture:
        wanted = any(picture.modes(request))
        if wanted and self._in_day_night is None:
            self._picture()
        newer = wanted and bool(self._in_day_night)
        if request.flip is not None or request.mirror is not None or not newer:
            self._command(picture.set_picture(request))
        if newer:
            self._command(picture.set_modes(request))
        return self._picture()

    def _talk(self, dialogue: errands.Dialogue) -> object:
        try:
            target = next(dialogue)
            while True:
                try:
                    body = self._get(target).text
                except Refused as error:
                    target = dialogue.throw(error)
                else:
                    target = dialogue.send(body)
        except StopIteration as stop:
            return stop.value

    def _identify(self) -> Identity:
        model = replies.read_table(self._get(system.magic("getDeviceType")).text).get("type", "")
        serial = replies.read_table(self._get(system.magic("getSerialNo")).text).get("sn", "")
        version = system.read_version(self._get(system.magic("getSoftwareVersion")).text)
        return Identity(model, serial, version, self.login.recall())


def ear(address: Address, gate: Gate, codes: tuple[str, ...], heartbeat_s: int) -> Ear:
    """The camera's own alarms; it gives a sign of life every `heartbeat_s`."""
    return DahuaEar(address, gate, codes, heartbeat_s)


def sound(address: Address, gate: Gate) -> Sound:
    """The camera's microphone and loudspeaker."""
    return DahuaSound(address, gate)


def connect(address: Address, gate: Gate, *, urgent: bool = False) -> Camera:
    """A client for the camera there; nothing is sent yet. `urgent`: it is the one that moves the motors."""
    return Amcrest(address, gate=gate, urgent=urgent)
