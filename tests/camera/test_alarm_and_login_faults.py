"""Faults on the real service, seen by the motion alarm and the login gate; `test_faults.py` has the rest of them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from services.bus import Message
from services.simulators import camera as simulated
from services.simulators.camera.firmwares import PROFILES
from tests.camera.bench import Bench, bench, simulator

NOTICED_S = 15.0
WELL_S = 40.0
ORDERS = 10
COMMANDS = (  # of an order Flip, and of an order Move
    "action=setConfig&VideoInOptions", "action=getConfig&name=VideoInOptions",
    "ptz.cgi?action=start", "ptz.cgi?action=stop",
)  # fmt: skip
QUICK = {"motion": {"heartbeat_s": 1}, "login_retry_s": 3.0}


@pytest.fixture
def camera() -> Iterator[simulated.Simulated]:
    with simulator(latency_s=0.02) as running:
        yield running


@pytest.fixture
def here(tmp_path: Path, camera: simulated.Simulated) -> Iterator[Bench]:
    with bench(tmp_path, camera, **QUICK) as running:
        running.until(lambda: running.service.motion.fact == "attached" and motion(running) == 0, 10)
        running.until(lambda: watched(running), 60)
        yield running


def state(here: Bench) -> str:
    return str(here.payloads("status")[-1]["state"])


def motion(here: Bench) -> int:
    return int(here.payloads("motion")[-1]["value"])


def door(here: Bench) -> dict[str, int]:
    counters: dict[str, int] = here.truth()["door"]
    return counters


def log(here: Bench) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = httpx.get(f"{here.camera.side_door_url}/log", timeout=30).json()
    return entries


def watched(here: Bench) -> bool:
    """Whether the watchdog has logged in: only its first request asks without a login what the motors do."""
    asked = [(entry["authorized"], entry["status"]) for entry in log(here) if "getStatus" in entry["target"]]
    first = asked.index((False, 401)) if (False, 401) in asked else len(asked)
    return asked[first:].count((True, 200)) >= 2  # its own, and the service's of every second


def for_a_while(here: Bench, seconds: float) -> None:
    end = time.monotonic() + seconds
    here.until(lambda: time.monotonic() >= end, seconds + 5)


@pytest.mark.parametrize(
    ("fault", "told"),
    [("hang", "offline"), ("password", "bad_login"), ("locked", "locked")],
)
def test_a_fault_shows_in_the_status_and_in_the_alarm_and_heals_without_a_restart(
    here: Bench, fault: str, told: str
) -> None:
    here.tell("fault", name=fault)
    here.tell("drop")
    here.until(lambda: state(here) == told, NOTICED_S)
    here.until(lambda: motion(here) == -1, NOTICED_S)
    here.tell("well")
    here.until(lambda: state(here) == "online" and motion(here) == 0, WELL_S)


@pytest.mark.parametrize("switches", [{}, {"nonce": "flaky", "stale": False}], ids=["reusable", "flaky"])
def test_after_a_password_change_three_logins_fail_at_most_over_everything_together(
    tmp_path: Path, switches: dict[str, object]
) -> None:
    """Also when old nonces are refused as if the password were wrong, just before."""
    with (
        simulator(latency_s=0.02, switches=switches) as camera,
        bench(tmp_path, camera, motion={"heartbeat_s": 1}) as here,
    ):
        here.until(lambda: here.service.motion.fact == "attached", 10)
        here.until(lambda: watched(here), 60)
        refused = door(here)["stale"]
        for number in range(200 if switches else 0):
            here.order("Flip", "True", str(number))
            assert here.end_of(str(number), 10)["state"] == "done"
            if door(here)["stale"] > refused:
                break
        here.inbox.put(snapshot())
        here.tell("fault", name="password")
        here.tell("drop")
        here.inbox.put(snapshot())
        here.until(lambda: state(here) == "bad_login", NOTICED_S)
        for_a_while(here, 5.0)
        assert 1 <= door(here)["wrong"] <= 3
        assert state(here) == "bad_login"


def snapshot() -> Message:
    return Message("camera/ip1/snapshot/get", b"", received=time.time())


def test_a_silent_event_stream_is_noticed_although_the_camera_is_well(here: Bench) -> None:
    here.tell("fault", name="silent_events")
    here.until(lambda: motion(here) == -1, NOTICED_S)
    assert state(here) == "online"
    here.tell("well")
    here.until(lambda: motion(here) == 0, NOTICED_S)


def test_firmware_without_heartbeat_keeps_one_event_stream_however_long_nothing_happens(tmp_path: Path) -> None:
    with simulator(latency_s=0.02, switches={"heartbeat": False}) as camera, bench(tmp_path, camera, **QUICK) as here:
        here.until(lambda: "no heartbeat" in here.service.motion.fact, NOTICED_S)
        for_a_while(here, NOTICED_S)
        assert sum("attach" in entry["target"] and entry["status"] == 200 for entry in log(here)) == 2
        here.tell("event", code="VideoMotion", action="Start")
        here.until(lambda: motion(here) == 1, 2)
        here.tell("event", code="VideoMotion", action="Stop")
        here.tell("fault", name="hang")
        here.tell("drop")
        here.until(lambda: motion(here) == -1, NOTICED_S)
        here.tell("well")
        here.until(lambda: motion(here) == 0, WELL_S)


def test_a_heartbeat_that_came_late_is_relied_on_like_any(tmp_path: Path, camera: simulated.Simulated) -> None:
    camera.server.faults.silent_events = True
    with bench(tmp_path, camera, **QUICK) as here:
        here.until(lambda: "no heartbeat" in here.service.motion.fact, NOTICED_S)
        here.tell("well")
        here.until(lambda: here.service.motion.fact == "attached", NOTICED_S)
        here.tell("fault", name="silent_events")
        here.until(lambda: motion(here) == -1, NOTICED_S)


def test_a_camera_that_beats_more_slowly_than_asked_is_well_and_asked_whether_it_still_is(tmp_path: Path) -> None:
    with (
        simulator(latency_s=0.02, switches={"heartbeat_least_s": 4}) as camera,
        bench(tmp_path, camera, **QUICK) as here,
    ):
        here.until(lambda: "slow one" in here.service.motion.fact, NOTICED_S)
        for_a_while(here, NOTICED_S)
        assert {one["value"] for one in here.payloads("motion")} == {0}
        assert sum("attach" in entry["target"] and entry["status"] == 200 for entry in log(here)) == 2
        here.tell("event", code="VideoMotion", action="Start")
        here.until(lambda: motion(here) == 1, 2)
        here.tell("event", code="VideoMotion", action="Stop")
        here.tell("fault", name="hang")
        here.until(lambda: motion(here) == -1, NOTICED_S)
        here.tell("well")
        here.until(lambda: motion(here) == 0, WELL_S)


def test_a_slow_camera_stays_usable_and_its_latency_is_told(here: Bench) -> None:
    here.tell("fault", name="slow", seconds=1.0)
    for_a_while(here, 6.0)
    assert state(here) == "online"
    assert here.service.health.latency > 0.3
    here.order("Flip", "True", "1")
    assert here.end_of("1", 20)["state"] == "done"


def test_a_clock_that_is_wrong_is_set(tmp_path: Path, camera: simulated.Simulated) -> None:
    httpx.post(f"{camera.side_door_url}/fault", json={"name": "clock", "seconds": 3600}, timeout=30).raise_for_status()
    with bench(tmp_path, camera) as here:
        here.until(lambda: "time_drift_s" in here.service.bulletin.facts.values, 15)
        written = [entry["target"] for entry in log(here) if "setCurrentTime" in entry["target"]]
        assert len(written) == 1
        assert "%20" in written[0]


def settings_of_the_clock(here: Bench) -> int:
    return sum("setCurrentTime" in entry["target"] and entry["status"] == 200 for entry in log(here))


@pytest.mark.parametrize("offset_s", [-500.0, 86400.0])
def test_a_clock_that_is_moved_while_the_service_runs_is_set(
    tmp_path: Path, camera: simulated.Simulated, offset_s: float
) -> None:
    with bench(tmp_path, camera, clock={"every_s": 2.0}) as here:
        here.until(lambda: "time_drift_s" in here.service.bulletin.facts.values, 15)
        assert settings_of_the_clock(here) == 0
        here.tell("clock", offset_s=offset_s)
        here.until(lambda: abs(camera.server.device.clock.offset(time.time())) < 1.5, 15)
        assert settings_of_the_clock(here) == 1


def test_a_clock_that_runs_too_fast_is_set_again_and_again(tmp_path: Path, camera: simulated.Simulated) -> None:
    off = [0.0]
    with bench(tmp_path, camera, clock={"every_s": 1.0, "drift_s": 2.0}) as here:
        here.until(lambda: "time_drift_s" in here.service.bulletin.facts.values, 15)
        here.tell("clock", drift_ppm=500_000.0)  # half a second each second
        began = time.monotonic()

        def set_often() -> bool:
            off.append(abs(camera.server.device.clock.offset(time.time())))
            return settings_of_the_clock(here) >= 3

        here.until(set_often, 60)
        drifted = 0.5 * (time.monotonic() - began)
        assert 2.0 < max(off) < 6.0
        assert drifted > 1.2 * max(off), "so far it would have gone"


def test_an_idle_camera_that_wants_two_requests_for_each_is_asked_at_most_twice_a_second(tmp_path: Path) -> None:
    with simulator(profile="2020s-dahua", latency_s=0.02) as camera, bench(tmp_path, camera) as here:
        for_a_while(here, 5.0)
        before = len(log(here))
        for_a_while(here, 12.0)
        assert len(log(here)) - before <= 2 * 12


@pytest.mark.parametrize("profile", [name for name, one in PROFILES.items() if one.nonce == "reusable"])
def test_a_command_takes_at_most_one_request_and_a_tenth_where_nonces_are_reusable(
    tmp_path: Path, profile: str
) -> None:
    """Every order sends each of its commands once; what polls cost is not counted, but their refusals are."""
    with simulator(profile=profile, latency_s=0.02) as camera, bench(tmp_path, camera, **QUICK) as here:
        for_a_while(here, 2.0)
        before = len(log(here))
        for number in range(ORDERS):
            here.order("Flip", str(number % 2 == 0), f"flip {number}")
            here.order("Move", "Left 3 0.1", f"move {number}")
            for name in ("flip", "move"):
                assert here.end_of(f"{name} {number}", 10)["state"] == "done"
        entries = log(here)[before:]
        caused = {what: sum(what in entry["target"] for entry in entries) for what in COMMANDS}
        assert all(ORDERS <= count <= 1.1 * ORDERS for count in caused.values()), caused
        assert sum(entry["status"] == 401 for entry in entries) <= 0.1 * ORDERS
