"""The reader against a real RTSP server: times, faults, restarts, passwords, and what is left behind (nothing)."""

from __future__ import annotations

import logging
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from services.camera.device import Away, BadLogin, DeviceError, Refused
from services.camera.video.newest import Frame, Newest, Upright
from services.camera.video.reader import Reader
from services.camera.video.rtsp import Rtsp, with_password
from services.camera.video.session import Session
from services.peers import free_port, wait_until
from tests.camera.video.parts import PASSWORD, RtspCamera, address, rtsp_camera, time_in


@pytest.fixture
def camera() -> Iterator[RtspCamera]:
    with rtsp_camera() as running:
        yield running


def opener(camera: RtspCamera, password: str = PASSWORD) -> Session:
    return Rtsp(camera.url, address(password=password))


@contextmanager
def reading(camera: RtspCamera, password: str = PASSWORD) -> Iterator[Reader]:
    """A reader that is switched on."""
    before = threading.active_count()
    reader = Reader("ip1", Newest(Upright()), (0.0, 0.05))
    reader.switch((lambda: opener(camera, password),))
    try:
        yield reader
    finally:
        reader.close()
        wait_until(lambda: threading.active_count() == before, "the thread's end", 10)


def frame_after(reader: Reader, number: int) -> Frame:
    frame = reader.newest.wait(number, 10)
    assert frame is not None
    return frame


@pytest.mark.rtsp
def test_the_newest_picture_is_there_with_the_time_at_which_it_was_exposed(camera: RtspCamera) -> None:
    with reading(camera) as reader, reader.newest.watched():
        wait_until(lambda: reader.newest.frames > 45, "three seconds of pictures")
        for late in (0.0, 0.5):
            camera.tell(f"late {late}")
            wait_until(lambda late=late: reader.flow.latency >= late / 2, "the delay to be seen")
            frame = frame_after(reader, reader.newest.frames)
            true = time_in(frame.develop(), time.time())
            assert abs(frame.exposure.at - true) < 0.1
            assert frame.exposure.uncertainty == 0.05
        assert frame.arrived - true > 0.3
        wait_until(lambda: 10 < reader.flow.rates(time.time())[0] < 20, "the camera's own rate")


@pytest.mark.rtsp
def test_nothing_is_decoded_while_nobody_looks_and_the_first_look_needs_no_keyframe(camera: RtspCamera) -> None:
    with reading(camera) as reader:
        wait_until(lambda: len(reader.flow.recent) > 40, "packets")
        assert reader.newest.frames == 0
        with reader.newest.watched():
            before = len(reader.flow.recent)
            frame_after(reader, 0)
            assert len(reader.flow.recent) - before <= 4  # keyframes are thirty packets apart
        seen = reader.newest.frames
        packets = len(reader.flow.recent)
        wait_until(lambda: len(reader.flow.recent) > packets + 10, "more packets")
        assert reader.newest.frames <= seen + 1
        assert reader.flow.broken == 0


@pytest.mark.rtsp
def test_a_stream_that_stands_still_is_noticed_and_opened_again(camera: RtspCamera) -> None:
    with reading(camera) as reader:
        wait_until(lambda: reader.flow.name == "rtsp", "the stream")
        camera.tell("freeze")
        began = time.monotonic()
        wait_until(lambda: reader.flow.trouble != "", "the standstill to be noticed")
        assert time.monotonic() - began < 10
        wait_until(
            lambda: "no picture within" in reader.flow.trouble, "the reason", 20
        )  # on a busy machine it may break
        camera.tell("go")
        wait_until(lambda: reader.flow.name == "rtsp", "the stream again", 60)
        assert reader.flow.trouble == ""


@pytest.mark.rtsp
def test_a_camera_that_restarts_is_found_again() -> None:
    port = free_port()
    with rtsp_camera(port) as camera, reading(camera) as reader:
        wait_until(lambda: reader.flow.name == "rtsp", "the stream")
        camera.kill()
        wait_until(lambda: reader.flow.failures >= 2, "attempts in vain")
        with rtsp_camera(port):
            wait_until(lambda: reader.flow.name == "rtsp", "the stream again", 60)
            with reader.newest.watched():
                frame_after(reader, 0)


