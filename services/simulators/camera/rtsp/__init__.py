"""The camera's RTSP server: H.264 of both streams, by GStreamer; a machine without it has the MJPEG stream only.

In: `server` (clients, paths, its end) -> `account` (Digest), `feed` (pictures in time) -> `gstreamer` (the library).
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from services.simulators.camera.http import CameraServer

if TYPE_CHECKING:
    from services.simulators.camera.rtsp.server import Server

LOG = logging.getLogger(__name__)


@contextmanager
def served(camera: CameraServer, port: int | None) -> Iterator[Server | None]:
    """Runs it until the context ends; None when no port is wanted (`port` None) or GStreamer is not installed."""
    with ExitStack() as stack:
        yield None if port is None else _started(stack, camera, port)


def _started(stack: ExitStack, camera: CameraServer, port: int) -> Server | None:
    try:
        from services.simulators.camera.rtsp.server import Server
    except ImportError as missing:
        LOG.warning("no RTSP, only MJPEG: %s", missing)
        return None
    return stack.enter_context(Server(camera, port))
