"""The table of services: what can run, where its code and its configuration are, and how it meets the bus.

Modules are named as texts, so that no service loads another's libraries. A name with `<cam>` stands for one
service per key at that place of its section: per camera of the configuration, per simulated camera.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Row:
    """One service (or one per camera).

    `section` is where its settings stand in the configuration file; without that section it does not run.
    `group`: services of one group share a process where the configuration says `grouped`.
    `durable`: the broker keeps its messages while it is away.
    `inline`: its own thread reads and writes the network, which is sooner; none of its turns may be long.
    `protocol`: 5, or 4 for MQTT 3.1.1.
    """

    name: str
    module: str
    section: tuple[str, ...]
    help: str
    group: str = ""
    durable: bool = False
    inline: bool = False
    protocol: Literal[4, 5] = 5
    on_bus: bool = True
    plays: str = ""  # the role at the broker that it has besides its own


REGISTRY: tuple[Row, ...] = (
    Row(
        "simulated-camera",
        "services.simulators.camera",
        ("simulators", "camera"),
        "a camera on the network that is not there",
        on_bus=False,
    ),
    Row(
        "simulated-camera-<cam>",
        "services.simulators.camera",
        ("simulators", "cameras", "<cam>"),
        "one of several of them",
        on_bus=False,
    ),
    Row(
        "simulated-home",
        "services.simulators.home",
        ("simulators", "home"),
        "lights, doors and sensors that answer as OpenHAB would",
        group="light",
        plays="openhab",
    ),
    Row(
        "simulated-robot",
        "services.simulators.robot",
        ("simulators", "robot"),
        "a robot that drives, sees and fails",
        group="light",
        plays="robot",
    ),
    Row(
        "persistence",
        "services.persistence",
        ("persistence",),
        "writes what happens to the database",
        group="light",
        durable=True,
        protocol=4,
    ),
    Row("history", "services.history", ("history",), "answers what was, and clears what is old", group="light"),
    Row("camera-<cam>", "services.camera", ("cameras", "<cam>"), "drives one camera: places, orders, scans"),
    Row("bridge", "services.bridge", ("bridge",), "maps the bus to ROS 1 topics and back", group="light", inline=True),
    Row("openhab", "services.openhab", ("openhab",), "mirrors an OpenHAB that has no MQTT binding", group="light"),
    Row("hubs", "services.hubs", ("hubs",), "tells Home Assistant and Homie what there is", group="light"),
    Row("mission", "services.mission", ("mission",), "robot and house find a marker together", group="light"),
    Row("dashboard", "services.dashboard", ("dashboard",), "shows and steers everything in a browser"),
    Row("metrics", "services.metrics", ("metrics",), "tells Prometheus how the services fare", group="light"),
)
