"""python-amcrest, which was written against real cameras, works against the simulated one.

It encodes brackets (so firmware that takes only raw ones is out) and sends PTZ to channel 0.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from threading import Thread

import cv2
import httpx
import numpy as np
import pytest

with warnings.catch_warnings():  # what its own imports complain about is not ours
    warnings.simplefilter("ignore")
    from amcrest import AmcrestCamera, LoginError

from services.peers import wait_until
from services.simulators.camera import Config, start
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.program import Simulated
from services.simulators.camera.sound import RATE, decode

FIRMWARES = ["ip3m-941w-2019", "ip4m-1041b"]
MOTION = ["Start", "Stop"]


@pytest.fixture(params=FIRMWARES)
def camera(config: Config, request: pytest.FixtureRequest) -> Iterator[Simulated]:
    with start(config.model_copy(update={"switches": PROFILES[request.param], "rtsp_port": None})) as running:
        yield running


@pytest.fixture
def amcrest(camera: Simulated) -> AmcrestCamera:
    return AmcrestCamera("127.0.0.1", camera.port, "ros", "secret123", retries_connection=0).camera


@pytest.fixture
def door(camera: Simulated) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=camera.side_door_url, timeout=10) as opened:
        yield opened


def _reads(amcrest: AmcrestCamera) -> tuple[float, float]:
    """Pan and tilt as it reads them."""
    status = dict(line.split("=", 1) for line in amcrest.ptz_status().split("\r\n") if line)
    return float(status["status.Postion[0]"]), float(status["status.Postion[1]"])


def test_it_logs_in_and_learns_what_it_talks_to(camera: Simulated, amcrest: AmcrestCamera) -> None:
    profile = camera.server.device.profile
    assert amcrest.device_type == profile.model
    assert amcrest.serial_number == camera.server.device.camera.serial
    assert amcrest.machine_name == "Camera1"
    assert amcrest.vendor_information == "Amcrest"
    version, built = amcrest.software_information
    assert (version, profile.built in built) == (profile.firmware, True)


def test_it_is_told_that_its_password_is_wrong(camera: Simulated) -> None:
    other = AmcrestCamera("127.0.0.1", camera.port, "ros", "wrong", retries_connection=0).camera
    with pytest.raises(LoginError):
        assert other.device_type


def test_it_turns_and_stops(amcrest: AmcrestCamera, door: httpx.Client) -> None:
    assert amcrest.move_right(start=True, horizontal_speed=5)
    wait_until(lambda: _reads(amcrest)[0] > 3.0, "the reading to grow", 10)
    assert amcrest.move_right(start=False)
    wait_until(lambda: not door.get("/state").json()["moving"], "it to stand", 10)
    reading = door.get("/state").json()["reading"]
    assert _reads(amcrest) == (reading["pan"], reading["tilt"])


def test_it_sets_a_preset_and_goes_there(amcrest: AmcrestCamera, door: httpx.Client) -> None:
    count = amcrest.ptz_presets_count
    door.post("/pose", json={"pan": 40.0, "tilt": 30.0})
    assert amcrest.set_preset(preset_point_number=7 + count)
    assert amcrest.ptz_presets_count == count + 1
    door.post("/pose", json={"pan": 60.0, "tilt": 20.0})
    assert amcrest.go_to_preset(preset_point_number=7 + count)
    wait_until(lambda: _reads(amcrest) == (40.0, 30.0), "the preset", 20)


def test_it_takes_a_snapshot(amcrest: AmcrestCamera, tmp_path: Path) -> None:
    amcrest.snapshot(path_file=str(tmp_path / "shot.jpg"), stream=False)
    picture = cv2.imdecode(np.frombuffer((tmp_path / "shot.jpg").read_bytes(), np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (1296, 2304, 3)


def test_it_sees_and_changes_settings(amcrest: AmcrestCamera, camera: Simulated) -> None:
    assert amcrest.is_motion_detector_on()
    assert amcrest.is_record_on_motion_detection() is False
    assert "table.VideoInOptions[0].Flip=true" in amcrest.video_in_options
    assert amcrest.command("configManager.cgi?action=setConfig&VideoInOptions[0].Flip=false").text == "OK\r\n"
    assert not camera.server.device.tables.flag("VideoInOptions[0].Flip")


def test_it_sees_the_card_and_the_clock(amcrest: AmcrestCamera) -> None:
    assert float(amcrest.storage_used_percent) == pytest.approx(39.4, abs=0.1)
    assert amcrest.current_time


@contextmanager
def _stirred(camera: Simulated) -> Iterator[None]:
    """Something moves before the lens as soon as somebody listens."""

    def stir() -> None:
        wait_until(lambda: camera.server.device.events.listeners > 0, "a listener", 10)
        camera.server.device.detector.stir(camera.server.clock() + 2.0)

    thread = Thread(target=stir)
    thread.start()
    yield
    thread.join()


@pytest.mark.parametrize("form", ["A", "B"])
def test_it_hears_motion_begin_and_end(config: Config, form: str) -> None:
    switches = {"event_form": form, "heartbeat": True}
    with start(Config.model_validate({**config.model_dump(exclude={"switches"}), "switches": switches})) as camera:
        amcrest = AmcrestCamera("127.0.0.1", camera.port, "ros", "secret123", retries_connection=0).camera
        camera.server.device.tables.write([("MotionDetect[0].EventHandler.Dejitter", "0")])
        assert amcrest.is_motion_detected == []
        heard = []
        with closing(amcrest.event_actions("VideoMotion", timeout_cmd=(5.0, 20.0))) as events, _stirred(camera):
            for code, event in events:
                assert code == "VideoMotion"
                heard.append(event)
                if event["action"] == "Stop":
                    break
    assert [event["action"] for event in heard] == MOTION
    assert heard[0].get("data") == ({"SmartMotionEnable": False} if form == "A" else None)


def test_it_receives_the_microphones_tone(amcrest: AmcrestCamera, door: httpx.Client) -> None:
    door.post("/tone", json={"hertz": 700})
    assert amcrest.audio_input_channels_numbers == "result=1\r\n"
    with closing(amcrest.audio_stream_capture(httptype="singlepart", channel=1)) as stream:
        samples = decode(stream.read(RATE))
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(len(samples))))
    assert np.fft.rfftfreq(len(samples), 1 / RATE)[np.argmax(spectrum)] == pytest.approx(700, abs=2)
