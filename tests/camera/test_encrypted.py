"""A camera at an https:// address whose certificate no authority knows: named, it is met everywhere; else nowhere."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import httpx
import pytest
import yaml
from pydantic import SecretStr, ValidationError

from services import camera as real
from services.bus import Message
from services.camera import program
from services.camera.address import Address
from services.camera.brands import amcrest, onvif
from services.camera.brands.dahua.streams import MJPEG
from services.camera.device import Away, Direction, Identify, Reading, Refused, Start, Status, Stop
from services.camera.probe.wire import Wire
from services.camera.settings import Config
from services.camera.watchdog import Watchdog
from services.camera.web.dahua import DahuaEar, DahuaSound
from services.camera.web.gate import Gate
from services.camera.web.motion_jpeg import MotionJpeg
from services.camera.web.trust import trust
from services.camera.web.upload import upload
from services.doctor import others
from services.errors import ConfigError
from services.simulators import camera as simulated
from services.simulators.world import load
from tests.camera.bench import PASSWORD, SHIPPED, Bench, bench, settings, simulator
from tests.camera.speaking import speaking
from tests.camera.test_probe import command
from tests.tls_port import Shown, TlsPort, shown, tls_port

MISTRUST = r"^its certificate is not trusted: .+; name the right one as `certificate` beside its address"
SILENCE = b"\xd5" * 4000  # half a second of A-law
KNOCKS = 8  # of a service in its first three seconds with a camera that it does not reach


@pytest.fixture
def own(tmp_path: Path) -> Shown:
    return shown(tmp_path)


@pytest.fixture
def camera() -> Iterator[simulated.Simulated]:
    with simulator(latency_s=0.02) as running:
        yield running


@pytest.fixture
def port(camera: simulated.Simulated, own: Shown) -> Iterator[TlsPort]:
    with tls_port(camera.port, own) as running:
        yield running


@pytest.fixture
def here(tmp_path: Path, camera: simulated.Simulated, port: TlsPort, own: Shown) -> Iterator[Bench]:
    names = {"url": port.url, "certificate": own.certificate.name}
    with bench(tmp_path, camera, motion={"heartbeat_s": 1, "hold_s": 1.0}, **names) as running:
        yield running


def address(url: str, certificate: Path | None) -> Address:
    return Address(url, "ros", SecretStr(PASSWORD), certificate=certificate)


def eventually(happened: Callable[[], bool], limit_s: float) -> None:
    end = time.monotonic() + limit_s
    while not happened():
        assert time.monotonic() < end, f"not within {limit_s} s"
        threading.Event().wait(0.02)


def moving(camera: simulated.Simulated) -> bool:
    return bool(httpx.get(f"{camera.side_door_url}/state", timeout=30).json()["moving"])


def test_orders_and_events_come_through(here: Bench) -> None:
    here.until(lambda: here.service.motion.fact == "attached", 10)
    here.tell("event", code="VideoMotion", action="Start")
    here.until(lambda: here.payloads("motion")[-1]["value"] == 1, 5)
    here.look("1", pan=20.0, tilt=20.0)
    assert here.end_of("1", 30)["state"] == "done"
    assert abs(here.truth()["pose"]["pan"] - 20.0) <= 0.5
    assert here.service.motion.reconnects == 0


def test_a_listener_is_ended_from_outside(port: TlsPort, own: Shown) -> None:
    ear = DahuaEar(address(port.url, own.certificate), Gate(), ("VideoMotion",), 1)
    attached, ended = threading.Event(), threading.Event()

    def listen() -> None:
        try:
            for _ in ear.listen(patient=True):
                attached.set()
        except Away:
            pass
        ended.set()

    thread = threading.Thread(target=listen)
    thread.start()
    assert attached.wait(5)
    ear.close()
    assert ended.wait(0.5)
    thread.join()


@pytest.mark.parametrize("profile", ["ip3m-941w-2019", "2020s-dahua"])
def test_sound_comes_and_goes_whole(own: Shown, profile: str) -> None:
    with speaking(profile) as camera, tls_port(camera.server_address[1], own) as port:
        sound = DahuaSound(address(port.url, own.certificate), Gate())
        sound.play(SILENCE, threading.Event())
        assert len(sound.record(0.5, threading.Event())) == 4000
    assert camera.heard == [SILENCE]


def test_a_loudspeaker_that_refuses_is_told_at_once(own: Shown) -> None:
    with speaking() as camera, tls_port(camera.server_address[1], own) as port:
        camera.refuses = True
        began = time.monotonic()
        with pytest.raises(Refused, match="the camera does not take the sound: HTTP/1"):
            DahuaSound(address(port.url, own.certificate), Gate()).play(SILENCE * 20, threading.Event())
        assert time.monotonic() - began < 4


def test_a_stop_comes_through_although_the_camera_takes_its_time_to_shake_hands(
    camera: simulated.Simulated, own: Shown
) -> None:
    with (
        tls_port(camera.port, own, hesitates_s=0.6) as port,
        closing(amcrest.connect(address(port.url, own.certificate), Gate())) as client,
    ):
        client.send(Start(Direction.LEFT, 4))
        client.send(Stop())
    eventually(lambda: not moving(camera), 2)  # it brakes


def test_the_watchdog_ends_a_motion(camera: simulated.Simulated, port: TlsPort, own: Shown) -> None:
    at = address(port.url, own.certificate)
    watchdog = Watchdog("amcrest", at)
    watchdog.tell(None)
    with closing(amcrest.connect(at, Gate())) as client:
        client.send(Start(Direction.LEFT, 4))
        watchdog.tell(Direction.LEFT)
        watchdog.close()
        eventually(lambda: not moving(camera), 10)
    assert watchdog.process.wait(10) == 0


def test_pictures_and_onvif_come_through_too(camera: simulated.Simulated, port: TlsPort, own: Shown) -> None:
    at = address(port.url, own.certificate)
    camera.server.pictures.jpeg("ExtraFormat", time.time())  # the first one takes seconds
    with closing(MotionJpeg(MJPEG, at, Gate())) as pictures:
        assert pictures.read(decode=False).jpeg
    with closing(onvif.connect(at, Gate())) as client:
        client.send(Identify())


def test_a_camera_whose_signer_nobody_knows_is_met_by_its_own_certificate(
    tmp_path: Path, camera: simulated.Simulated
) -> None:
    signed = shown(tmp_path, signer="General Device CA")
    with (
        tls_port(camera.port, signed) as port,
        closing(amcrest.connect(address(port.url, signed.certificate), Gate())) as client,
    ):
        assert isinstance(client.send(Status()), Reading)


ASKS: dict[str, Callable[[Address], object]] = {
    "control": lambda at: amcrest.connect(at, Gate()).send(Status()),
    "onvif": lambda at: onvif.connect(at, Gate()).send(Identify()),
    "events": lambda at: next(DahuaEar(at, Gate(), ("VideoMotion",), 1).listen(patient=False)),
    "sound": lambda at: upload(at, {}, "/", SILENCE, 8000, Gate(), threading.Event()),
    "pictures": lambda at: MotionJpeg(MJPEG, at, Gate()),
    "probe": lambda at: Wire(at.url, at.user, at.password, at.certificate).bare("/"),
}


@pytest.mark.parametrize("ask", ASKS)
@pytest.mark.parametrize("known", ["another", None])
def test_who_shows_another_certificate_is_told_nothing(
    tmp_path: Path, camera: simulated.Simulated, port: TlsPort, ask: str, known: str | None
) -> None:
    with pytest.raises(Away, match=MISTRUST):
        ASKS[ask](address(port.url, shown(tmp_path, known).certificate if known else None))
    assert not camera.server.log


def test_a_camera_with_another_certificate_is_offline_for_that_reason_and_left_in_peace(
    tmp_path: Path, camera: simulated.Simulated, port: TlsPort
) -> None:
    known, inbox = shown(tmp_path, "another").certificate, queue.Queue[Message]()
    world = load(SHIPPED / "world.yaml")
    section = settings(camera, SHIPPED, world, url=port.url, certificate=known)
    with real.start(section, inbox.put) as service:
        here = Bench(service, inbox, camera, world)
        here.until(lambda: "certificate" in service.health.reason, 5)
        end = time.monotonic() + 3.0
        here.until(lambda: time.monotonic() > end, 5)
    (status, *_) = reversed(here.payloads("status"))
    assert status["state"] == "offline"
    assert status["reason"].startswith("its certificate is not trusted: self-signed certificate; name the right one")
    assert not camera.server.log
    assert len(port.knocks) <= KNOCKS


def test_the_probe_and_the_doctor_take_the_certificate(
    tmp_path: Path, camera: simulated.Simulated, port: TlsPort, own: Shown
) -> None:
    words = ("ip9", "--url", port.url, "--user", "ros", "--certificate", own.certificate.name)
    done = command(tmp_path, *words, CAMERA_IP9_PASSWORD=PASSWORD)
    assert done.returncode == 0, done.stderr
    section = yaml.safe_load((tmp_path / "probe-ip9" / "ip9.yaml").read_text())["cameras"]["ip9"]
    assert (section["url"], section["certificate"]) == (port.url, str(own.certificate))
    known = {"url": port.url, "user": "ros", "password": PASSWORD}
    (well,) = others.camera("ip9", Config.model_validate({**known, "certificate": own.certificate}))
    (ill,) = others.camera("ip9", Config.model_validate(known))
    assert (well.good, ill.good) == (True, False)
    assert "its certificate is not trusted" in ill.what


@pytest.mark.parametrize(
    ("url", "file", "told"),
    [
        ("http://192.0.2.9", "ip9.pem", "--certificate: expected an https:// address with --url beside it"),
        ("https://192.0.2.9", "ip9.pem", "certificate: expected a readable file, got no file ip9.pem"),
    ],
)
def test_the_probe_refuses_a_certificate_that_is_none(tmp_path: Path, url: str, file: str, told: str) -> None:
    done = command(tmp_path, "ip9", "--url", url, "--certificate", file, CAMERA_IP9_PASSWORD=PASSWORD)
    assert done.returncode == 2
    assert told in done.stderr


def test_what_is_trusted_is_read_once_and_nothing_for_a_camera_without_tls(own: Shown) -> None:
    assert trust("https://192.0.2.9", own.certificate) is trust("https://192.0.2.10", own.certificate)
    assert trust("https://192.0.2.9", None) is trust("https://192.0.2.10", None)
    assert trust("http://192.0.2.9", None).cert_store_stats()["x509"] == 0


def test_the_file_lies_beside_the_configuration(tmp_path: Path, own: Shown) -> None:
    config = Config(folder=tmp_path, url="https://192.0.2.9", certificate=Path(own.certificate.name))
    assert config.address.certificate == own.certificate
    program.check(config)


def test_a_file_that_is_missing_or_no_certificate_is_a_fault(tmp_path: Path, own: Shown) -> None:
    config = Config(folder=tmp_path, name="ip1", url="https://192.0.2.9", certificate=Path("ip1.pem"))
    with pytest.raises(ConfigError) as caught:
        program.check(config)
    missing = f"cameras.ip1.certificate: expected a readable file, got no file {tmp_path / 'ip1.pem'}"
    assert caught.value.faults == (missing,)
    (tmp_path / "ip1.pem").write_bytes(own.key.read_bytes())
    with pytest.raises(ConfigError) as caught, real.start(config, lambda message: None):
        pass
    told = f"cameras.ip1.certificate: expected a certificate as PEM, got none in {tmp_path / 'ip1.pem'}"
    assert caught.value.faults == (told,)


def test_a_certificate_where_nothing_is_encrypted_is_a_fault() -> None:
    with pytest.raises(ValidationError, match="expected an https:// address in url beside it, got 'http://192"):
        Config(url="http://192.0.2.9", certificate=Path("ip1.pem"))
