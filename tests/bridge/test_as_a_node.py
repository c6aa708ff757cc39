"""The bridge as a citizen of ROS: its name and remappings, simulated time, an address that others can reach."""

from __future__ import annotations

import json
import os
import subprocess
import xmlrpc.client
from collections.abc import Callable
from pathlib import Path

import pytest

from services.bridge import arguments, reach
from services.peers import end, ros, wait_until
from tests.bridge.conftest import PATIENCE_S, BridgeProcess
from tests.bridge.test_pictures import listening
from tests.bridge.test_ros import LAMP, publishers

Run = Callable[..., BridgeProcess]
SHIPPED = Path(__file__).parents[2] / "config" / "bridge.yaml"
POSE = """
  - direction: to_ros
    mqtt: lab/{bench}/pose
    ros: lab/pose
    type: geometry_msgs/PoseStamped
    fields:
      header: {stamp: "{payload.at}", frame_id: "{bench}"}
      pose: {position: "{payload.position}", orientation: {w: 1}}
"""
ELSEWHERE = "/elsewhere/pose=geometry_msgs/PoseStamped"
HEALTH = "/diagnostics=diagnostic_msgs/DiagnosticArray"
SIMULATED_S = 4242


def test_arguments_of_ros_are_not_ours() -> None:
    environment: dict[str, str] = {}
    ours = arguments.take(["serve", "bridge", "__name:=other", "--config", "x", "/a:=/b", "_c:=1"], environment)
    assert ours == ["serve", "bridge", "--config", "x"]
    assert arguments.given(environment) == ["__name:=other", "/a:=/b", "_c:=1"]
    assert arguments.take(["run"], {}) == ["run"]


def test_a_name_from_the_command_line_goes_before_the_configuration(monkeypatch: pytest.MonkeyPatch) -> None:
    assert arguments.name("iot_bridge") == "iot_bridge"
    monkeypatch.setenv(arguments.VARIABLE, '["__name:=other"]')
    assert arguments.name("iot_bridge") == "other"


@pytest.mark.parametrize(
    ("own", "master", "told"),
    [
        ("http://127.0.0.1:4000/", "http://127.0.0.1:11311", ""),
        ("http://localhost:4000/", "http://localhost:11311", ""),
        ("http://127.0.0.1:4000/", "http://192.0.2.77:11311", "the ROS master is on another computer"),
        ("http://192.0.2.77:4000/", "http://127.0.0.1:11311", "which is not this computer: set ROS_IP"),
        ("http://no.such.host.invalid:4000/", "http://127.0.0.1:11311", "a name without an address: set ROS_IP"),
    ],
)
def test_an_address_at_which_nobody_finds_us_is_told(own: str, master: str, told: str) -> None:
    advice = reach.advice(own, master)
    assert (told in advice) if told else advice == ""


@pytest.mark.ros
def test_a_type_of_the_rules_own_under_another_name_in_simulated_time(
    master: ros.Master, run_bridge: Run, tmp_path: Path
) -> None:
    (tmp_path / "bridge.yaml").write_text(SHIPPED.read_text(encoding="utf-8") + POSE)
    with xmlrpc.client.ServerProxy(master.uri) as proxy:
        proxy.setParam("/test", "/use_sim_time", True)
    given = {arguments.VARIABLE: json.dumps(["__name:=butler", "/lab/pose:=/elsewhere/pose"])}
    bridge = run_bridge({**master.env, **given}, LAMP, folder=str(tmp_path))
    bridge.registers(1)
    assert publishers(master, "/iot_updates") == ["/butler"]
    where = {"at": "2026-01-31T07:05:00.500Z", "position": {"x": 1.5, "y": -2}}
    with listening(
        master, ELSEWHERE, "/tf_static=tf2_msgs/TFMessage", "/diagnostics=diagnostic_msgs/DiagnosticArray"
    ) as ear:

        def arrives(stamped: Callable[[int], bool]) -> bool:
            bridge.hears("lab/bench/pose", json.dumps(where))
            return any(stamped(one["stamp"]) for one in ear.of(ELSEWHERE))

        wait_until(lambda: arrives(lambda stamp: stamp == 1769843100_500_000_000), "as it was said", PATIENCE_S)
        assert ear.of(ELSEWHERE)[0]["frame"] == "bench"
        clock = subprocess.Popen(
            ["rostopic", "pub", "-r", "10", "/clock", "rosgraph_msgs/Clock", f"{{clock: {{secs: {SIMULATED_S}}}}}"],
            env={**os.environ, **master.env}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            wait_until(lambda: any(SIMULATED_S <= one["stamp"] / 1e9 < SIMULATED_S + 100 for one in ear.of(HEALTH)),
                       "stamps of the simulated time", PATIENCE_S)  # fmt: skip
        finally:
            end(clock)
