"""The contract of every brand: each file in `camera/brands/` against the simulated camera, over HTTP on loopback."""

from __future__ import annotations

import shutil
import socket
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import httpx
import pytest
from pydantic import SecretStr

from services.camera import brands
from services.camera.address import Address
from services.camera.capabilities import Capabilities, GetCapabilities
from services.camera.device import (
    Away,
    BadLogin,
    Camera,
    ClearPreset,
    Direction,
    GotoPreset,
    Identify,
    Identity,
    MoveTo,
    Reading,
    Refused,
    SavePreset,
    Snapshot,
    Start,
    Status,
    Stop,
)
from services.camera.errands import GetPresets
from services.camera.lanes import same
from services.camera.settings import Config
from services.camera.watchdog import connector
from services.camera.web.gate import Gate
from services.errors import DeviceError
from services.peers import free_port, wait_until
from services.simulators import camera as simulated
from services.simulators.camera.motors import Pose
from tests.camera.bench import PASSWORD, SHIPPED, bench, simulator

BRANDS = sorted(file.stem for file in Path(brands.__path__[0]).glob("[a-z]*.py"))
FREE = 20  # a preset that nobody has stored
GARBAGE = {
    "nothing": b"",
    "a page": b"<html><body>Please log in</body></html>",
    "noise": bytes(range(256)),
    "half a table": b"status.Postion[0]=\r\nstatus.Postion[1",
    "letters for numbers": b"status.Postion[0]=abc\r\nstatus.Postion[1]=1\r\n",
    "entities": b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>',
    "another encoding": '<?xml version="1.0" encoding="utf-16"?><!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'.encode(
        "utf-16"
    ),
    "an empty envelope": b'<e:Envelope xmlns:e="http://www.w3.org/2003/05/soap-envelope"><e:Body/></e:Envelope>',
}


@pytest.fixture(params=BRANDS)
def brand(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def camera() -> Iterator[simulated.Simulated]:
    with simulator(latency_s=0) as running:
        yield running


@pytest.fixture
def driver(brand: str, camera: simulated.Simulated) -> Iterator[Camera]:
    with driving(brand, camera.url) as opened:
        yield opened


@contextmanager
def driving(brand: str, url: str, password: str = PASSWORD) -> Iterator[Camera]:
    with closing(connector(brand, Address(url, "ros", SecretStr(password)), Gate())()) as opened:
        yield opened


def reading(driver: Camera) -> Reading:
    found = driver.send(Status())
    assert isinstance(found, Reading)
    return found


def tell(camera: simulated.Simulated, path: str, **content: object) -> None:
    httpx.post(f"{camera.side_door_url}/{path}", json=content, timeout=30).raise_for_status()


def state(camera: simulated.Simulated) -> dict[str, Any]:
    answer: dict[str, Any] = httpx.get(f"{camera.side_door_url}/state", timeout=30).json()
    return answer


def refusal(driver: Camera, request: Any) -> DeviceError:
    with pytest.raises(DeviceError) as raised:
        driver.send(request)
    return raised.value


@contextmanager
def answering(body: bytes, status: int = 200) -> Iterator[str]:
    """A device that answers everything with the same bytes; its address."""

    class Visit(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length", 0)))
            self.send_response(status)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        do_POST = do_GET  # noqa: N815 (the base class looks for these names)

        def log_message(self, format: str, *args: Any) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Visit) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.05,))
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()
            thread.join()


def test_every_brand_is_found_and_can_be_configured(brand: str) -> None:
    assert {"amcrest", "onvif"} <= set(BRANDS)
    assert Config(url="http://192.0.2.9", brand=brand).brand == brand


@pytest.mark.parametrize("pose", [(0.0, 20.0, 0.0), (178.5, -9.5, 8.0), (187.0, 107.0, 4.0), (359.5, 45.3, 2.0)])
def test_the_status_is_in_degrees(
    driver: Camera, camera: simulated.Simulated, pose: tuple[float, float, float]
) -> None:
    pan, tilt, zoom = pose
    tell(camera, "pose", pan=pan, tilt=tilt, zoom=zoom)
    assert same(reading(driver), Reading(pan, tilt, zoom))


@pytest.mark.parametrize("direction", Direction)
def test_it_turns_as_the_picture_shows_until_it_is_stopped(
    driver: Camera, camera: simulated.Simulated, direction: Direction
) -> None:
    tell(camera, "pose", pan=20.0, tilt=40.0, zoom=4.0)
    driver.send(Start(direction, 4, 4))
    wait_until(lambda: changed(camera) == direction.value, f"{direction} in the hanging picture")
    driver.send(Stop())
    wait_until(lambda: not state(camera)["moving"], "the stop")
    assert same(reading(driver), reading(driver))


