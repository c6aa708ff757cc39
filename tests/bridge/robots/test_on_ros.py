"""A robot on a real ROS master: it drives and sees for the bus, and never without its commander."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from math import hypot
from typing import Any

import pytest

from services.peers import end, ros, wait_until
from services.simulators.world import load
from tests.bridge.conftest import PATIENCE_S, ROOT, BridgeProcess
from tests.bridge.robots.foreign_process import POI
from tests.bridge.test_ros import publishers, subscribers

pytestmark = pytest.mark.ros
ROBOT = {"kind": "tiago", "places": "tiago/robot_places.yaml", "markers": {"sizes": {17: 0.10, 100: 0.12}}}
RESULT, POSE, SEEN = (f"robot/tiago/{name}" for name in ("goto/result", "pose", "seen"))
Run = Callable[..., BridgeProcess]


@contextmanager
def program(master: ros.Master, module: str) -> Iterator[subprocess.Popen[str]]:
    """A program of ours in the graph."""
    pipe = subprocess.PIPE
    with subprocess.Popen(
        [sys.executable, "-m", module], env={**os.environ, **master.env}, cwd=ROOT, stdin=pipe, stdout=pipe, text=True
    ) as process:
        try:
            yield process
        finally:
            end(process)


@pytest.fixture
def flat(master: ros.Master, run_bridge: Run) -> Iterator[tuple[ros.Master, Run, BridgeProcess]]:
    """The simulated robot, and a bridge that speaks for it."""
    with program(master, "tests.bridge.robots.robot_process"):
        wait_until(lambda: publishers(master, "/move_base/status") != [], "the robot", PATIENCE_S)
        bridge = run_bridge(master.env, {}, robots={"tiago": ROBOT}, cameras=[], state=str(master.folder))
        bridge.says(POSE, lambda _: True)
        yield master, run_bridge, bridge


def go(bridge: BridgeProcess, goal: str, **to: Any) -> None:
    """An order of the bus."""
    bridge.hears("robot/tiago/goto", json.dumps({"id": goal, **to}))


def told(bridge: BridgeProcess, goal: str, *states: str) -> str:
    """Waits for one of these ends of a goal; its reason."""

    def holds(text: str) -> bool:
        return json.loads(text)["id"] == goal and json.loads(text)["state"] in states

    bridge.says(RESULT, holds)
    ends = [json.loads(text) for _, topic, text in bridge.said if topic == RESULT]
    return str(next(one["reason"] for one in ends if one["id"] == goal and one["state"] in states))


def newest(bridge: BridgeProcess) -> tuple[float, float]:
    """Where the robot is."""
    text = next(text for _, topic, text in reversed(bridge.said) if topic == POSE)
    return json.loads(text)["x"], json.loads(text)["y"]


def drives(bridge: BridgeProcess) -> None:
    """Waits until it is on its way."""
    x, y = newest(bridge)
    bridge.says(POSE, lambda text: hypot(json.loads(text)["x"] - x, json.loads(text)["y"] - y) > 0.1, len(bridge.said))


def stands(bridge: BridgeProcess) -> None:
    """Waits until it has said the same place for a second."""

    def same() -> bool:
        since = time.monotonic() - 1.0
        poses = [text for at, topic, text in list(bridge.said) if topic == POSE and at >= since]
        return len(poses) >= 3 and len({(json.loads(text)["x"], json.loads(text)["y"]) for text in poses}) == 1

    wait_until(same, "the robot to stand", PATIENCE_S)


@contextmanager
def ended(master: ros.Master) -> Iterator[Callable[[], str]]:
    """What move_base says at the end of the goal under way: waits for the status of its result."""
    echo = ("rostopic", "echo", "-n", "1", "-p", "/move_base/result/status/status")
    pipe = subprocess.PIPE
    with subprocess.Popen(echo, env={**os.environ, **master.env}, stdout=pipe, text=True) as process:
        try:
            wait_until(lambda: len(subscribers(master, "/move_base/result")) == 2, "the echo", PATIENCE_S)
            yield lambda: process.communicate(timeout=PATIENCE_S)[0].split()[-1].split(",")[-1]
        finally:
            end(process)


def test_it_drives_looks_and_says_what_became_of_it(flat: Any) -> None:
    _, _, bridge = flat
    go(bridge, "one", x=4.2, y=3.0, yaw_deg=93.0)
    told(bridge, "one", "accepted")
    assert told(bridge, "one", "arrived", "failed", "cancelled") == "Goal reached."
    bridge.says(POSE, lambda text: hypot(json.loads(text)["x"] - 4.2, json.loads(text)["y"] - 3.0) < 0.15)
    since = len(bridge.said)
    bridge.says(SEEN, lambda text: '"marker":582' in text, since)
    seen = next(text for _, topic, text in bridge.said[since:] if topic == SEEN and '"marker":582' in text)
    (marker,) = [one for one in json.loads(seen)["markers"] if one["marker"] == 582]
    world = load(ROOT / "config" / "world.yaml")
    truth = world.map.apartment_to_map.transform.apply(world.marker(582).pose.translation)
    error = [marker["position"][axis] - truth[index] for index, axis in enumerate("xyz")]
    assert hypot(*error) < 0.15, "within what its belief of its own place allows"

    go(bridge, "walled", x=-5.0, y=-5.0)
    assert "valid plan" in told(bridge, "walled", "failed")


def test_a_cancel_and_the_death_of_the_bridge_stop_it_and_a_new_one_tells_of_the_goal(flat: Any) -> None:
    master, run_bridge, bridge = flat
    go(bridge, "far", point="Bedroom")
    drives(bridge)
    bridge.hears("robot/tiago/cancel", json.dumps({"id": "far"}))
    told(bridge, "far", "cancelled")
    stands(bridge)

    with ended(master) as result:
        go(bridge, "farther", point="Kitchen")
        drives(bridge)
        os.kill(bridge.process.pid, signal.SIGKILL)
        assert result() == "2", "preempted, although there is no bridge any more"
    again = {"robots": {"tiago": ROBOT}, "cameras": [], "state": str(master.folder), "log": "after.log"}
    after = run_bridge(master.env, {}, **again)
    after.says(POSE, lambda _: True)
    told(after, "farther", "cancelled")
    stands(after)
    go(after, "again", point="Hall")
    told(after, "again", "arrived")


def test_after_a_new_master_it_goes_on_and_so_does_a_new_bridge(flat: Any) -> None:
    master, run_bridge, bridge = flat
    go(bridge, "during", point="Bedroom")
    drives(bridge)
    master.kill()
    master.start()
    told(bridge, "during", "arrived")
    wait_until(lambda: publishers(master, "/move_base/goal") == ["/iot_bridge"], "the bridge", PATIENCE_S)
    wait_until(lambda: publishers(master, "/move_base/status") == ["/simulated_robot"], "the robot", PATIENCE_S)
    bridge.end()
    after = run_bridge(master.env, {}, robots={"tiago": ROBOT}, cameras=[], log="after.log")
    after.says(POSE, lambda _: True)
    go(after, "later", point="Window")
    told(after, "later", "accepted")
    drives(after)


def test_points_and_markers_of_packages_that_are_not_installed(master: ros.Master, run_bridge: Run) -> None:
    robot = {"kind": "tiago", "poi": POI, "fiducials": "/fiducial_transforms", "amcl_pose": None}
    with ExitStack() as stack:
        foreign = stack.enter_context(program(master, "tests.bridge.robots.foreign_process"))
        bridge = run_bridge(master.env, {}, robots={"tiago": robot}, cameras=[])
        bridge.says(POSE, lambda text: json.loads(text)["x"] == 1.0 and json.loads(text)["y"] == 2.0)
        bridge.says(SEEN, lambda text: json.loads(text)["markers"] == [
            {"marker": 582, "position": {"x": 3.0, "y": 1.5, "z": 1.0}, "distance": 2.062}])  # fmt: skip
        wait_until(lambda: publishers(master, f"{POI}/goal") == ["/iot_bridge"], "the bridge", PATIENCE_S)
        go(bridge, "home", point="Living room")
        assert told(bridge, "home", "arrived") == "so it is"
        go(bridge, "away", point="Moon")
        assert told(bridge, "away", "failed") == "so it is"
        assert foreign.stdout is not None
        asked = [json.loads(foreign.stdout.readline())]
        assert asked == [{"goal": "apartment/tiago/home", "poi": "Living room"}]
