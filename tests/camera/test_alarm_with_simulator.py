"""The motion alarm over real HTTP: events arrive, silence and breaks are noticed, and all is well again by itself."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from services.simulators import camera as simulated
from tests.camera.bench import Bench, bench, simulator

QUICK = {"heartbeat_s": 1, "hold_s": 1.0}


@pytest.fixture
def camera() -> Iterator[simulated.Simulated]:
    with simulator(latency_s=0.02) as running:
        yield running


@pytest.fixture
def here(tmp_path: Path, camera: simulated.Simulated) -> Iterator[Bench]:
    with bench(tmp_path, camera, motion=QUICK) as running:
        running.until(lambda: running.payloads("motion") != [], 10)
        yield running


def value(here: Bench) -> int:
    found: int = here.payloads("motion")[-1]["value"]
    return found


def test_motion_is_told_and_ends(here: Bench) -> None:
    assert value(here) == 0
    here.tell("event", code="VideoMotion", action="Start")
    here.until(lambda: value(here) == 1, 3)
    here.tell("event", code="VideoMotion", action="Stop")
    here.until(lambda: value(here) == 0, 5)


def test_motion_that_goes_on_when_the_service_comes_is_seen(tmp_path: Path, camera: simulated.Simulated) -> None:
    camera.server.device.events.tell("VideoMotion", "Start")
    with bench(tmp_path, camera, motion=QUICK) as here:
        here.until(lambda: [one["value"] for one in here.payloads("motion")] == [1], 5)


def test_motion_is_told_by_firmware_that_wants_brackets_encoded(tmp_path: Path) -> None:
    with (
        simulator(latency_s=0.02, switches={"brackets": "encoded"}) as camera,
        bench(tmp_path, camera, motion=QUICK) as here,
    ):
        here.until(lambda: here.service.motion.fact == "attached", 10)
        here.tell("event", code="VideoMotion", action="Start")
        here.until(lambda: value(here) == 1, 3)


def test_a_broken_connection_is_made_again_and_what_was_missed_is_asked_for(here: Bench) -> None:
    here.tell("drop")
    here.until(lambda: here.service.motion.reconnects == 1, 5)
    here.tell("event", code="VideoMotion", action="Start")
    here.until(lambda: value(here) == 1, 10)


def test_a_camera_that_hangs_is_noticed_and_comes_back_by_itself(here: Bench) -> None:
    here.until(lambda: here.service.motion.fact == "attached", 5)
    here.tell("freeze", on=True)
    here.until(lambda: value(here) == -1, 10)
    here.tell("freeze", on=False)
    here.until(lambda: value(here) == 0, 30)
    here.tell("event", code="VideoMotion", action="Start")
    here.until(lambda: value(here) == 1, 5)


def test_who_walks_in_while_the_camera_turns_and_goes_on_moving_is_told_after_it(here: Bench) -> None:
    here.look("1", pan=100.0, tilt=20.0)
    here.until(lambda: here.truth()["moving"], 10)
    here.tell("stir", seconds=60)
    assert here.end_of("1", 30)["state"] == "done"
    assert value(here) == 0
    here.until(lambda: value(here) == 1, 15)


def test_turns_in_an_empty_flat_are_no_motion_afterwards_either(here: Bench) -> None:
    for number, pan in enumerate((100.0, 220.0)):
        here.look(str(number), pan=pan, tilt=20.0)
        assert here.end_of(str(number), 30)["state"] == "done"
    end = time.monotonic() + 12.0
    here.until(lambda: time.monotonic() > end, 20)
    assert {one["value"] for one in here.payloads("motion")} == {0}
    assert here.service.motion.masked >= 1


def test_the_end_does_not_wait_for_the_camera(tmp_path: Path, camera: simulated.Simulated) -> None:
    with bench(tmp_path, camera) as here:
        here.until(lambda: "attached" in here.service.motion.fact, 5)
    assert not any("events" in thread.name for thread in threading.enumerate())