def changed(camera: simulated.Simulated) -> tuple[int, ...]:
    """Signs of what has changed since the test began, by a degree or half a zoom level at least."""
    pose = state(camera)["pose"]
    ways = (pose["pan"] - 20.0, pose["tilt"] - 40.0, 2.0 * (pose["zoom"] - 4.0))
    return tuple(0 if abs(way) < 1.0 else 1 if way > 0 else -1 for way in ways)


def test_a_moving_camera_is_told_from_one_at_rest(driver: Camera) -> None:
    assert reading(driver).moving is not True
    driver.send(Start(Direction.LEFT, 4))
    wait_until(lambda: reading(driver).moving is True, "the camera to say that it moves")
    driver.send(Stop())
    wait_until(lambda: reading(driver).moving is not True, "the camera to say that it stands")


def test_a_stop_may_be_sent_again_and_without_need(driver: Camera, camera: simulated.Simulated) -> None:
    driver.send(Stop(every=True))
    driver.send(Start(Direction.UP, 3))
    for _ in range(3):
        driver.send(Stop())
    driver.send(Stop(every=True))
    wait_until(lambda: not state(camera)["moving"], "the stop")


def test_a_stop_ends_what_another_connection_has_started(brand: str, camera: simulated.Simulated) -> None:
    with driving(brand, camera.url) as one, driving(brand, camera.url) as other:
        one.send(Start(Direction.RIGHT, 2))
        other.send(Stop(direction=Direction.RIGHT))
        wait_until(lambda: not state(camera)["moving"], "the stop")


def test_a_preset_is_kept_gone_to_and_forgotten(driver: Camera, camera: simulated.Simulated) -> None:
    tell(camera, "pose", pan=33.0, tilt=44.0, zoom=0.0)
    driver.send(SavePreset(FREE))
    tell(camera, "pose", pan=30.0, tilt=41.0, zoom=0.0)
    driver.send(SavePreset(FREE))
    tell(camera, "pose", pan=40.0, tilt=45.0, zoom=2.0)
    driver.send(GotoPreset(FREE))
    wait_until(lambda: same(reading(driver), Reading(30.0, 41.0, 0.0)), "the preset to be reached")
    driver.send(ClearPreset(FREE))
    assert type(refusal(driver, GotoPreset(FREE))) is Refused
    driver.send(ClearPreset(FREE))


def test_it_tells_which_presets_there_are_whoever_made_them(driver: Camera, camera: simulated.Simulated) -> None:
    numbers = {int(number) for number in state(camera)["presets"]}
    assert driver.send(GetPresets()) == numbers
    driver.send(SavePreset(FREE))
    assert FREE in numbers_of(driver)
    assert numbers_of(driver) >= numbers
    driver.send(ClearPreset(FREE))
    assert driver.send(GetPresets()) == numbers
    camera.server.device.ptz.presets.clear()
    assert driver.send(GetPresets()) == frozenset()


def numbers_of(driver: Camera) -> frozenset[int]:
    found = driver.send(GetPresets())
    assert isinstance(found, frozenset)
    return found


def test_a_preset_of_the_cameras_own_can_be_gone_to(driver: Camera, camera: simulated.Simulated) -> None:
    before = reading(driver)
    number = next(int(number) for number in state(camera)["presets"])
    driver.send(GotoPreset(number))
    wait_until(lambda: not same(reading(driver), before), "the camera to go")


def test_a_position_that_the_firmware_takes_is_reached(brand: str) -> None:
    with simulator(latency_s=0, profile="2020s-dahua") as camera, driving(brand, camera.url) as driver:
        driver.send(MoveTo(351.0, 33.0, 2.0))
        wait_until(lambda: same(reading(driver), Reading(351.0, 33.0, 2.0)), "the position to be reached")


def test_a_snapshot_is_a_jpeg(driver: Camera) -> None:
    data = driver.send(Snapshot())
    assert isinstance(data, bytes)
    assert data.startswith(b"\xff\xd8")
    assert data.rstrip(b"\0").endswith(b"\xff\xd9")


def test_snapshots_follow_each_other_on_a_connection_of_their_own(brand: str, camera: simulated.Simulated) -> None:
    connect = connector(brand, Address(camera.url, "ros", SecretStr(PASSWORD)), Gate())
    with closing(connect()), closing(connect()) as pictures:
        assert all(pictures.send(Snapshot()) for _ in range(3))


def test_it_says_who_it_is(driver: Camera) -> None:
    identity = driver.send(Identify())
    assert isinstance(identity, Identity)
    assert (identity.model, identity.serial) == ("IP3M-941W", "AMC0000000000001")
    assert identity.version.startswith("2.420.AC00.15.R")


