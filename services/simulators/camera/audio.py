"""`audio.cgi` on the wire: sound from the microphone at the pace of time, and sound for the speaker as it comes."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import suppress
from io import BufferedIOBase
from typing import TYPE_CHECKING

from services.simulators.camera.messages import OK, Answer, Request
from services.simulators.camera.sound import CODEC, RATE

if TYPE_CHECKING:
    from services.simulators.camera.http import CameraServer

BOUNDARY = "myboundary"
PIECE_S = 0.1
CHUNK_BYTES = 1024
ERROR = Answer(b"ERROR\r\n")


def microphone(camera: CameraServer, request: Request) -> Generator[bytes]:
    """An endless answer: bare bytes (`singlepart`) or parts of a multipart."""
    parts = request.text("httptype") == "multipart"
    kind = f"multipart/x-mixed-replace; boundary={BOUNDARY}" if parts else f"Audio/{CODEC}"
    yield f"HTTP/1.1 200 OK\r\nConnection: close\r\nContent-Type: {kind}\r\n\r\n".encode()
    heard = round(camera.clock() * RATE)
    while not camera.closing.wait(PIECE_S):
        count = min(max(round(camera.clock() * RATE) - heard, 0), RATE)
        if not camera.running.is_set() or not count:
            continue
        data, heard = camera.device.microphone.hears(heard, count), heard + count
        head = f"--{BOUNDARY}\r\nContent-Type: Audio/{CODEC}\r\nContent-Length: {len(data)}\r\n\r\n".encode()
        yield head + data + b"\r\n" if parts else data


def speaker(camera: CameraServer, body: BufferedIOBase, length: int, content_type: str) -> Answer:
    """Takes sound until the sender has sent all it announced or leaves; a body in chunks is not accepted."""
    if length <= 0:
        return ERROR
    played = camera.device.speaker.begin(content_type)
    with suppress(OSError):
        while length > 0 and not camera.closing.is_set():
            data = body.read1(min(length, CHUNK_BYTES))
            if not data:
                break
            played.hear(data, camera.clock())
            length -= len(data)
    return OK
