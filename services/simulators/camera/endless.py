"""The answers that do not end: MJPEG, events and, in `audio`, the microphone. Bytes as they go out; `http` writes."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import TYPE_CHECKING

from services.simulators.camera import audio, events
from services.simulators.camera.messages import Request
from services.simulators.camera.view.picture import Stream

if TYPE_CHECKING:
    from services.simulators.camera.http import CameraServer

Endless = Callable[["CameraServer", Request], Generator[bytes]]
FULL = b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"
HEARTBEATS_S = (1.0, 60.0)


def video(camera: CameraServer, request: Request) -> Generator[bytes]:
    """Pictures as JPEG, until the encoders are set up anew."""
    stream: Stream = "ExtraFormat" if request.text("subtype", "0") != "0" else "MainFormat"
    kind = f"multipart/x-mixed-replace; boundary={events.BOUNDARY}"
    yield f"HTTP/1.1 200 OK\r\nConnection: close\r\nContent-Type: {kind}\r\n\r\n".encode()
    encoders = camera.device.tables.encoders
    while not camera.closing.wait(1 / camera.pictures.fps(stream)) and camera.device.tables.encoders == encoders:
        if camera.shows_pictures:
            data = camera.faults.picture(camera.pictures.jpeg(stream, camera.clock()))
            head = f"--{events.BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
            yield head.encode() + data + b"\r\n"


def attach(camera: CameraServer, request: Request) -> Generator[bytes]:
    """Events as they happen, and heartbeats between them."""
    least, most = HEARTBEATS_S
    beat = request.text("heartbeat")
    every = min(max(float(beat), least), most) if beat.isdigit() else most
    profile = camera.device.profile
    subscription = camera.device.events.subscribe(events.wanted(request.text("codes")))
    if subscription is None:
        yield FULL
        return
    try:
        yield events.head(profile)
        while not camera.closing.is_set():
            text = subscription.next(every)
            camera.running.wait()
            if text == "":
                return
            if (text or (beat and profile.heartbeat)) and not camera.faults.silent_events:
                yield events.part(profile, text or "Heartbeat")
    finally:
        camera.device.events.leave(subscription)


ENDLESS: dict[tuple[str, str], Endless] = {("mjpg/video", ""): video, ("eventManager", "attach"): attach}
ENDLESS["audio", "getAudio"] = audio.microphone
