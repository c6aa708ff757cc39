"""The bridge on a real ROS master, seen by the tools that everyone has: rostopic, and the master's own API."""

from __future__ import annotations

import os
import signal
import subprocess
import time
import xmlrpc.client
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from services.peers import free_port, ros, wait_until
from tests.bridge.conftest import PATIENCE_S, BridgeProcess

pytestmark = pytest.mark.ros
Run = Callable[..., BridgeProcess]
LAMP = {"Lamp": {"type": "Switch", "label": "Lamp"}, "Door": {"type": "Contact", "label": "Door"}}
NUMBERS = {f"Number_{index}": {"type": "Number", "label": "A number"} for index in range(200)}
KEY_VALUE = "diagnostic_msgs/KeyValue"


def rostopic(master: ros.Master, *arguments: str) -> str:
    """What `rostopic` prints."""
    done = subprocess.run(
        ["rostopic", *arguments], env={**os.environ, **master.env}, capture_output=True, text=True, timeout=PATIENCE_S,
        check=True,
    )  # fmt: skip
    return done.stdout


def pub(master: ros.Master, topic: str, kind: str, value: str) -> None:
    """Says it once, to whoever is there within 3 s (`-1`)."""
    rostopic(master, "pub", "-1", topic, kind, value)


def publishers(master: ros.Master, topic: str) -> list[str]:
    return _nodes(master, topic, 0)


def subscribers(master: ros.Master, topic: str) -> list[str]:
    return _nodes(master, topic, 1)


def _nodes(master: ros.Master, topic: str, side: int) -> list[str]:
    with xmlrpc.client.ServerProxy(master.uri) as proxy:
        state: Any = proxy.getSystemState("/test")
    return next((nodes for name, nodes in state[2][side] if name == topic), [])


def test_a_new_subscriber_gets_every_state_and_then_what_happens(master: ros.Master, run_bridge: Run) -> None:
    bridge = run_bridge(master.env, NUMBERS)
    for index, item in enumerate(NUMBERS):
        bridge.hears(f"home/{item}/state", str(index))
    bridge.registers(1)
    first = Echo(master, len(NUMBERS) + 1)
    second = Echo(master, len(NUMBERS) + 1)
    for echo in (first, second):
        echo.wait_for(len(NUMBERS))
        assert dict(echo.pairs()) == {item: str(index) for index, item in enumerate(NUMBERS)}
    bridge.hears("home/Number_0/state", "21.5")
    for echo in (first, second):
        assert echo.rest()[-1] == ("Number_0", "21.5")


SAYINGS = """
import sys, threading, rospy
from diagnostic_msgs.msg import KeyValue

class Greeting(rospy.SubscribeListener):
    def peer_subscribe(self, topic, say_to_all, say_to_it):
        say_to_it(KeyValue("Dimmer", "INCREASE"))
        greeted.set()

greeted = threading.Event()
latching = sys.argv[1] == "latching"
rospy.init_node("robot", anonymous=True)
robot = rospy.Publisher("/iot_command", KeyValue, Greeting(), latch=latching, queue_size=9)
greeted.wait(20.0)
while robot.impl.seq < 1 + latching:  # rospy says it again; from here on it holds its lock
    rospy.sleep(0.01)
for value in sys.argv[2:]:
    robot.publish(KeyValue("Dimmer", value))
rospy.sleep(1.0)
"""


@pytest.mark.parametrize(
    ("kind", "words", "commands"),
    [
        ("latching", ["ON"], ["INCREASE", "ON"]),
        ("latching", ["INCREASE", "INCREASE", "ON"], ["INCREASE", "INCREASE", "INCREASE", "ON"]),
        ("plain", ["INCREASE", "ON"], ["INCREASE", "INCREASE", "ON"]),
    ],
)
def test_the_first_word_that_rospy_says_twice_is_done_once(
    kind: str, words: list[str], commands: list[str], master: ros.Master, run_bridge: Run
) -> None:
    """Who speaks while it is being subscribed to, and latches, says that word twice by rospy's own doing."""
    bridge = run_bridge(master.env, {"Dimmer": {"type": "Dimmer", "label": "A light"}})
    bridge.registers(1)
    subprocess.run(
        ["/usr/bin/python3", "-c", SAYINGS, kind, *words], env={**os.environ, **master.env}, check=True,
        timeout=PATIENCE_S,
    )  # fmt: skip
    bridge.says("home/Dimmer/command", lambda text: text == "ON")
    assert [text for _, topic, text in bridge.said if topic == "home/Dimmer/command"] == commands


