"""One camera: listens to `camera/<cam>/order/+`, `position/set` and `snapshot/get`; says where it looks, what became of
orders, and where in the apartment the markers are that a scan has found. The only one that talks to the camera.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from services.camera.settings import Config
from services.runner import Post

if TYPE_CHECKING:
    from services.camera.service import CameraService

__all__ = ["Config", "check", "start"]


def check(config: Config) -> None:
    """ConfigError with every fault of the files that the configuration names."""
    from services.camera import program

    program.check(config)


def start(config: Config, post: Post) -> AbstractContextManager[CameraService]:
    """Runs the service until the context ends. OpenCV and HTTP are loaded here, not with the module."""
    from services.camera import program

    return program.start(config, post)
