"""What can be made to go wrong with a running camera, one by one, and that it ends when it is switched off."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import pytest

from services.peers import wait_until
from services.simulators.camera import troubles
from services.simulators.camera.program import Simulated
from services.simulators.camera.troubles import TROUBLES

STATUS = "/cgi-bin/ptz.cgi?action=getStatus"
RIGHT = "/cgi-bin/ptz.cgi?action=start&channel=1&code=Right&arg1=0&arg2=4&arg3=0"
ATTACH = "/cgi-bin/eventManager.cgi?action=attach&codes=[VideoMotion]&heartbeat=1"
CAREFUL = httpx.Timeout(10.0)
IMPATIENT = httpx.Timeout(0.4)
TWO_BEATS = httpx.Timeout(2.5)  # longer than a stream that is well is ever silent


@pytest.fixture
def client(camera: Simulated) -> Iterator[httpx.Client]:
    auth = httpx.DigestAuth("ros", "secret123")
    with httpx.Client(base_url=camera.url, auth=auth, timeout=CAREFUL) as opened:
        yield opened


@pytest.fixture
def door(camera: Simulated) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=camera.side_door_url, timeout=CAREFUL) as opened:
        yield opened


@contextmanager
def _fault(door: httpx.Client, name: str, **settings: object) -> Iterator[None]:
    door.post("/fault", json={"name": name, "on": True, **settings}).raise_for_status()
    yield
    door.post("/fault", json={"name": name, "on": False}).raise_for_status()


def _works(client: httpx.Client) -> bool:
    answer = client.get(STATUS)
    return answer.status_code == 200 and answer.text.startswith("status.")


def _pan(door: httpx.Client) -> float:
    pan: float = door.get("/state").json()["pose"]["pan"]
    return pan


@pytest.mark.parametrize("name", ["drop", "hang", "cut"])
def test_no_answer_comes_while_it_lasts(client: httpx.Client, door: httpx.Client, name: str) -> None:
    with _fault(door, name), pytest.raises(httpx.TransportError):
        client.get(STATUS, timeout=IMPATIENT)
    assert _works(client)


def test_every_request_fails_while_it_lasts(client: httpx.Client, door: httpx.Client) -> None:
    with _fault(door, "500"):
        assert [client.get(STATUS).status_code for _ in range(3)] == [500] * 3
    assert _works(client)


def test_a_slow_camera_takes_the_seconds_that_it_is_given(client: httpx.Client, door: httpx.Client) -> None:
    assert _works(client)
    with _fault(door, "slow", seconds=5), pytest.raises(httpx.ReadTimeout):
        client.get(STATUS, timeout=IMPATIENT)


@pytest.mark.parametrize("name", ["silent_events", "frozen_stream", "corrupt_jpeg"])
def test_the_streams_see_their_flags(camera: Simulated, door: httpx.Client, name: str) -> None:
    with _fault(door, name):
        assert getattr(camera.server.faults, name) is True
    assert getattr(camera.server.faults, name) is False


def test_a_corrupt_picture_begins_like_one_and_ends_too_early(client: httpx.Client, door: httpx.Client) -> None:
    with _fault(door, "corrupt_jpeg"):
        spoilt = client.get("/cgi-bin/snapshot.cgi").content
    whole = client.get("/cgi-bin/snapshot.cgi").content
    assert (spoilt[:2], spoilt[-2:] == b"\xff\xd9") == (b"\xff\xd8", False)
    assert (whole[:2], whole[-2:]) == (b"\xff\xd8", b"\xff\xd9")


def test_good_logins_are_refused_at_random_and_cost_nothing(client: httpx.Client, door: httpx.Client) -> None:
    with _fault(door, "nonce", share=0.5):
        assert {client.get(STATUS).status_code for _ in range(30)} == {200, 401}
    assert all(_works(client) for _ in range(20))


def test_another_password_is_needed_after_it_was_changed(camera: Simulated, door: httpx.Client) -> None:
    old, new = httpx.DigestAuth("ros", "secret123"), httpx.DigestAuth("ros", "other")
    with _fault(door, "password", password="other"):
        assert httpx.get(camera.url + STATUS, auth=old, timeout=30).status_code == 401
        assert httpx.get(camera.url + STATUS, auth=new, timeout=30).status_code == 200
    assert httpx.get(camera.url + STATUS, auth=old, timeout=30).status_code == 200


def test_a_locked_account_refuses_the_right_password(client: httpx.Client, door: httpx.Client) -> None:
    with _fault(door, "locked"):
        answer = client.get(STATUS)
        assert (answer.status_code, answer.text) == (401, "Error\r\nUser Locked!\r\n")
    assert _works(client)


def test_an_account_without_rights_looks_but_does_not_turn(client: httpx.Client, door: httpx.Client) -> None:
    before = _pan(door)
    with _fault(door, "rights"):
        answer = client.get(RIGHT)
        assert (answer.status_code, answer.text) == (401, "Error\r\nInvalid Authority!\r\n")
        assert client.get("/cgi-bin/magicBox.cgi?action=getDeviceType").status_code == 200
        assert _pan(door) == before
    assert client.get(RIGHT).text == "OK\r\n"


def test_stops_that_are_lost_are_answered_well_and_stop_nothing(client: httpx.Client, door: httpx.Client) -> None:
    stop = RIGHT.replace("action=start", "action=stop")
    door.post("/fault", json={"name": "lost_stop", "n": 2}).raise_for_status()
    assert client.get(stop).text == "OK\r\n", "nothing turns: none to be lost"
    assert client.get(RIGHT).text == "OK\r\n"
    for _ in range(2):
        assert client.get(stop).text == "OK\r\n"
        here = _pan(door)
        wait_until(lambda here=here: _pan(door) > here + 2.0, "the camera to turn on", 5)  # type: ignore[misc]
    assert client.get(stop).text == "OK\r\n"
    wait_until(lambda: not door.get("/state").json()["moving"], "rest", 5)


def test_a_camera_that_a_router_says_is_not_there_resets_connections(client: httpx.Client, door: httpx.Client) -> None:
    with _fault(door, "cut", refuses=True), pytest.raises(httpx.TransportError):
        client.get(STATUS)
    assert _works(client)


def test_an_event_stream_falls_silent_in_a_cut_and_goes_on_afterwards(client: httpx.Client, door: httpx.Client) -> None:
    seen: list[bytes] = []
    with client.stream("GET", ATTACH, timeout=TWO_BEATS) as stream, _fault(door, "cut"):
        door.post("/event", json={"code": "VideoMotion", "action": "Start"})
        with pytest.raises(httpx.ReadTimeout):
            seen.extend(stream.iter_raw())
    assert b"VideoMotion" not in b"".join(seen)
    with client.stream("GET", ATTACH) as stream:
        with _fault(door, "cut"):
            door.post("/event", json={"code": "VideoMotion", "action": "Stop"})
        assert any(b"action=Stop" in part for part in stream.iter_raw())


def test_what_was_asked_in_a_cut_by_somebody_who_gave_up_never_arrives(
    client: httpx.Client, door: httpx.Client
) -> None:
    assert _works(client)
    with _fault(door, "cut"), pytest.raises(httpx.TransportError):
        client.get(RIGHT, timeout=IMPATIENT)
    assert _works(client)
    assert door.get("/motors").json()["commands"] == 0


def test_what_was_asked_in_a_cut_by_somebody_who_waits_arrives_afterwards(
    camera: Simulated, client: httpx.Client, door: httpx.Client
) -> None:
    with _fault(door, "cut"):
        waiting = threading.Thread(target=client.get, args=(RIGHT,))
        waiting.start()
        wait_until(lambda: bool(camera.server.connected), "the request to be under way", 5)
        assert door.get("/motors").json()["commands"] == 0
    waiting.join()
    assert door.get("/motors").json()["commands"] == 1


def test_the_motors_turn_on_while_the_network_is_cut(client: httpx.Client, door: httpx.Client) -> None:
    client.get(RIGHT)
    with _fault(door, "cut"):
        here = _pan(door)
        wait_until(lambda: _pan(door) > here + 2.0, "the camera to turn on", 5)


def test_a_reboot_ends_every_connection_and_answers_nobody(client: httpx.Client, door: httpx.Client) -> None:
    with client.stream("GET", ATTACH) as stream:
        door.post("/fault", json={"name": "reboot"}).raise_for_status()
        assert b"".join(stream.iter_raw()).count(b"Heartbeat") <= 1
    with pytest.raises(httpx.TransportError):
        client.get(STATUS)
    assert door.get("/state").json()["booting"]


def test_a_clock_that_jumped_shows_in_the_cameras_time(client: httpx.Client, door: httpx.Client) -> None:
    def told() -> str:
        return client.get("/cgi-bin/global.cgi?action=getCurrentTime").text[len("result=") : len("result=2026")]

    before = told()
    with _fault(door, "clock", seconds=-10 * 365.25 * 86400):
        assert int(told()) == int(before) - 10
    assert told() == before


def test_everything_can_be_ended_at_once(client: httpx.Client, door: httpx.Client) -> None:
    for name in sorted(set(TROUBLES) - {"reboot"}):
        door.post("/fault", json={"name": name}).raise_for_status()
    door.post("/well", json={}).raise_for_status()
    assert _works(client)


@pytest.mark.parametrize("order", [{}, {"name": "nonsense"}, {"name": "slow", "seconds": "x"}, []])
def test_a_fault_that_does_not_exist_is_refused(door: httpx.Client, order: object) -> None:
    assert door.post("/fault", json=order).status_code == 400


def test_every_fault_is_explained() -> None:
    told = {line.split("  ")[0] for line in (troubles.__doc__ or "").splitlines()[2:] if line}
    assert told == set(TROUBLES)
