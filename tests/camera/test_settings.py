"""A camera's section of the configuration: what it gives where nothing is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from services.camera.settings import Config
from services.camera.web.dahua import BEATS
from services.errors import ConfigError
from tests.camera.flat import Flat


def settings(**values: Any) -> Config:
    return Config.model_validate({"url": "http://192.0.2.9", **values})


def test_the_low_profile_is_the_reports_for_a_small_computer() -> None:
    low, full = settings(profile="low"), settings()
    assert (low.diagnostics, low.alarm, low.frames) == (False, False, 1)
    assert (full.diagnostics, full.alarm, full.frames > 1) == (True, True, True)


def test_what_is_given_wins_over_the_profile() -> None:
    assert settings(profile="low", frames=3, alarm=True).model_dump(include={"frames", "alarm", "diagnostics"}) == {
        "frames": 3,
        "alarm": True,
        "diagnostics": False,
    }


@pytest.mark.parametrize("heartbeat_s", [0, 5, 60, -3, 2.5])
def test_a_heartbeat_with_which_silence_is_noticed_too_late_is_refused(heartbeat_s: float) -> None:
    with pytest.raises(ValidationError, match=r"heartbeat_s\n +Input should be 1, 2, 3 or 4"):
        settings(motion={"heartbeat_s": heartbeat_s})
    assert BEATS * settings(motion={"heartbeat_s": 4}).motion.heartbeat_s < 15.0


@pytest.mark.parametrize("codes", [["All"], ["all"], ["VideoMotion", "All"], ["[All]"], ["VideoMotion,AlarmLocal"], []])
def test_codes_that_would_never_be_told_as_motion_are_refused(codes: list[str]) -> None:
    with pytest.raises(ValidationError, match=r"codes\n.*expected names of what is motion, such as VideoMotion, got "):
        settings(motion={"codes": codes})
    named = ("VideoMotion", "SmartMotionHuman")
    assert settings(motion={"codes": list(named)}).motion.codes == named


@pytest.mark.parametrize("profile", ["lower", ["low"], 1, None])
def test_another_profile_is_a_fault(profile: object) -> None:
    with pytest.raises(ValidationError, match="profile"):
        settings(profile=profile)


def test_in_the_low_profile_no_diagnostics_are_said_and_everything_else_is(tmp_path: Path) -> None:
    flat = Flat(tmp_path, profile="low").online()
    topics = {message.topic for message in flat.said}
    assert not [topic for topic in topics if topic.startswith("diagnostics/")]
    assert {"camera/ip1/status", "camera/ip1/position"} <= topics


REPORT = """
ip_camera:
  ip_address: 192.0.2.9
  port: 8080
  username: ros
  rtsp_port: 5540
  publish-rate: 10
  camera_info_url: file:///etc/ros/ost.yaml
aruco:
  dictionary: 7
  marker_size: 0.14
  target_id: 582
  images: 8
  delay: 4.0
  turns: 2
  order: Kitchen, Sofa
diagnostics: False
alarm: false
flip: true
"""


def written(folder: Path, text: str) -> Path:
    (folder / "parameters.yaml").write_text(text)
    return folder


def test_a_nodes_parameters_stand_for_what_is_not_given(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    read = Config(name="ip1", folder=written(tmp_path, REPORT), parameters=Path("parameters.yaml"))  # type: ignore[call-arg]
    assert (read.url, read.rtsp_port, read.user) == ("http://192.0.2.9:8080", 5540, "ros")
    assert (read.dictionary, read.markers.size, read.targets) == ("DICT_5X5_1000", 0.14, (582,))
    assert (read.frames, read.settle_s, read.second_turn, read.routine) == (8, 4.0, "always", ("Kitchen", "Sofa"))
    assert (read.diagnostics, read.alarm, read.picture.flip) == (False, False, True)
    assert read.camera_info == Path("/etc/ros/ost.yaml")
    assert [record.getMessage() for record in caplog.records] == [
        f"{tmp_path}/parameters.yaml:7: publish-rate: not known, left out"
    ]


def test_what_is_given_wins_over_the_nodes_parameters(tmp_path: Path) -> None:
    given = {"url": "http://192.0.2.77", "frames": 2, "markers": {"sizes": {17: 0.1}}, "profile": "low"}
    read = Config.model_validate({**given, "folder": written(tmp_path, REPORT), "parameters": "parameters.yaml"})
    assert (read.url, read.frames, read.markers.size, read.markers.sizes) == ("http://192.0.2.77", 2, 0.14, {17: 0.1})


def test_a_parameter_that_cannot_be_used_is_told_with_its_line(tmp_path: Path) -> None:
    written(tmp_path, "user: ros\nimages: many\n")
    with pytest.raises(ConfigError, match=r"parameters.yaml:2: images: expected a value for frames, got 'many'"):
        settings(folder=tmp_path, parameters="parameters.yaml")
