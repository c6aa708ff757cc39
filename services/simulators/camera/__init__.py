"""A camera on the network, as far as a program can tell: HTTP API, motors, pictures, alarms, and its firmware's ways.

Built from the facts about the API and from `world.yaml` alone: it must not import the camera service, which would
then be tested against its own opinions. From outside in: `program` -> `http` (wire) -> `digest`, `device` -> `ptz`,
`config_tables`, `events` -> `motors`; `picture` -> `sensor`, `scene`;
`scene` -> `prints`, `order`, `solids`, `textures`, `optics`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from services.simulators.camera.settings import Config
from services.simulators.world import load

if TYPE_CHECKING:
    from services.simulators.camera.program import Simulated

__all__ = ["Config", "check", "start"]


def check(config: Config) -> None:
    """ConfigError with every fault of the world's file."""
    load(config.folder / config.world)


def start(config: Config, *, clock: Callable[[], float] = time.time) -> AbstractContextManager[Simulated]:
    """Runs a camera in threads of this process until the context ends. ConfigError: no such world or camera.

    OpenCV is loaded here and not with the module.
    """
    from services.simulators.camera import program

    return program.start(config, clock=clock)
