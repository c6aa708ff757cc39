"""The bridge's section of the configuration. What is in its file of rules is read in `rulebook.py`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import Field, field_validator

from services.apartment.cameras import CameraSections
from services.apartment.home import Home
from services.bridge.robots import Robot
from services.section import Section
from services.topic import RobotName


class Config(Section):
    """The bridge's section of the configuration."""

    rules: str = "bridge.yaml"  # which topics are bridged, and how
    node: str = Field(default="iot_bridge", pattern=r"^[A-Za-z][A-Za-z0-9_]*$")  # its name in the ROS graph
    master_uri: str | None = None  # http://host:11311; without it ROS_MASTER_URI of the environment
    robot: RobotName | None = None  # its name on the bus, for /iot_mission; None: no missions here
    places: Path | None = None  # the robot's file: its map, shown on /map, and where the apartment lies in it
    map: Path | None = None  # a map_server YAML to be shown instead; relative to the configuration
    apartment: None = None  # until 0.1 the relation stood here, and a second time in the robot's file
    robots: dict[RobotName, Robot] = {}  # that we speak for, by name on the bus
    simulated: bool = False  # a ROS node in memory, where there is no ROS
    name: str = "bridge"
    home: Home
    cameras: tuple[str, ...] = ()
    camera_sections: CameraSections = {}
    folder: Path
    state: Path | None = None

    @field_validator("apartment", mode="before")
    @classmethod
    def stands_in_the_robots_file(cls, value: Any) -> None:
        """Two files that say where the apartment lies would come to differ."""
        if value is not None:
            raise ValueError(f"expected places: FILE, whose apartment_to_map says it for all, got {value!r}")