def test_it_says_what_its_motors_can_without_moving(driver: Camera, camera: simulated.Simulated) -> None:
    told = driver.send(GetCapabilities("motors"))
    assert isinstance(told, Capabilities)
    assert (told.presets, told.zoom) == (25, True)
    assert not state(camera)["moving"]


def test_a_wrong_password_is_a_bad_login_and_not_tried_on(brand: str, camera: simulated.Simulated) -> None:
    with driving(brand, camera.url, "wrong-horse") as driver:
        assert isinstance(refusal(driver, Status()), BadLogin)
        asked = len(camera.server.log)
        assert isinstance(refusal(driver, Status()), BadLogin)
        assert isinstance(refusal(driver, Stop()), BadLogin)
    assert len(camera.server.log) == asked
    assert state(camera)["door"]["wrong"] <= 3


def test_nobody_there_is_away(brand: str) -> None:
    with driving(brand, f"http://127.0.0.1:{free_port()}") as driver:
        assert type(refusal(driver, Status())) is Away


def test_a_connection_that_is_cut_is_away(brand: str, driver: Camera, camera: simulated.Simulated) -> None:
    tell(camera, "fail", n=20, how="close")
    for request in (Status(), Stop(), Snapshot(), Identify()):
        assert type(refusal(driver, request)) is Away


@pytest.mark.parametrize("body", GARBAGE.values(), ids=GARBAGE)
def test_an_answer_that_makes_no_sense_is_away(brand: str, body: bytes) -> None:
    with answering(body) as url, driving(brand, url) as driver:
        assert type(refusal(driver, Status())) is Away
        assert type(refusal(driver, Snapshot())) is Away


def test_a_camera_in_trouble_is_away(brand: str) -> None:
    with answering(b"Error\r\n", 500) as url, driving(brand, url) as driver:
        assert type(refusal(driver, Status())) is Away


def test_no_error_tells_the_password(brand: str, camera: simulated.Simulated) -> None:
    errors: list[BaseException] = []
    with driving(brand, camera.url) as driver:
        errors.append(refusal(driver, GotoPreset(FREE)))
        tell(camera, "fail", n=20, how="close")
        errors.append(refusal(driver, Status()))
    with driving(brand, f"http://127.0.0.1:{free_port()}") as driver:
        errors += [refusal(driver, Start(Direction.LEFT)), refusal(driver, Snapshot())]
    told = [f"{one!s} {one!r}" for error in errors for one in (error, error.__cause__, error.__context__)]
    assert [text for text in told if PASSWORD in text] == []


def test_it_closes_its_connections(brand: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = Address(f"http://127.0.0.1:{server.getsockname()[1]}", "ros", SecretStr(PASSWORD))
        driver = connector(brand, address, Gate())()
        asking = threading.Thread(target=lambda: refusal(driver, Status()))
        asking.start()
        connection, _ = server.accept()
        with connection:
            connection.settimeout(10)
            assert connection.recv(10)
            connection.sendall(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")
            asking.join()
            driver.close()
            while connection.recv(65536):
                pass


def test_the_whole_service_goes_to_a_place(brand: str, tmp_path: Path) -> None:
    with simulator(latency_s=0.05) as camera, bench(tmp_path, camera, brand=brand) as here:
        here.order("Goto", "Kitchen", "1")
        end = here.end_of("1", 60)
        assert end["state"] == "done", end["error"]
        place = replace(reading_of(here.service.places.get("Kitchen")), moving=None)
        now = reading_of(here.truth()["pose"])
        assert abs((now.pan - place.pan + 180) % 360 - 180) <= 0.5
        assert abs(now.tilt - place.tilt) <= 0.5
        assert not here.truth()["moving"]


def test_the_whole_service_leaves_the_owners_presets_alone(brand: str, tmp_path: Path) -> None:
    (tmp_path / "ip1").mkdir()
    shutil.copy(SHIPPED / "ip1" / "ost.yaml", tmp_path / "ip1")
    with simulator(latency_s=0.05) as camera:
        kept = camera.server.device.ptz.presets
        kept.clear()
        kept |= {1: ("Front door", Pose(200.0, 20.0, 0.0)), 2: ("Bed", Pose(300.0, 50.0, 2.0))}
        owners = dict(kept)
        with bench(tmp_path, camera, brand=brand) as here:
            here.order("SaveAs", "Kitchen", "1")
            assert here.end_of("1", 30)["state"] == "done"
            assert here.service.places.get("Kitchen").preset == 3
            assert set(kept) == {1, 2, 3}
            assert {number: kept[number] for number in owners} == owners
            here.order("Remove", "Kitchen", "2")
            assert here.end_of("2", 30)["state"] == "done"
            assert kept == owners


def reading_of(place: Any) -> Reading:
    values = place if isinstance(place, dict) else place.model_dump()
    return Reading(values["pan"], values["tilt"], values["zoom"])
