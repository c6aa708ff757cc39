"""The picture of a mission, for `apartment mission find --plot`: what is listened to, and the file. Heavy to load.

Not here: what the picture shows (`mission/picture.py`).
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from services.apartment import robot_places
from services.apartment.floor import XY
from services.bus import Message
from services.camera.settings import Config as Camera
from services.config import Apartment
from services.mission import Config, picture
from services.mission.chart import Chart
from services.mission.timeline import FILTERS, Timeline

__all__ = ["FILTERS", "Timeline", "write"]


def write(file: Path, apartment: Apartment, told: Timeline, seen: Iterable[Message]) -> None:
    """Draws what was heard of a mission, on the robot's map, with the cameras whose mounts are known."""
    for message in seen:
        told.heard(message)
    config = apartment.instances["mission"].config
    assert isinstance(config, Config)
    places, grid = robot_places.read(config.folder / config.robots[told.robot].places)
    file.write_bytes(picture.draw(told, Chart(places, grid), dict(_cameras(apartment))))


def _cameras(apartment: Apartment) -> Iterable[tuple[str, XY]]:
    for name in apartment.cameras:
        config = apartment.instances[f"camera-{name}"].config
        if isinstance(config, Camera) and config.mount is not None:
            yield name, config.mount.position[:2]