@pytest.mark.parametrize(
    ("name", "commands"),
    [("robot", ["OFF"]), ("rostopic_7_1600000000000", ["OFF"]), ("rostopic_7_{soon}", ["ON", "OFF"])],
)
def test_a_word_that_is_latched_since_before_the_bridge_was_there_is_done_only_when_it_is_young(
    name: str, commands: list[str], master: ros.Master, run_bridge: Run
) -> None:
    """`rostopic pub` without -1 says it again to every bridge that comes; a -1 may have come just before it."""
    own = name.format(soon=f"{1000 * (time.time() + 4.0):.0f}")  # as young as that for nine seconds
    word = ["rostopic", "pub", "/iot_command", KEY_VALUE, "{key: Lamp, value: 'ON'}", f"__name:={own}"]
    latching = subprocess.Popen(word, env={**os.environ, **master.env}, stdout=subprocess.DEVNULL)
    try:
        wait_until(lambda: publishers(master, "/iot_command") == [f"/{own}"], "its publisher", PATIENCE_S)
        bridge = run_bridge(master.env, LAMP)
        if commands == ["OFF"]:
            bridge.says("diagnostics/bridge", lambda text: "latched before the bridge was there" in text)
        else:
            bridge.says("home/Lamp/command", lambda text: text == "ON")
        pub(master, "/iot_command", KEY_VALUE, "{key: Lamp, value: 'OFF'}")
        bridge.says("home/Lamp/command", lambda text: text == "OFF")
        assert [text for _, topic, text in bridge.said if topic == "home/Lamp/command"] == commands
    finally:
        latching.terminate()
        latching.wait(PATIENCE_S)


def test_our_log_is_still_ours_when_the_node_is_up(master: ros.Master, run_bridge: Run) -> None:
    bridge = run_bridge(master.env, LAMP)
    bridge.registers(1)
    bridge.hears("home/Lamp/state", "BLUE")
    log = master.folder / "bridge.log"
    wait_until(lambda: "dropped: " in log.read_text(), "the line", PATIENCE_S)
    lines = log.read_text().splitlines()
    assert lines[0] == f"INFO service.py ROS up: {master.uri} pid {master.pid}"
    assert len(lines) == 2, "nothing of rospy's talk"


class Echo:
    """A `rostopic echo` of /iot_updates that ends after so many messages."""

    def __init__(self, master: ros.Master, messages: int) -> None:
        self._out = master.folder / f"echo-{time.monotonic_ns()}"
        with self._out.open("wb") as out:
            self._process = subprocess.Popen(
                ["rostopic", "echo", "-n", str(messages), "/iot_updates"],
                env={**os.environ, **master.env, "PYTHONUNBUFFERED": "1"}, stdout=out,
            )  # fmt: skip

    def pairs(self) -> list[tuple[str, str]]:
        texts = [line.split(": ", 1)[1].strip('"') for line in self._out.read_text().splitlines() if ": " in line]
        return list(zip(texts[::2], texts[1::2], strict=False))

    def wait_for(self, messages: int) -> None:
        wait_until(lambda: self._out.read_text().count("---") >= messages, f"{messages} messages", PATIENCE_S)

    def rest(self) -> list[tuple[str, str]]:
        assert self._process.wait(PATIENCE_S) == 0
        return self.pairs()


def test_what_a_robot_says_arrives_or_is_refused_with_the_reason(master: ros.Master, run_bridge: Run) -> None:
    bridge = run_bridge(master.env, LAMP)
    bridge.registers(1)
    words = (
        ("/iot_command", KEY_VALUE, "{key: Lamp, value: 'ON'}"),
        ("/ip_camera_position", "geometry_msgs/Point", "{x: 41.1, y: 34.5, z: 0}"),
        ("/iot_command", KEY_VALUE, "{key: Door, value: 'OPEN'}"),
    )
    with ThreadPoolExecutor(len(words)) as robots:
        told = [robots.submit(pub, master, *word) for word in words]
        bridge.says("home/Lamp/command", lambda text: text == "ON")
        bridge.says("camera/ip1/position/set", lambda text: '"pan":41.1' in text)
        bridge.says("diagnostics/bridge", lambda text: "takes no commands" in text)
        for one in told:
            one.result()


