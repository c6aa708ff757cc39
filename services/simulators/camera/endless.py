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
HEARTBEAT_MOST_S = 60
GATHERED_S = 0.2  # so long some firmware waits for more to write at once
PIECE, BETWEEN_S = 48, 0.02  # other firmware's pieces: bytes, and the pause that keeps the network from joining them


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
    profile, beat = camera.device.profile, request.text("heartbeat")
    every = min(max(int(beat), profile.heartbeat_least_s), HEARTBEAT_MOST_S) if beat.isdigit() else HEARTBEAT_MOST_S
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
                yield from _written(camera, subscription, events.part(profile, text or "Heartbeat"))
    finally:
        camera.device.events.leave(subscription)


def _written(camera: CameraServer, subscription: events.Subscription, data: bytes) -> Generator[bytes]:
    """A part as it goes out: whole, in pieces, or together with what follows soon."""
    profile = camera.device.profile
    if profile.event_writes == "gathered":
        while text := subscription.next(GATHERED_S):
            data += events.part(profile, text)
        if text == "":
            subscription.wake()
    size = PIECE if profile.event_writes == "pieces" else len(data)
    for start in range(0, len(data), size):
        yield data[start : start + size]
        if size < len(data):
            camera.closing.wait(BETWEEN_S)


ENDLESS: dict[tuple[str, str], Endless] = {("mjpg/video", ""): video, ("eventManager", "attach"): attach}
ENDLESS["audio", "getAudio"] = audio.microphone