@pytest.mark.rtsp
def test_a_wrong_password_is_tried_once_and_told(camera: RtspCamera) -> None:
    with reading(camera, password="another") as reader:
        wait_until(lambda: reader.flow.trouble != "", "the refusal")
        with pytest.raises(TimeoutError):
            wait_until(lambda: reader.flow.failures > 1, "another attempt", 4)
        assert "user and password" in reader.flow.trouble


@pytest.mark.rtsp
def test_off_ends_the_connection_and_on_begins_another(camera: RtspCamera) -> None:
    with reading(camera) as reader:
        wait_until(lambda: reader.flow.name == "rtsp", "the stream")
        reader.switch(())
        wait_until(lambda: reader.flow.name == "", "the end")
        reader.switch((lambda: opener(camera),))
        wait_until(lambda: reader.flow.connections == 2, "another connection")
        wait_until(lambda: reader.flow.name == "rtsp", "the stream")


@pytest.mark.rtsp
def test_no_password_appears_in_logs_and_errors(
    camera: RtspCamera, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    caplog.set_level(logging.DEBUG)
    errors: list[DeviceError] = []
    for password in (PASSWORD, "an%other"):
        with reading(camera, password) as reader:
            wait_until(lambda reader=reader: bool(reader.flow.name or reader.flow.trouble), "an outcome")
            camera.tell("freeze")
            wait_until(lambda reader=reader: reader.flow.failures > 0, "the fault")
            camera.tell("go")
        for url in (camera.url, "rtsp://127.0.0.1:1/x", camera.url.replace("cam", "no")):
            try:
                Rtsp(url, address(password=password)).close()
            except DeviceError as error:
                errors.append(error)
    assert {type(error) for error in errors} >= {BadLogin, Away}
    told = capfd.readouterr()
    everything = caplog.text + told.out + told.err + "".join(map(repr, errors))
    everything += "".join(repr(error.__cause__) for error in errors)
    for secret in (PASSWORD, "p%40ss", "w%3Ard", "an%other", "an%25other"):
        assert secret not in everything
    assert "no moving picture" in caplog.text


def test_user_and_password_are_percent_encoded_in_the_address_for_ffmpeg() -> None:
    url = with_password("rtsp://192.0.2.9:554/cam/realmonitor?channel=1&subtype=0", address())
    assert url == "rtsp://ros:p%40ss%2Fw%3Ard%231%2B@192.0.2.9:554/cam/realmonitor?channel=1&subtype=0"


def described(line: str, title: str = "s=Kueche") -> str:
    return f"v=0\r\no=- 0 0 IN IP4 0.0.0.0\r\n{title}\r\nt=0 0\r\nm=video 0 RTP/AVP {line}\r\na=control:one\r\n"


@contextmanager
def describing(description: bytes) -> Iterator[str]:
    """A camera that describes its stream so, and ends before the first picture; its address."""
    lines = {
        "DESCRIBE": f"Content-Type: application/sdp\r\nContent-Length: {len(description)}\r\n",
        "SETUP": "Session: 7\r\nTransport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n",
        "PLAY": "Session: 7\r\n",
    }

    def answer() -> None:
        connection, _ = server.accept()
        with connection, connection.makefile("rwb") as stream:
            for verb in ("OPTIONS", *lines):
                asked = [line.rstrip() for line in iter(stream.readline, b"\r\n")]
                number = next(line for line in asked if line.startswith(b"CSeq")).decode()
                stream.write(f"RTSP/1.0 200 OK\r\n{number}\r\n{lines.get(verb, '')}\r\n".encode())
                stream.write(description if verb == "DESCRIBE" else b"")
                stream.flush()

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=answer)
        thread.start()
        yield f"rtsp://127.0.0.1:{server.getsockname()[1]}/x"
        thread.join()


def test_a_stream_may_have_a_title_in_any_encoding() -> None:
    with describing(described("26", title="s=Küche").encode("latin-1")) as url:
        session = Rtsp(url, address())
        assert session.codec == "mjpeg"
        session.close()


def test_a_picture_that_nobody_can_decode_is_none() -> None:
    description = described("96\r\na=rtpmap:96 TOMORROW/90000").encode()
    with describing(description) as url, pytest.raises(Refused, match="decoded"):
        Rtsp(url, address())
