"""The camera's RTSP stream, watched as the service watches it: with PyAV, which is FFmpeg, over a real connection."""

from __future__ import annotations

import gc
import socket
import weakref
from collections.abc import Iterator
from contextlib import suppress
from threading import enumerate as threads
from typing import Any

import av
import av.error
import httpx
import numpy as np
import pytest

from services.peers import wait_until
from services.simulators.camera import Config, start
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.motors import Pose
from services.simulators.camera.program import Simulated
from services.simulators.camera.view.picture import STREAMS

pytest.importorskip("gi", reason="apt-get install python3-gi gir1.2-gst-rtsp-server-1.0")
pytestmark = pytest.mark.rtsp
QUERY = {"MainFormat": "channel=1&subtype=0", "ExtraFormat": "channel=1&subtype=1"}
PATIENCE_S = 20.0


def _url(camera: Simulated, stream: str = "ExtraFormat", account: str = "ros:secret123@") -> str:
    return f"rtsp://{account}127.0.0.1:{camera.rtsp_port}/cam/realmonitor?{QUERY[stream]}"


def _opened(url: str, transport: str = "tcp") -> Any:
    options = {"rtsp_transport": transport, "probesize": "32", "analyzeduration": "1"}  # else seconds go by
    return av.open(url, options=options, timeout=PATIENCE_S)


def _frames(container: Any) -> Iterator[np.ndarray]:
    for frame in container.decode(video=0):
        yield frame.to_ndarray(format="bgr24")


def _watched_to_its_end(container: Any) -> None:
    """Fails when the stream does not end."""
    with suppress(av.error.FFmpegError):
        assert sum(1 for _ in zip(range(200), container.demux(video=0), strict=False)) < 200


def _asked(camera: Simulated, method: str, headers: str = "") -> str:
    with socket.create_connection(("127.0.0.1", camera.rtsp_port or 0), timeout=PATIENCE_S) as connection:
        connection.sendall(f"{method} {_url(camera, account='')} RTSP/1.0\r\nCSeq: 1\r\n{headers}\r\n".encode())
        return connection.recv(4096).decode()


@pytest.fixture
def door(camera: Simulated) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=camera.side_door_url, timeout=PATIENCE_S) as opened:
        yield opened


@pytest.fixture
def client(camera: Simulated) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=camera.url, auth=httpx.DigestAuth("ros", "secret123"), timeout=PATIENCE_S) as opened:
        yield opened


@pytest.mark.parametrize("stream", STREAMS)
@pytest.mark.parametrize("transport", ["tcp", "udp"])
def test_each_stream_has_the_size_of_the_encode_table(camera: Simulated, stream: str, transport: str) -> None:
    with _opened(_url(camera, stream), transport) as video:
        assert video.streams.video[0].codec_context.name == "h264"
        picture = next(_frames(video))
    assert picture.shape == ((1296, 2304, 3) if stream == "MainFormat" else (396, 704, 3))


def test_the_stream_shows_what_the_snapshot_shows(camera: Simulated) -> None:
    pictures, device = camera.server.pictures, camera.server.device
    device.place(Pose(326.8, 40.5, 0.0), camera.server.clock())
    with _opened(_url(camera)) as video:
        seen = next(_frames(video)).astype(float)
    expected = pictures.frame("ExtraFormat", camera.server.clock()).astype(float)
    assert np.abs(seen - expected).mean() < 8


def test_a_picture_arrives_as_late_as_from_a_camera_that_buffers(camera: Simulated) -> None:
    with _opened(_url(camera)) as video:
        frames = _frames(video)
        before = next(frames)
        moved = camera.server.clock()
        camera.server.device.place(Pose(200.0, 60.0, 0.0), moved)
        next(frame for frame in frames if np.abs(frame.astype(float) - before).mean() > 15)
        assert camera.server.clock() - moved > 0.2


def test_the_challenge_is_the_cameras_and_has_no_qop(camera: Simulated) -> None:
    answer = _asked(camera, "DESCRIBE")
    assert answer.startswith("RTSP/1.0 401 Unauthorized\r\nCSeq: 1\r\n")
    assert 'WWW-Authenticate: Digest realm="Login to AMC0000000000001", nonce="' in answer
    assert "qop" not in answer


def test_wrong_passwords_are_refused_and_count_towards_the_lockout(camera: Simulated) -> None:
    with pytest.raises(av.error.HTTPUnauthorizedError):
        _opened(_url(camera, account="ros:wrong@"))
    assert camera.server.door.counters["wrong"] == 1
    for _ in range(camera.server.device.profile.lockout_failures - 1):
        with pytest.raises(av.error.HTTPUnauthorizedError):
            _opened(_url(camera, account="ros:wrong@"))
    with pytest.raises(av.error.HTTPUnauthorizedError):
        _opened(_url(camera))


