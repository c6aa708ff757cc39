"""The real program on a free port, asked with httpx and with bare sockets."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator

import cv2
import httpx
import numpy as np
import pytest

from services.errors import ConfigError
from services.peers import wait_until
from services.simulators.camera import Config, start
from services.simulators.camera.program import Simulated

ATTACH = "/cgi-bin/eventManager.cgi?action=attach&codes=[VideoMotion]&heartbeat=1"
STATUS = "/cgi-bin/ptz.cgi?action=getStatus"


@pytest.fixture
def client(camera: Simulated) -> Iterator[httpx.Client]:
    auth = httpx.DigestAuth("ros", "secret123")
    with httpx.Client(base_url=camera.url, auth=auth, timeout=10) as opened:
        yield opened


@pytest.fixture
def door(camera: Simulated) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=camera.side_door_url, timeout=10) as opened:
        yield opened


def _raw(camera: Simulated, text: str) -> bytes:
    with socket.create_connection(("127.0.0.1", camera.port), timeout=10) as connection:
        connection.sendall(text.encode())
        return b"".join(iter(lambda: connection.recv(65536), b""))


def _until(lines: Iterator[bytes], wanted: bytes) -> bytes:
    seen = b""
    for chunk in lines:
        seen += chunk
        if wanted in seen:
            return seen
    raise AssertionError(seen)


def test_the_first_answer_is_a_challenge_as_captured(camera: Simulated) -> None:
    answer = _raw(camera, f"GET {STATUS} HTTP/1.1\r\nHost: camera\r\n\r\n").decode()
    first, challenge, *rest = answer.split("\r\n")
    assert first == "HTTP/1.1 401 Unauthorized"
    assert challenge.startswith('WWW-Authenticate: Digest realm="Login to AMC0000000000001",qop="auth",nonce="')
    assert rest == ["Connection: close", "CONTENT-LENGTH: 0", "", ""]


def test_the_root_page_asks_for_nothing(camera: Simulated) -> None:
    assert _raw(camera, "GET / HTTP/1.1\r\nHost: camera\r\n\r\n").startswith(b"HTTP/1.1 200 OK\r\n")


def test_an_authenticated_answer_has_the_captured_headers(client: httpx.Client) -> None:
    answer = client.get("/cgi-bin/magicBox.cgi?action=getDeviceType")
    assert answer.text == "type=IP3M-941W\r\n"
    assert answer.headers.multi_items() == [
        ("connection", "close"),
        ("content-length", "16"),
        ("content-type", "text/plain;charset=utf-8"),
    ]


def test_the_log_tells_the_target_as_it_was_sent(client: httpx.Client, door: httpx.Client) -> None:
    client.get("/cgi-bin/configManager.cgi?action=getConfig&name=VideoInOptions[0]")
    entry = door.get("/log").json()[-1]
    assert entry["target"] == "/cgi-bin/configManager.cgi?action=getConfig&name=VideoInOptions[0]"
    assert (entry["status"], entry["authorized"]) == (200, True)


def test_a_move_is_seen_in_status_and_truth(client: httpx.Client, door: httpx.Client) -> None:
    door.post("/pose", json={"pan": 20, "tilt": 30})
    client.get("/cgi-bin/ptz.cgi?action=start&channel=1&code=Right&arg1=0&arg2=8&arg3=0")
    wait_until(lambda: door.get("/state").json()["pose"]["pan"] > 30, "the camera to turn", 5)
    assert "MoveStatus=Moving" in client.get(STATUS).text
    client.get("/cgi-bin/ptz.cgi?action=stop&channel=1&code=Right&arg1=0&arg2=0&arg3=0")
    wait_until(lambda: not door.get("/state").json()["moving"], "the camera to come to rest", 5)
    still = door.get("/state").json()
    assert f"Postion[0]={still['reading']['pan']:.6f}" in client.get(STATUS).text


def test_a_snapshot_is_the_main_stream_and_honours_flip_and_mirror(client: httpx.Client, door: httpx.Client) -> None:
    def taken() -> np.ndarray:
        answer = client.get("/cgi-bin/snapshot.cgi")
        assert answer.headers["content-type"] == "image/jpeg"
        return cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR).astype(float)

    door.post("/pose", json={"pan": 326.8, "tilt": 40.5})
    right_way_up = taken()
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_1000))
    assert 582 in detector.detectMarkers(right_way_up.astype(np.uint8))[1]
    assert right_way_up.shape == (1296, 2304, 3)
    client.get(
        "/cgi-bin/configManager.cgi?action=setConfig&VideoInOptions[0].Flip=false&VideoInOptions[0].Mirror=false"
    )
    assert np.abs(taken()[::-1, ::-1] - right_way_up).mean() < 4
    client.get("/cgi-bin/configManager.cgi?action=setConfig&VideoInOptions[0].DayNightColor=2")
    grey = taken()
    assert np.abs(grey[..., 0] - grey[..., 2]).max() <= 2


def test_the_substream_is_a_multipart_of_jpegs(client: httpx.Client) -> None:
    with client.stream("GET", "/cgi-bin/mjpg/video.cgi?channel=1&subtype=1") as stream:
        assert stream.headers["content-type"] == "multipart/x-mixed-replace; boundary=myboundary"
        head, _, rest = _until(stream.iter_raw(), b"\xff\xd9\r\n--myboundary").partition(b"\r\n\r\n")
    assert head.startswith(b"--myboundary\r\nContent-Type: image/jpeg\r\nContent-Length: ")
    picture = cv2.imdecode(np.frombuffer(rest, np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (396, 704, 3)


def test_events_come_as_parts_with_heartbeats_between(client: httpx.Client, door: httpx.Client) -> None:
    with client.stream("GET", ATTACH) as stream:
        parts = stream.iter_raw()
        _until(parts, b"Content-Length:9\r\n\r\nHeartbeat\r\n\r\n")
        door.post("/event", json={"code": "AlarmLocal", "action": "Start"})
        door.post("/event", json={"code": "VideoMotion", "action": "Start"})
        seen = _until(parts, b"VideoMotion")
    assert b"Content-Length:37\r\n\r\nCode=VideoMotion;action=Start;index=0" in seen
    assert b"AlarmLocal" not in seen
    indexes = client.get("/cgi-bin/eventManager.cgi?action=getEventIndexes&code=VideoMotion")
    assert indexes.text == "channels[0]=0\r\n"


@pytest.mark.parametrize(("how", "status"), [("500", 500), ("401", 401), ("text", 200)])
def test_ordered_failures_come_and_go(client: httpx.Client, door: httpx.Client, how: str, status: int) -> None:
    door.post("/fail", json={"n": 2, "how": how})
    assert client.get(STATUS).status_code == status
    door.post("/fail", json={"n": 0})
    assert client.get(STATUS).text.startswith("status.")


def test_a_closed_connection_has_no_answer(client: httpx.Client, door: httpx.Client) -> None:
    door.post("/fail", json={"n": 1, "how": "close"})
    with pytest.raises(httpx.TransportError):
        client.get(STATUS)
    assert client.get(STATUS).status_code == 200


def test_a_frozen_camera_accepts_and_does_not_answer(client: httpx.Client, door: httpx.Client) -> None:
    door.post("/freeze", json={"on": True})
    with pytest.raises(httpx.ReadTimeout):
        client.get(STATUS, timeout=0.3)
    door.post("/freeze", json={"on": False})
    assert client.get(STATUS).status_code == 200


def test_dropped_connections_end_the_event_stream(client: httpx.Client, door: httpx.Client) -> None:
    with client.stream("GET", ATTACH) as stream:
        door.post("/drop", json={})
        assert b"".join(stream.iter_raw()).count(b"Heartbeat") <= 1


def test_a_rebooting_camera_resets_connections(client: httpx.Client) -> None:
    assert client.get("/cgi-bin/magicBox.cgi?action=reboot").text == "OK\r\n"
    with pytest.raises(httpx.TransportError):
        client.get(STATUS)


def test_a_wrong_password_is_refused(camera: Simulated) -> None:
    answer = httpx.get(camera.url + STATUS, auth=httpx.DigestAuth("ros", "wrong"), timeout=30)
    assert answer.status_code == 401


@pytest.mark.parametrize(
    ("path", "body"),
    [("/pose", {"pan": "x"}), ("/pose", {"roll": 1}), ("/nonsense", {}), ("/event", {}), ("/fail", [])],
)
def test_the_side_door_refuses_nonsense(door: httpx.Client, path: str, body: object) -> None:
    assert door.post(path, json=body).status_code == 400


def test_control_requests_wait_their_turn(config: Config) -> None:
    slow = config.model_copy(update={"latency_s": 0.25})  # 0.15 at least
    with start(slow) as camera, httpx.Client(auth=httpx.DigestAuth("ros", "secret123"), timeout=30) as client:
        client.get(camera.url + STATUS)
        began = camera.server.clock()
        threads = [threading.Thread(target=client.get, args=(camera.url + STATUS,)) for _ in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert camera.server.clock() - began >= 0.45


def test_a_ready_line_tells_the_ports(camera: Simulated) -> None:
    said = camera.addresses
    assert said["url"] == f"http://127.0.0.1:{said['port']}"
    assert httpx.get(camera.side_door_url + "/state", timeout=30).json()["pose"]["tilt"] == 20.0


def test_an_unknown_camera_is_a_configuration_error(config: Config) -> None:
    with (
        pytest.raises(ConfigError, match="expected one of ip1, got 'ip9'"),
        start(config.model_copy(update={"camera": "ip9"})),
    ):
        pass
