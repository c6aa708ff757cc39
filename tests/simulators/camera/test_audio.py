"""Sound from the simulated microphone and to the speaker, over real connections."""

from __future__ import annotations

import io
import socket
import time
import wave
from collections.abc import Iterator

import httpx
import numpy as np
import pytest

from services.peers import wait_until
from services.simulators.camera.program import Simulated
from services.simulators.camera.sound import RATE, decode, encode

LISTEN = "/cgi-bin/audio.cgi?action=getAudio&httptype={}&channel={}"
SPEAK = "/cgi-bin/audio.cgi?action=postAudio&httptype=singlepart&channel={}"
PIECE = 800  # bytes: a tenth of a second


@pytest.fixture
def client(camera: Simulated) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=camera.url, auth=httpx.DigestAuth("ros", "secret123"), timeout=10) as opened:
        yield opened


@pytest.fixture
def door(camera: Simulated) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=camera.side_door_url, timeout=10) as opened:
        yield opened


def _heard(stream: httpx.Response, count: int) -> bytes:
    data = b""
    for chunk in stream.iter_raw():
        data += chunk
        if len(data) >= count:
            return data
    raise AssertionError("the sound ended")


def _loudest(data: bytes) -> float:
    """Hertz of the strongest tone."""
    samples = decode(data)
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(len(samples))))
    return float(np.fft.rfftfreq(len(samples), 1 / RATE)[np.argmax(spectrum)])


@pytest.mark.parametrize(
    ("value", "code"),
    [(0, 0xD5), (-1, 0x55), (8, 0xD5), (1000, 0xFA), (-1000, 0x7A), (12345, 0xBD), (-12345, 0x3D), (32767, 0xAA),
     (-32768, 0x2A)],
)  # fmt: skip
def test_alaw_is_that_of_the_standard(value: int, code: int) -> None:
    assert encode(np.array([value], np.int16)) == bytes([code])


def test_alaw_comes_back_as_near_as_it_can() -> None:
    samples = np.arange(-32768, 32768, 7).astype(np.int16)
    error = np.abs(decode(encode(samples)).astype(int) - samples)
    assert (error <= np.maximum(np.abs(samples.astype(int)) / 32 + 1, 16)).all()


@pytest.mark.parametrize("hertz", [440.0, 1000.0])
def test_the_microphone_hears_the_tone(client: httpx.Client, door: httpx.Client, hertz: float) -> None:
    door.post("/tone", json={"hertz": hertz})
    with client.stream("GET", LISTEN.format("singlepart", 1)) as stream:
        assert stream.headers["content-type"] == "Audio/G.711A"
        assert "content-length" not in stream.headers
        began = time.monotonic()
        data = _heard(stream, RATE)
        took = time.monotonic() - began
    assert _loudest(data) == pytest.approx(hertz, abs=2)
    assert took > 0.8  # a second of sound comes in a second


def test_the_microphone_as_a_multipart(client: httpx.Client) -> None:
    with client.stream("GET", LISTEN.format("multipart", 1)) as stream:
        assert stream.headers["content-type"] == "multipart/x-mixed-replace; boundary=myboundary"
        head, _, rest = _heard(stream, 2000).partition(b"\r\n\r\n")
    assert head.startswith(b"--myboundary\r\nContent-Type: Audio/G.711A\r\nContent-Length: ")
    length = int(head.rpartition(b" ")[2])
    assert rest[length:].startswith(b"\r\n--myboundary")


@pytest.mark.parametrize("method", ["GET", "POST"])
def test_channel_0_is_refused_for_ever_as_if_the_nonce_were_old(camera: Simulated, method: str) -> None:
    target = (LISTEN.format("singlepart", 0) if method == "GET" else SPEAK.format(0)).encode()
    with httpx.Client(auth=httpx.DigestAuth("ros", "secret123"), timeout=30) as client:
        answers = [client.request(method, camera.url + target.decode()) for _ in range(2)]
    assert [answer.status_code for answer in answers] == [401, 401]
    assert 'stale="true"' in answers[0].headers["www-authenticate"]


def _authorization(camera: Simulated, target: str) -> str:
    """The header of a POST that is sent without being asked for it, after a small request."""
    auth = httpx.DigestAuth("ros", "secret123")
    with httpx.Client(base_url=camera.url, timeout=30) as client:
        client.get("/cgi-bin/devAudioOutput.cgi?action=getCollect", auth=auth)
        flow = auth.auth_flow(httpx.Request("POST", camera.url + target))
        return next(flow).headers["Authorization"]


def test_what_is_played_arrives_as_it_was_sent(camera: Simulated, door: httpx.Client) -> None:
    sound = encode((9000 * np.sin(2 * np.pi * 600 / RATE * np.arange(4 * PIECE))).astype(np.int16))
    target = SPEAK.format(1)
    head = f"POST {target} HTTP/1.1\r\nHost: camera\r\nAuthorization: {_authorization(camera, target)}\r\n"
    head += "Content-Type: Audio/G.711A\r\nContent-Length: 9999999\r\n\r\n"
    with socket.create_connection(("127.0.0.1", camera.port), timeout=10) as connection:
        connection.sendall(head.encode())
        for start in range(0, len(sound), PIECE):
            connection.sendall(sound[start : start + PIECE])
            wait_until(lambda start=start: _arrived(door) >= start + PIECE, "the sound to arrive", 5)
    told = door.get("/played").json()[-1]
    assert (told["content_type"], told["bytes"], told["seconds"]) == ("Audio/G.711A", 4 * PIECE, 0.4)
    assert told["took_s"] > 0
    with wave.open(io.BytesIO(door.get("/played.wav").content)) as file:
        assert (file.getframerate(), file.getnchannels(), file.getnframes()) == (RATE, 1, 4 * PIECE)
        assert encode(np.frombuffer(file.readframes(4 * PIECE), np.int16)) == sound


def _arrived(door: httpx.Client) -> int:
    played = door.get("/played").json()
    return int(played[-1]["bytes"]) if played else 0


def test_a_body_in_chunks_is_not_accepted(camera: Simulated, door: httpx.Client) -> None:
    target = SPEAK.format(1)
    head = f"POST {target} HTTP/1.1\r\nHost: camera\r\nAuthorization: {_authorization(camera, target)}\r\n"
    head += "Content-Type: Audio/G.711A\r\nTransfer-Encoding: chunked\r\n\r\n"
    with socket.create_connection(("127.0.0.1", camera.port), timeout=10) as connection:
        connection.sendall(head.encode())
        assert b"ERROR" in b"".join(iter(lambda: connection.recv(4096), b""))
    assert door.get("/played").json() == []
