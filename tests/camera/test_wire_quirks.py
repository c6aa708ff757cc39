"""What firmware and networks do to events, status and stops, and that the service lives with it, over real HTTP."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.camera.bench import Bench, bench, simulator

REGION = {"Id": [0], "RegionName": ["Region1"], "SmartMotionEnable": True}
QUIRKS: list[dict[str, Any]] = [
    {"event_length_off": 2},
    {"event_length_off": 400},
    {"event_length_off": -12},
    {"event_form": "A", "event_length_off": -12},
    {"event_line_before": True},
    {"event_form": "A", "event_line_before": True, "event_length_off": 2},
    {"event_writes": "pieces"},
    {"event_form": "A", "event_writes": "pieces", "event_header_twice": True},
    {"event_writes": "gathered"},
]


def stops(here: Bench) -> list[str]:
    """The targets of the stops that the camera has met and answered well."""
    entries: list[dict[str, Any]] = httpx.get(f"{here.camera.side_door_url}/log", timeout=30).json()
    return [one["target"] for one in entries if "action=stop" in one["target"] and one["status"] == 200]


def lost(here: Bench) -> int:
    """How many of the stops that are to be lost were not yet."""
    return here.camera.server.device.ptz.loses_stops


@pytest.mark.parametrize("switches", QUIRKS, ids=str)
def test_motion_is_told_however_the_event_is_written(tmp_path: Path, switches: dict[str, Any]) -> None:
    with (
        simulator(latency_s=0.02, switches=switches) as camera,
        bench(tmp_path, camera, motion={"heartbeat_s": 1, "hold_s": 1.0}) as here,
    ):
        here.until(lambda: here.service.motion.fact == "attached", 10)
        for action, value in (("Start", 1), ("Stop", 0)):
            here.tell("event", code="VideoMotion", action=action, data=REGION)
            here.until(lambda value=value: here.payloads("motion")[-1]["value"] == value, 5)
        assert here.service.motion.reconnects == 0


def test_events_that_come_at_once_are_all_heard(tmp_path: Path) -> None:
    with (
        simulator(latency_s=0.02, switches={"event_form": "A", "event_writes": "gathered"}) as camera,
        bench(tmp_path, camera, motion={"heartbeat_s": 1, "hold_s": 1.0}) as here,
    ):
        here.until(lambda: here.service.motion.fact == "attached", 10)
        for action in ("Start", "Stop", "Start"):
            camera.server.device.events.tell("VideoMotion", action, data=REGION)
        here.until(lambda: here.payloads("motion")[-1]["value"] == 1, 5)
        camera.server.device.events.tell("VideoMotion", "Stop", data=REGION)
        here.until(lambda: here.payloads("motion")[-1]["value"] == 0, 5)


def test_goals_are_reached_where_the_status_never_tells_of_motion(tmp_path: Path) -> None:
    with simulator(switches={"move_status": "unknown"}) as camera, bench(tmp_path, camera) as here:
        for number, (pan, tilt) in enumerate([(60.0, 30.0), (300.0, 5.0)]):
            here.look(str(number), pan=pan, tilt=tilt)
            end, truth = here.end_of(str(number), 60), here.truth()
            assert (end["state"], truth["moving"]) == ("done", False), end
            assert truth["pose"]["pan"] == pytest.approx(pan, abs=0.5)
            assert truth["pose"]["tilt"] == pytest.approx(tilt, abs=0.5)


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("how", ["stop", "end"])
def test_a_stop_without_effect_is_noticed_and_sent_again(tmp_path: Path, count: int, how: str) -> None:
    with simulator(latency_s=0.1) as camera, bench(tmp_path, camera) as here:
        here.tell("fault", name="lost_stop", n=count)
        here.order("Move", "Left 2 20" if how == "stop" else "Left 2 1", "1")
        here.until(lambda: here.truth()["moving"], 10)
        before = len(stops(here))
        if how == "stop":
            here.order("Move", "stop", "2")
        here.until(lambda: lost(here) == 0 and not here.truth()["moving"], 15)
        assert len(stops(here)) - before > count
        end = here.end_of("2" if how == "stop" else "1", 10)
        assert (end["state"], end["position"]["moving"], here.truth()["moving"]) == ("done", False, False)


def test_a_goal_is_reached_although_its_stops_are_lost(tmp_path: Path) -> None:
    with simulator(latency_s=0.1) as camera, bench(tmp_path, camera) as here:
        here.tell("fault", name="lost_stop", n=2)
        here.look("1", pan=60.0, tilt=35.0)
        end = here.end_of("1", 60)
        assert lost(here) == 0
        assert (end["state"], here.truth()["moving"]) == ("done", False), end
        assert here.truth()["pose"]["pan"] == pytest.approx(60.0, abs=0.5)
        motors = httpx.get(f"{camera.side_door_url}/motors", timeout=30).json()
        assert motors["pushed_s"]["pan"] == motors["pushed_s"]["tilt"] == 0.0, "no end stop ended it"


def test_a_stop_that_is_lost_when_the_service_ends_is_sent_again(tmp_path: Path) -> None:
    with simulator(latency_s=0.1) as camera:
        with bench(tmp_path, camera) as here:
            here.order("Move", "Left 2 20", "1")
            here.until(lambda: here.truth()["moving"], 10)
            here.tell("fault", name="lost_stop", n=1)
        assert (lost(here), here.truth()["moving"]) == (0, False)
