"""A mission on real parts: mosquitto, a ROS master, the camera over HTTP and RTSP, the robot over ROS.

The test makes it once, the soak often, with accidents in the middle. Nobody may drive on when it is over.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from math import hypot
from pathlib import Path
from typing import Any

import yaml

from services import topics
from services.client import Client, connected
from services.payloads.robot import MissionOrder, MissionResult
from services.peers import wait_until
from services.simulated import Simulated, parts_of, services_of, start_mosquitto
from tests.trials import settled

BEDROOM = {"x": 6.95, "y": 3.85, "yaw_deg": 20.0}  # map frame; the marker lies in the living room
NEEDED = ("simulated-camera", "simulated-robot", "camera-ip1", "bridge", "mission")
ACCIDENTS = ("none", "master", "bridge", "mission", "broker", "simulated-robot")
LONGEST_S = 240.0
FILTERS = (
    topics.MISSION_STATE.filter,
    topics.MISSION_RESULT.filter,
    topics.ROBOT_POSE.filter,
    topics.ROBOT_SEEN.filter,
    topics.ROBOT_GOTO_RESULT.filter,
)


@contextmanager
def flat(folder: Path, start: dict[str, float]) -> Iterator[Simulated]:
    """The services that a mission needs, on real parts; the robot stands in the bedroom, or wherever."""

    def change(config: Path) -> None:
        world = config.with_name("world.yaml")
        content = yaml.safe_load(world.read_text(encoding="utf-8"))
        content["robots"]["tiago"]["pose"] = start
        world.write_text(yaml.safe_dump(content), encoding="utf-8")

    with parts_of(folder, real=True) as parts, services_of(folder, parts, change=change, only=NEEDED) as running:
        yield running


def find(running: Simulated, marker: int, accident: str) -> tuple[MissionResult, float]:
    """One mission, with an accident while the robot drives to where the house saw the marker; how it ended, and in how
    many seconds."""
    with connected(running.apartment.bus, FILTERS) as bus:
        bus.payload(topics.ROBOT_POSE.name(robot="tiago"), timeout_s=60.0)
        bus.payload(topics.ROBOT_SEEN.name(robot="tiago"), timeout_s=60.0)
        bus.payload(topics.MISSION_STATE.name(robot="tiago"), lambda state: state.state == "idle", 60.0)
        bus.forget()
        began = time.monotonic()
        order = MissionOrder(find=marker, id=f"m{time.time_ns()}")
        bus.publish(topics.MISSION_ORDER.message(order, robot="tiago"))
        if accident != "none":
            bus.payload(
                topics.MISSION_STATE.name(robot="tiago"),
                lambda state: state.id == order.id and state.state == "go" and "seen by" in state.reason,
                LONGEST_S,
            )
            happen(running, accident)
        end = bus.payload(topics.MISSION_RESULT.name(robot="tiago"), lambda result: result.id == order.id, LONGEST_S)
        seconds = time.monotonic() - began
        stands(bus)
        return end, seconds


def happen(running: Simulated, accident: str) -> None:
    """The accident."""
    if accident == "master":
        assert running.parts.ros is not None
        running.parts.ros.kill()
        running.parts.ros.start()
    elif accident == "broker":
        os.kill(running.parts.broker_pid, signal.SIGKILL)
        running.parts.broker.close()
        start_mosquitto(running.parts)
    else:
        os.kill(settled(running, accident), signal.SIGKILL)


def stands(bus: Client) -> None:
    """Waits until the robot's pose has not changed for two seconds."""
    known: list[tuple[float, Any]] = []

    def same() -> bool:
        for message in bus.pump(0.2):
            if message.topic == topics.ROBOT_POSE.name(robot="tiago"):
                known.append((time.monotonic(), topics.read(message, message.received).payload))
        recent = [pose for at, pose in known if at > time.monotonic() - 2.0]
        long = bool(known) and known[0][0] < time.monotonic() - 2.0 and len(recent) >= 2
        return long and all(hypot(one.x - recent[0].x, one.y - recent[0].y) < 0.01 for one in recent)

    wait_until(same, "the robot to stand", 60.0)