def test_a_changed_password_counts_here_too(camera: Simulated) -> None:
    camera.server.door.set_account("ros", "another")
    with pytest.raises(av.error.HTTPUnauthorizedError):
        _opened(_url(camera))
    with _opened(_url(camera, account="ros:another@")) as video:
        assert next(_frames(video)).size


def test_old_firmware_takes_basic(config: Config) -> None:
    with start(config.model_copy(update={"switches": PROFILES["ip2m-841b-strict"]})) as camera:
        assert 'WWW-Authenticate: Basic realm="Login to AMC0000000000001"' in _asked(camera, "DESCRIBE")
        with _opened(_url(camera)) as video:
            assert next(_frames(video)).size
        with pytest.raises(av.error.HTTPUnauthorizedError):
            _opened(_url(camera, account="ros:wrong@"))
        assert camera.server.door.counters["wrong"] == 1


def test_an_unknown_path_is_not_found(camera: Simulated) -> None:
    with pytest.raises(av.error.HTTPNotFoundError):
        _opened(_url(camera).replace("realmonitor", "nonsense"))


def test_those_who_watch_share_one_encoder(camera: Simulated, door: httpx.Client) -> None:
    with _opened(_url(camera)) as one, _opened(_url(camera) + "&unicast=true&proto=Onvif") as other:
        next(_frames(one))
        next(_frames(other))
        before = door.get("/state").json()["frames_rendered"]["ExtraFormat"]
        assert sum(1 for _, frame in zip(range(20), _frames(other), strict=False) if frame.size) == 20
        after = door.get("/state").json()
    assert after["frames_rendered"]["ExtraFormat"] - before < 30
    assert after["frames_rendered"]["MainFormat"] == 0
    assert after["fps"]["ExtraFormat"] > 0


def test_nothing_is_rendered_when_nobody_watches(camera: Simulated) -> None:
    with _opened(_url(camera)) as video:
        next(_frames(video))
    wait_until(lambda: camera.server.pictures.rates()["fps"]["ExtraFormat"] == 0, "rendering to end", PATIENCE_S)


def test_a_new_encode_table_cuts_the_stream_and_the_next_one_has_its_size(
    camera: Simulated, client: httpx.Client
) -> None:
    with _opened(_url(camera)) as video:
        next(_frames(video))
        table = "Encode[0].ExtraFormat[0].Video.Width=640&Encode[0].ExtraFormat[0].Video.Height=360"
        assert client.get(f"/cgi-bin/configManager.cgi?action=setConfig&{table}").text == "OK\r\n"
        _watched_to_its_end(video)
    with _opened(_url(camera)) as video:
        assert next(_frames(video)).shape == (360, 640, 3)


def test_a_reboot_cuts_the_stream_and_refuses_the_next_one(camera: Simulated, client: httpx.Client) -> None:
    with _opened(_url(camera)) as video:
        next(_frames(video))
        client.get("/cgi-bin/magicBox.cgi?action=reboot")
        _watched_to_its_end(video)
    with pytest.raises((av.error.FFmpegError, OSError)):
        _opened(_url(camera))


def test_a_frozen_stream_stays_open_and_brings_nothing_new(camera: Simulated) -> None:
    with _opened(_url(camera)) as video:
        frames = _frames(video)
        next(frames)
        camera.server.faults.frozen_stream = True
        wait_until(
            lambda: camera.server.pictures.rates()["fps"]["ExtraFormat"] == 0, "the stream to freeze", PATIENCE_S
        )
        camera.server.faults.frozen_stream = False
        assert next(frames).shape == (396, 704, 3)


def test_the_configuration_tells_the_true_port(camera: Simulated, client: httpx.Client) -> None:
    table = client.get("/cgi-bin/configManager.cgi?action=getConfig&name=RTSP").text
    assert f"table.RTSP.Port={camera.rtsp_port}\r\n" in table
    assert camera.addresses["rtsp_port"] == camera.rtsp_port


def test_nothing_is_left_when_the_camera_ends(config: Config) -> None:
    before = {thread.ident for thread in threads()}
    with start(config) as camera, _opened(_url(camera)) as video:
        next(_frames(video))
        held = weakref.ref(camera.server)
    assert {thread.ident for thread in threads()} <= before
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", camera.rtsp_port or 0), timeout=1)
    del camera, video
    gc.collect()
    assert held() is None, "GStreamer holds the camera and its pictures"


def test_no_port_is_opened_where_none_is_wanted(config: Config) -> None:
    with start(config.model_copy(update={"rtsp_port": None})) as camera:
        assert camera.rtsp_port is None
        assert "rtsp_port" not in camera.addresses
