"""A camera that restarts by itself is told from one that was only away, in virtual time."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import pytest

from services.camera.device import Away
from services.payloads import seconds as seconds_of
from tests.camera.flat import Flat


def away(flat: Flat, seconds: float, *, turned_away: bool, remembers: bool | None) -> None:
    """Nobody is answered for so long."""
    error = Away("no answer")
    error.turned_away = turned_away
    flat.camera.away = error
    flat.run(seconds)
    flat.camera.away, flat.camera.remembers = None, remembers
    flat.run(20)
    flat.camera.remembers = None


def rebooted(flat: Flat) -> str | None:
    """What the diagnostics say of it."""
    said = [json.loads(one.payload) for one in flat.said if one.topic.startswith("diagnostics/")]
    found: str | None = said[-1]["values"].get("rebooted")
    return found


@pytest.mark.parametrize(
    ("seconds", "turned_away", "remembers", "restarted"),
    [
        (45.0, True, False, True),
        (45.0, False, False, True),  # its network comes up last: nobody is turned away
        (45.0, True, None, True),  # firmware that takes a nonce once: only the time tells
        (8.0, True, None, False),
        (45.0, False, None, False),  # a network that was cut
        (45.0, True, True, False),  # it hung, and closed every connection
    ],
)
def test_a_restart_is_told_by_its_signs(
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    seconds: float,
    turned_away: bool,
    remembers: bool | None,
    restarted: bool,
) -> None:
    flat = Flat(tmp_path, places=Path()).online()
    began = flat.now
    caplog.set_level(logging.INFO)
    away(flat, seconds, turned_away=turned_away, remembers=remembers)
    flat.run(30)
    assert flat.service.health.online
    assert sum("restarted" in record.getMessage() for record in caplog.records) == restarted
    told = rebooted(flat)
    assert (told is not None) == restarted
    if told is not None:
        assert began + seconds < seconds_of(told) < began + seconds + 15
    away(flat, 45.0, turned_away=False, remembers=True)
    assert rebooted(flat) == told


def test_a_camera_that_was_switched_on_after_the_service_has_not_restarted(tmp_path: Path) -> None:
    flat = Flat(tmp_path, places=Path())
    away(flat, 60.0, turned_away=True, remembers=None)
    assert flat.service.health.online
    assert rebooted(flat) is None


def test_an_ordered_restart_is_told_too(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    flat = Flat(tmp_path, places=Path()).online()
    caplog.set_level(logging.INFO)
    flat.order("Reboot", "True")
    flat.run(1)
    away(flat, 45.0, turned_away=False, remembers=None)
    assert flat.last()["state"] == "done"
    assert rebooted(flat) is not None
    assert [record.levelname for record in caplog.records if "as ordered" in record.getMessage()] == ["INFO"]


def test_a_camera_that_restarts_in_a_move_is_met_anew(tmp_path: Path) -> None:
    flat = Flat(tmp_path, places=Path()).online()
    met = flat.camera.met
    flat.order("Move", "Left 2 20")
    flat.until(flat.started)
    away(flat, 45.0, turned_away=True, remembers=False)
    flat.run(20)
    assert flat.last()["state"] == "failed"
    assert flat.camera.met == met + 1
    assert rebooted(flat) is not None
