"""The tests' way in, on a port of its own: JSON to see and to change what no real camera would tell.

GET  /state                              true pose, reading, motion, the door's counters, frames rendered and their rate
GET  /motors                             what they can (position, speeds, accelerations) and what they did (counters)
GET  /played                             what was sent to the speaker: kind, bytes, seconds of sound, how long it took
GET  /played.wav                         the last of it as a WAV file
GET  /log                                requests: time, method, target, status, authorized
POST /pose     {"pan", "tilt", "zoom"}   any may be left out; the motors stand there at once
POST /event    {"code", "action", "index", "data"}
POST /stir     {"seconds"}               something moves before the lens for so long
POST /board    {"name", ...}             somebody holds a board of squares so (`board.py`); a name alone: puts it away
POST /light    {"lux"}                   how bright the rooms are from now on
POST /tone     {"hertz"}                 what the microphone hears
POST /clock    {"offset_s", "drift_ppm"} the camera's clock is wrong by so much, and gains so many us/s
POST /card     {"in"}                    whether a memory card is in it
POST /fail     {"n", "how"}              the next n requests: close, 401, 500 or text
POST /fault    {"name", "on", ...}       switches a fault on or off; `troubles` lists them and what they take
POST /well     {}                        switches every fault off
POST /drop     {}                        cuts every connection
POST /freeze   {"on"}                    accepts, and answers nobody
POST /latency  {"seconds"}               of every control request from now on
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from http.server import BaseHTTPRequestHandler
from math import inf
from typing import Any

from services.simulators.board import HeldBoard
from services.simulators.camera import troubles
from services.simulators.camera.http import CameraServer
from services.simulators.camera.motors import Axes, reading
from services.simulators.camera.port import Port
from services.simulators.camera.sound import wav

Order = Callable[[CameraServer, dict[str, Any]], object]


def state(camera: CameraServer) -> dict[str, Any]:
    """What is true now."""
    now = camera.clock()
    pose, rates = camera.device.motion(now)
    return {
        "pose": pose._asdict(),
        "reading": reading(pose)._asdict(),
        "moving": any(rates),
        "booting": camera.device.booting(now),
        "presets": {number: name for number, (name, _) in camera.device.ptz.presets.items()},
        "door": camera.door.counters,
        "listeners": camera.device.events.listeners,
        "lux": camera.pictures.lux,
        **camera.pictures.rates(),
    }


def motors(camera: CameraServer) -> dict[str, Any]:
    """The constants of each axis (pan as travel: reading = (180 - travel) mod 360), and what has been done so far."""
    ptz = camera.device.ptz
    worked = ptz.motors.worked(camera.clock())
    axes = {name: asdict(rail) for name, rail in zip(Axes._fields, ptz.motors.rails, strict=True)}
    done = {"travelled": worked.travelled._asdict(), "pushed_s": worked.pushed_s._asdict()}
    return {"axes": axes, **done, "motions": worked.motions, "commands": ptz.commands}


def _pose(camera: CameraServer, order: dict[str, Any]) -> None:
    now = camera.clock()
    pose, _ = camera.device.motion(now)
    camera.device.place(pose._replace(**{key: float(value) for key, value in order.items()}), now)


def _event(camera: CameraServer, order: dict[str, Any]) -> None:
    camera.device.events.tell(str(order["code"]), str(order["action"]), int(order.get("index", 0)), order.get("data"))


def _stir(camera: CameraServer, order: dict[str, Any]) -> None:
    camera.device.detector.stir(camera.clock() + float(order["seconds"]))


def _board(camera: CameraServer, order: dict[str, Any]) -> None:
    name = str(order.pop("name", "board"))
    camera.pictures.hold(name, HeldBoard.model_validate(order) if order else None)


def _light(camera: CameraServer, order: dict[str, Any]) -> None:
    lux = float(order["lux"])
    if not 0.0 <= lux < inf:
        raise ValueError(f"expected 0 or more, got {lux}")
    camera.pictures.shine(lux, camera.clock())


def _tone(camera: CameraServer, order: dict[str, Any]) -> None:
    camera.device.microphone.hertz = float(order["hertz"])


def _clock(camera: CameraServer, order: dict[str, Any]) -> None:
    camera.device.clock.set_off(camera.clock(), float(order.get("offset_s", 0)), float(order.get("drift_ppm", 0)))


def _card(camera: CameraServer, order: dict[str, Any]) -> None:
    camera.device.identity.card = bool(order["in"])


def _fail(camera: CameraServer, order: dict[str, Any]) -> None:
    camera.faults.left, camera.faults.how = int(order["n"]), str(order.get("how", "close"))


def _freeze(camera: CameraServer, order: dict[str, Any]) -> None:
    (camera.running.clear if order["on"] else camera.running.set)()


def _latency(camera: CameraServer, order: dict[str, Any]) -> None:
    camera.device.latency.seconds = float(order["seconds"])


def _last_played(camera: CameraServer) -> bytes:
    played = camera.device.speaker.played
    return wav(bytes(played[-1].data) if played else b"")


VIEWS: dict[str, Callable[[CameraServer], object]] = {"/state": state, "/motors": motors}
VIEWS["/played"] = lambda camera: [one.told for one in camera.device.speaker.played]
VIEWS["/played.wav"] = _last_played
VIEWS["/log"] = lambda camera: list(camera.log)
ORDERS: dict[str, Order] = {
    "/pose": _pose,
    "/event": _event,
    "/stir": _stir,
    "/board": _board,
    "/light": _light,
    "/tone": _tone,
    "/clock": _clock,
    "/card": _card,
    "/fail": _fail,
    "/fault": troubles.switch,
    "/well": lambda camera, order: troubles.clear(camera),
    "/drop": lambda camera, order: camera.drop(),
    "/freeze": _freeze,
    "/latency": _latency,
}


class SideDoor(Port):
    """Serves one camera's side door."""

    def __init__(self, address: tuple[str, int], camera: CameraServer) -> None:
        super().__init__(address, Visit)
        self.camera = camera


class Visit(BaseHTTPRequestHandler):
    """One connection, one request."""

    server: SideDoor

    def do_GET(self) -> None:
        """A view."""
        if self.path not in VIEWS:
            return self._send(404, {"error": f"expected one of {', '.join(VIEWS)}"})
        return self._send(200, VIEWS[self.path](self.server.camera))

    def do_POST(self) -> None:
        """An order."""
        try:
            order = json.loads(self.rfile.read(int(self.headers.get("Content-Length", 0))) or b"{}")
            ORDERS[self.path](self.server.camera, order)
        except (KeyError, TypeError, ValueError) as fault:
            return self._send(400, {"error": repr(fault)})
        return self._send(200, {})

    def _send(self, status: int, value: object) -> None:
        body = value if isinstance(value, bytes) else json.dumps(value).encode()
        self.send_response(status)
        self.send_header("Content-Type", "audio/wav" if isinstance(value, bytes) else "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Silent."""
