"""A camera's section of the configuration: what it gives where nothing is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from services.camera.settings import Config
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


@pytest.mark.parametrize("profile", ["lower", ["low"], 1, None])
def test_another_profile_is_a_fault(profile: object) -> None:
    with pytest.raises(ValidationError, match="profile"):
        settings(profile=profile)


def test_in_the_low_profile_no_diagnostics_are_said_and_everything_else_is(tmp_path: Path) -> None:
    flat = Flat(tmp_path, profile="low").online()
    topics = {message.topic for message in flat.said}
    assert not [topic for topic in topics if topic.startswith("diagnostics/")]
    assert {"camera/ip1/status", "camera/ip1/position"} <= topics