def test_a_robot_that_turns_the_camera_too_fast_or_nowhere_is_told_so(master: ros.Master, run_bridge: Run) -> None:
    bridge = run_bridge(master.env, LAMP)
    bridge.registers(1)
    words = ("pub", "-r", "200", "/ip_camera_order", KEY_VALUE, "{key: Move, value: Left}")
    flood = subprocess.Popen(["rostopic", *words], env={**os.environ, **master.env}, stdout=subprocess.DEVNULL)
    try:
        bridge.says("diagnostics/bridge", lambda text: "at most 20 a second" in text)
        pub(master, "/ip_camera_order", KEY_VALUE, "{key: Move, value: Stop}")
        bridge.says("camera/ip1/order/Move", lambda text: "Stop" in text)
    finally:
        flood.send_signal(signal.SIGINT)
        flood.wait(PATIENCE_S)
    pub(master, "/ip_camera_position", "geometry_msgs/Point", "{x: .nan, y: 0, z: 0}")
    bridge.says("diagnostics/bridge", lambda text: "expected finite numbers" in text)
    assert not [text for _, topic, text in bridge.said if topic == "camera/ip1/position/set"]


def test_without_a_master_at_the_start_nothing_is_lost(tmp_path: Path, run_bridge: Run) -> None:
    absent = ros.Master(free_port(), tmp_path / "ros")
    absent.folder.mkdir()
    bridge = run_bridge(absent.env, LAMP)
    bridge.hears("home/Lamp/state", "ON")
    bridge.hears("camera/ip1/motion", '{"value": 1, "since": "2026-01-31T07:05:00.123Z"}')
    bridge.says("diagnostics/bridge", lambda text: "no ROS master" in text and '"to_ros":"2"' in text)
    with ros.private(absent.folder, absent.port) as master:
        bridge.registers(1)
        topics = ("/iot_updates", "/ip_camera_motion_alarm", "/diagnostics")
        with ThreadPoolExecutor(len(topics)) as robots:
            told = [robots.submit(rostopic, master, "echo", "-n1", topic) for topic in topics]
            assert 'value: "ON"' in told[0].result()
            assert "level: 1" in told[1].result()
            assert "stamp" in told[2].result()


def test_a_master_that_hangs_holds_up_neither_the_home_nor_the_end(master: ros.Master, run_bridge: Run) -> None:
    bridge = run_bridge(master.env, LAMP)
    bridge.registers(1)
    os.kill(master.pid, signal.SIGSTOP)
    try:
        bridge.says("diagnostics/bridge", lambda text: "no ROS master" in text)
        bridge.hears("home/Lamp/state", "ON")
        bridge.says("diagnostics/bridge", lambda text: '"to_ros":"1"' in text)
        assert bridge.end() < PATIENCE_S / 2
    finally:
        os.kill(master.pid, signal.SIGCONT)


def test_the_newer_of_two_bridges_with_one_name_gives_up_and_says_why(master: ros.Master, run_bridge: Run) -> None:
    older = run_bridge(master.env, LAMP)
    older.registers(1)
    newer = run_bridge(master.env, LAMP, log="newer.log")
    assert newer.process.wait(PATIENCE_S) == 1
    assert "another node is named /iot_bridge, at http://127.0.0.1" in (master.folder / "newer.log").read_text()
    older.hears("home/Lamp/state", "ON")
    assert 'value: "ON"' in rostopic(master, "echo", "-n1", "/iot_updates")


def test_a_scan_result_is_on_ros_in_its_own_types(master: ros.Master, run_bridge: Run) -> None:
    bridge = run_bridge(master.env, LAMP)
    bridge.registers(1)
    topic = "/ip_camera_scan/result/pose"
    echo = subprocess.Popen(
        ["rostopic", "echo", "-n1", topic], env={**os.environ, **master.env}, stdout=subprocess.PIPE, text=True
    )
    result = (
        '{"camera":"ip1","marker":582,"dictionary":"DICT_5X5_1000","place":"Kitchen","scan":"s1",'
        '"position":{"x":1.5,"y":2,"z":0.5},"covariance":[[1e-4,0,0],[0,2e-4,0],[0,0,3e-4]],'
        '"orientation":{"x":0,"y":0,"z":0,"w":1},"first_seen":"2026-01-31T07:05:00.123Z",'
        '"stamp":"2026-01-31T07:05:00.123Z"}'
    )
    with echo:
        wait_until(lambda: _told(bridge, result, echo), "the pose", PATIENCE_S)
        assert echo.stdout
        said = echo.stdout.read()
    assert 'frame_id: "apartment"' in said
    assert "secs: 1769843100" in said
    assert "x: 1.5" in said
    assert "0.0003" in said


def _told(bridge: BridgeProcess, result: str, echo: subprocess.Popen[str]) -> bool:
    """Scan results are events: said again until the echo has found its way to the bridge."""
    bridge.hears("camera/ip1/scan/result", result)
    try:
        echo.wait(0.3)
    except subprocess.TimeoutExpired:
        return False
    return True
