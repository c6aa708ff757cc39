"""The orders RTSP and MJPEG, the stream and the snapshots of the real service, against the simulated camera."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from services.bus import Message
from services.camera.video import pictures
from services.peers import free_port, wait_until
from services.simulators import camera as simulated
from tests.camera.bench import PASSWORD, Bench, bench, simulator
from tests.camera.video.parts import RtspCamera, rtsp_camera, time_in

Image = pictures.Image


@pytest.fixture
def camera() -> Iterator[simulated.Simulated]:
    with simulator() as running:
        yield running


@pytest.fixture
def rtsp() -> Iterator[RtspCamera]:
    with rtsp_camera(password=PASSWORD) as running:
        yield running


@pytest.fixture
def here(tmp_path: Path, camera: simulated.Simulated, rtsp: RtspCamera) -> Iterator[Bench]:
    with bench(tmp_path, camera, rtsp_port=rtsp.port) as running:
        yield running
    wait_until(
        lambda: not {one.name for one in threading.enumerate()} & {"camera video", "camera proxy"}, "the end", 10
    )


def stream(here: Bench) -> dict[str, Any]:
    said: dict[str, Any] = here.payloads("stream")[-1]
    return said


def address(here: Bench, key: str) -> str:
    """Where the picture is while that order has switched it on."""
    url: str = stream(here)["url"]
    return url.replace("stream.mjpg", "rtsp.mjpg") if key == "RTSP" else url


def diagnostic(here: Bench) -> dict[str, Any]:
    found = [one for one in here.said if one.topic == "diagnostics/camera/ip1"]
    return dict(httpx.Response(200, content=found[-1].payload).json())


def first_picture(url: str) -> Image:
    """What a viewer sees first."""
    body = b""
    with httpx.stream("GET", url, timeout=20) as answer:
        assert answer.status_code == 200
        for chunk in answer.iter_raw():
            body += chunk
            start, end = body.find(b"\xff\xd8"), body.rfind(b"\r\n--picture\r\n")
            if 0 < start < end:
                return pictures.decode(body[start:end])
    raise AssertionError("the stream has ended")


def turning(here: Bench, look: Any, limit_s: float = 30) -> Any:
    """The result of something that waits for the service, which turns meanwhile."""
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(look)
        here.until(future.done, limit_s)
        return future.result()


@pytest.mark.rtsp
@pytest.mark.parametrize("key", ["RTSP", "MJPEG"])
def test_the_stream_is_switched_on_seen_and_switched_off(here: Bench, key: str) -> None:
    other = {"RTSP": "mjpeg", "MJPEG": "rtsp"}[key]
    assert (stream(here)["rtsp"], stream(here)["mjpeg"]) == (False, False)
    here.order(key, "ON", "1")
    assert here.end_of("1", 20)["state"] == "done"
    here.turn()
    assert stream(here)[key.lower()] is True
    assert stream(here)[other] is False
    url = stream(here)["url"]
    assert url.endswith("/camera/ip1/stream.mjpg")
    assert "ros" not in url
    url, others = address(here, key), address(here, other.upper())
    image = turning(here, lambda: first_picture(url))
    assert abs(time_in(image, time.time()) - time.time()) < 5
    assert httpx.get(others, timeout=30).status_code == 503
    here.until(lambda: float(diagnostic(here)["values"].get("stream_fps", 0)) > 10, 10)
    assert diagnostic(here)["values"]["stream"] == "rtsp"
    assert int(diagnostic(here)["values"]["stream_latency_ms"]) >= 300
    here.order(key, "OFF", "2")
    assert here.end_of("2", 5)["state"] == "done"
    here.turn()
    assert stream(here)[key.lower()] is False
    assert httpx.get(url, timeout=30).status_code == 503
    here.until(lambda: diagnostic(here)["values"]["stream"] == "off", 5)


@pytest.mark.rtsp
def test_one_stream_stays_while_the_other_one_is_switched_off(here: Bench) -> None:
    for number, (key, value) in enumerate([("RTSP", "ON"), ("MJPEG", "ON"), ("RTSP", "OFF")]):
        here.order(key, value, str(number))
        assert here.end_of(str(number), 20)["state"] == "done"
    here.turn()
    assert (stream(here)["rtsp"], stream(here)["mjpeg"]) == (False, True)
    turning(here, lambda: first_picture(address(here, "MJPEG")))
    assert httpx.get(address(here, "RTSP"), timeout=30).status_code == 503
    assert here.service.feed.channel is not None
    assert here.service.feed.channel.reader.flow.connections == 1


@pytest.mark.rtsp
def test_the_stream_is_upright_like_snapshots(here: Bench) -> None:
    here.order("RTSP", "ON", "1")
    for number, key in enumerate(("Flip", "Mirror")):
        here.order(key, "OFF", str(2 + number))
        assert here.end_of(str(2 + number), 20)["state"] == "done"
    image = turning(here, lambda: first_picture(address(here, "RTSP")))
    turned = np.ascontiguousarray(image[::-1, ::-1])
    assert abs(time_in(turned, time.time()) - time.time()) < 5


@pytest.mark.rtsp
def test_a_stream_that_stands_still_is_told_within_10_s_and_comes_back(here: Bench, rtsp: RtspCamera) -> None:
    here.order("RTSP", "ON", "1")
    assert here.end_of("1", 20)["state"] == "done"
    rtsp.tell("freeze")
    here.until(lambda: "stream: no picture" in diagnostic(here)["message"], 10)
    assert diagnostic(here)["level"] == 1
    here.until(lambda: here.payloads("status")[-1]["state"] == "degraded", 2)
    here.order("Zoom", "0", "2")
    assert here.end_of("2", 20)["state"] == "done"  # it can be used all the same
    rtsp.tell("go")
    here.until(lambda: diagnostic(here)["message"] == "online", 60)
    here.until(lambda: here.payloads("status")[-1]["state"] == "online", 2)


@pytest.mark.rtsp
def test_pictures_that_come_later_and_later_bring_the_advice_about_the_bit_rate(here: Bench, rtsp: RtspCamera) -> None:
    here.order("RTSP", "ON", "1")
    assert here.end_of("1", 20)["state"] == "done"
    for tenths in range(5, 30, 5):
        rtsp.tell(f"late {tenths / 10}")
        end = time.monotonic() + 0.8
        here.until(lambda end=end: time.monotonic() > end, 5)
    here.until(lambda: "2048 kb/s" in diagnostic(here)["message"], 10)
    assert int(diagnostic(here)["values"]["stream_latency_ms"]) > 900


def test_without_rtsp_snapshots_are_handed_on(tmp_path: Path, camera: simulated.Simulated) -> None:
    with bench(tmp_path, camera, rtsp_port=free_port(), stream={"snapshot_every_s": 0.2}) as here:
        here.order("MJPEG", "ON", "1")
        assert here.end_of("1", 20)["state"] == "done"
        image = turning(here, lambda: first_picture(stream(here)["url"]))
        assert image.shape == (1296, 2304, 3)
        here.until(lambda: "stream cannot be opened: " in diagnostic(here)["message"], 10)
        assert diagnostic(here)["values"]["stream"] == "snapshots"
        assert diagnostic(here)["level"] == 1


def test_without_rtsp_the_cameras_mjpeg_is_handed_on_where_that_is_allowed(
    tmp_path: Path, camera: simulated.Simulated
) -> None:
    with bench(tmp_path, camera, rtsp_port=free_port(), stream={"camera_mjpeg": True}) as here:
        here.order("RTSP", "ON", "1")
        assert here.end_of("1", 30)["state"] == "done"
        here.until(lambda: diagnostic(here)["values"]["stream"] == "mjpeg", 20)
        url = address(here, "RTSP")
        here.until(lambda: turning(here, lambda: first_picture(url)).shape == (396, 704, 3), 20)
        here.until(lambda: diagnostic(here)["message"] == "online", 5)


def test_broken_snapshots_are_told_until_good_ones_come(tmp_path: Path, camera: simulated.Simulated) -> None:
    with bench(tmp_path, camera) as here:
        here.tell("fault", name="corrupt_jpeg", on=True)
        here.inbox.put(Message("camera/ip1/snapshot/get", b"now", received=time.time()))
        here.until(lambda: "no snapshot: expected a whole JPEG" in diagnostic(here)["message"], 15)
        assert (diagnostic(here)["level"], diagnostic(here)["values"]["failed_snapshots"]) == (1, "1")
        here.tell("fault", name="corrupt_jpeg", on=False)
        here.until(lambda: diagnostic(here)["message"] == "online", 20)  # nobody has to ask again
        assert not [one for one in here.said if one.topic == "camera/ip1/snapshot"]


def test_a_stream_that_gives_no_picture_fails_the_order_and_stays_off(
    tmp_path: Path, camera: simulated.Simulated
) -> None:
    with (
        bench(tmp_path, camera, rtsp_port=free_port()) as here,
        httpx.Client(base_url=camera.side_door_url, timeout=30) as side,
    ):
        side.post("/fail", json={"n": 100000, "how": "text"}).raise_for_status()
        here.order("RTSP", "ON", "1")
        ended = here.end_of("1", 40)
        assert ended["state"] in ("failed", "refused")
        assert ended["error"]
        here.turn()
        assert stream(here)["rtsp"] is False


def test_a_single_picture_is_had_while_the_streams_are_off_and_no_connection_is_kept(
    tmp_path: Path, camera: simulated.Simulated
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(0.1)
        with bench(tmp_path, camera, rtsp_port=listener.getsockname()[1]) as here:
            url = stream(here)["url"].replace("stream.mjpg", "snapshot.jpg")
            answer = turning(here, lambda: httpx.get(url, timeout=30))
            assert answer.status_code == 200
            assert pictures.decode(answer.content).shape == (1296, 2304, 3)
            with pytest.raises(TimeoutError):
                listener.accept()


@pytest.mark.rtsp
def test_a_stream_that_is_configured_on_begins_by_itself(
    tmp_path: Path, camera: simulated.Simulated, rtsp: RtspCamera
) -> None:
    settings = {"rtsp": True, "url": "http://apartment.example:8080/"}
    with bench(tmp_path, camera, rtsp_port=rtsp.port, stream=settings) as here:
        here.until(lambda: diagnostic(here)["values"].get("stream") == "rtsp", 20)
        assert stream(here) == {
            "rtsp": True, "mjpeg": False, "url": "http://apartment.example:8080/camera/ip1/stream.mjpg"
        }  # fmt: skip


@pytest.mark.rtsp
def test_a_password_that_only_the_stream_refuses_is_tried_once_and_told(
    tmp_path: Path, camera: simulated.Simulated
) -> None:
    with rtsp_camera(password="changed") as rtsp, bench(tmp_path, camera, rtsp_port=rtsp.port) as here:
        here.order("RTSP", "ON", "1")
        assert here.end_of("1", 30)["state"] == "done"  # by snapshots
        here.until(lambda: "user and password" in diagnostic(here)["message"], 5)
        end = time.monotonic() + 5
        here.until(lambda: time.monotonic() > end, 10)
        assert here.service.feed.channel is not None
        assert here.service.feed.channel.reader.flow.failures == 1


def test_a_port_that_is_taken_costs_the_stream_alone(tmp_path: Path, camera: simulated.Simulated) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with bench(tmp_path, camera, stream={"port": port}) as here:
            assert stream(here)["url"] == ""
            here.order("RTSP", "ON", "1")
            assert here.end_of("1", 5)["state"] == "refused"
            here.until(lambda: bool(here.payloads("position")), 10)
            here.order("Zoom", "0", "2")
            assert here.end_of("2", 20)["state"] == "done", here.end_of("2", 1)["error"]
