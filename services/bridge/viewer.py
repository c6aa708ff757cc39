"""Looks at one camera's stream as long as somebody on ROS looks at ours, and says what it sees there.

The stream is the camera service's (`camera/<cam>/stream` says where); only that one talks to the camera. JPEG files
are passed on untouched, pixels are made only for who wants pixels. A thread each, in the process for pictures.
"""

from __future__ import annotations

import http.client
import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from urllib.parse import urlsplit

from services import document
from services.apartment import zoom_levels
from services.bridge import images
from services.bridge.hatch import BASE
from services.bridge.images import Intrinsics
from services.bridge.multipart import Multipart, Shown
from services.bridge.node import Node, Outlet
from services.bridge.rules import Fields
from services.errors import BadMessage, ConfigError

LOOK_S = 0.1  # between two looks whether somebody wants to see something
RETRY_S = 1.0
SILENT_S = 10.0  # a stream that brings nothing for so long is opened again
CHUNK = 1024 * 1024  # whatever has come since the last look: of several pictures only the newest is shown

log = logging.getLogger(__name__)


class Viewer:
    """One camera's. What is told of the stream comes from the main thread, everything else happens in its own."""

    def __init__(self, cam: str, prefix: str, camera_info: Path | None, node: Node) -> None:
        self.cam = cam
        self.image, self.compressed, self.info = names(prefix)
        self.shown = self.decoded = 0
        self.zoom = 0.0
        self._camera_info = camera_info
        self._read: tuple[list[float], Intrinsics] | None = None
        self._node = node
        self._url = ""
        self._changed = threading.Event()
        self._ending = False
        self._told = ""
        self._thread = threading.Thread(target=self._run, name=f"viewer {cam}", daemon=True)
        self._thread.start()

    def tell(self, url: str) -> None:
        """Where the stream is; empty while there is none for ROS."""
        self._url = url
        self._changed.set()

    def end(self) -> None:
        """Lets the thread end; does not wait for it."""
        self._ending = True
        self._changed.set()

    @property
    def wanted(self) -> bool:
        """Whether there is something to see, and somebody who wants to."""
        topics = (self.image, self.compressed, self.info)
        return bool(self._url) and not self._ending and any(self._node.listeners(topic) for topic in topics)

    def _run(self) -> None:
        while not self._ending:
            self._changed.wait(LOOK_S)
            self._changed.clear()
            if self.wanted:
                try:
                    self._watch(self._url)
                    self._told = ""
                except (OSError, http.client.HTTPException, BadMessage) as error:
                    self._tell(str(error) or type(error).__name__)
                    self._changed.wait(RETRY_S)

    def _tell(self, text: str) -> None:
        """Once when it changes, not at every attempt."""
        if text != self._told:
            log.warning("%s: no picture from %s: %s", self.cam, self._url, text)
            self._told = text

    def _watch(self, url: str) -> None:
        for picture in pictures(url, lambda: self.wanted and self._url == url):
            self._show(picture)

    def _show(self, picture: Shown) -> None:
        stamp = time.time() if picture.stamp is None else picture.stamp
        header: Fields = {"stamp": stamp, "frame_id": f"{self.cam}_optical_frame"}
        node, jpeg = self._node, picture.jpeg
        if node.listeners(self.info):
            node.publish(self.info, self._intrinsics().info(*images.size(jpeg), self.zoom, header))
        if node.listeners(self.compressed):
            node.publish(self.compressed, {"header": header, "format": "jpeg", "data": jpeg})
        if node.listeners(self.image):
            self.decoded += 1
            node.publish(self.image, images.image(jpeg, header))
        self.shown += 1
        node.flush()

    def _intrinsics(self) -> Intrinsics:
        """As they stand in the files now: who calibrates need not start us again."""
        file = self._camera_info
        changed = [] if file is None else [_changed(one) for one in (file, zoom_levels.of_lens(file))]
        if self._read is None or self._read[0] != changed:
            self._read = (changed, _intrinsics(file if any(changed[:1]) else None))
        return self._read[1]


def names(prefix: str) -> tuple[str, str, str]:
    """A camera's topics: pixels, JPEG, lens."""
    base = f"{prefix}{BASE}"
    return f"{base}/image_raw", f"{base}/image_raw/compressed", f"{base}/camera_info"


def outlets(prefix: str) -> tuple[Outlet, ...]:
    """The same as ports. A subscriber that is slow misses pictures."""
    kinds = ("sensor_msgs/Image", "sensor_msgs/CompressedImage", "sensor_msgs/CameraInfo")
    return tuple(Outlet(name, kind, queue=2) for name, kind in zip(names(prefix), kinds, strict=True))


def pictures(url: str, wanted: Callable[[], bool]) -> Iterator[Shown]:
    """The newest picture of a stream again and again, while it is wanted; OSError, HTTPException, BadMessage."""
    where = urlsplit(url)
    with closing(http.client.HTTPConnection(where.hostname or "", where.port or 80, timeout=SILENT_S)) as connection:
        connection.request("GET", where.path)
        answer = connection.getresponse()
        if answer.status != http.client.OK:
            raise BadMessage(answer.read(200).decode(errors="replace").strip() or answer.reason)
        parts = Multipart()
        while wanted():
            data = answer.read1(CHUNK)
            if not data:
                raise BadMessage("the stream has ended")
            yield from list(parts.feed(data))[-1:]


def _changed(file: Path) -> float:
    """When; 0 where it is not there."""
    with suppress(OSError):
        return file.stat().st_mtime
    return 0.0


def _intrinsics(file: Path | None) -> Intrinsics:
    if file is None:
        return Intrinsics(None)
    try:
        return Intrinsics(document.must(document.read(file)), zoom_levels.read(zoom_levels.of_lens(file)))
    except (ConfigError, ValueError) as error:
        log.warning("%s: %s", file, error)
        return Intrinsics(None)
