"""Pictures into an encoder: one thread for each stream, at the stream's rate, while somebody watches.

A picture arrives later than it was taken, as from a camera that encodes and buffers; `LATENCY_S` is measured on one.
Another thread hands on what was drawn: a picture that takes long does not delay the ones before it.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from queue import SimpleQueue
from threading import Event, Thread
from typing import Any

import cv2

from services.simulators.camera.http import CameraServer
from services.simulators.camera.rtsp.gstreamer import Gst
from services.simulators.camera.view.picture import Stream

LATENCY_S: dict[Stream, float] = {"MainFormat": 0.8, "ExtraFormat": 0.25}


@dataclass
class Watched:
    """An encoder that runs; `over` is set when nobody watches any longer."""

    source: Any
    over: Event = field(default_factory=Event)


class Feed:
    """Feeds one stream's encoder. `watch` and its end come on GStreamer's threads."""

    def __init__(self, camera: CameraServer, stream: Stream) -> None:
        self._camera, self._stream = camera, stream
        self._asked: SimpleQueue[Watched | None] = SimpleQueue()
        self._running: Watched | None = None
        self._thread = Thread(target=self._run, name=f"RTSP {stream}")

    def start(self) -> None:
        """Begins to wait for somebody who watches."""
        self._thread.start()

    def close(self) -> None:
        """Ends the thread."""
        self._asked.put(None)
        if self._running is not None:
            self._running.over.set()
        self._thread.join()

    @property
    def runs(self) -> bool:
        """Whether somebody watches."""
        return self._running is not None and not self._running.over.is_set()

    def watch(self, source: Any) -> Watched:
        """An encoder's source is to be fed from now on, instead of the one before."""
        if self._running is not None:
            self._running.over.set()
        self._running = Watched(source)
        self._asked.put(self._running)
        return self._running

    def _run(self) -> None:
        while (watched := self._asked.get()) is not None:
            self._feed(watched)

    def _feed(self, watched: Watched) -> None:
        """A camera that cannot keep its rate leaves pictures out; it never hurries to catch up.

        The first picture is made even if no picture may go out: whoever asked for the stream waits for it.
        """
        drawn: SimpleQueue[tuple[float, bytes] | None] = SimpleQueue()
        sender = Thread(target=_send, args=(watched, drawn), name=f"RTSP {self._stream} out")
        sender.start()
        due, first = time.monotonic(), True
        while not watched.over.wait(max(due - time.monotonic(), 0.0)):
            if self._camera.shows_pictures or first:
                first = False
                drawn.put((time.monotonic() + LATENCY_S[self._stream], self._picture()))
                self._camera.pictures.ahead(self._stream)
            due = max(due + 1 / self._camera.pictures.fps(self._stream), time.monotonic())
        drawn.put(None)
        sender.join()

    def _picture(self) -> bytes:
        image = self._camera.pictures.frame(self._stream, self._camera.clock())
        return cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420).tobytes()


def _send(watched: Watched, drawn: SimpleQueue[tuple[float, bytes] | None]) -> None:
    """Each picture when it is due, until there are no more or nobody watches."""
    while (one := drawn.get()) is not None:
        due, picture = one
        if watched.over.wait(max(due - time.monotonic(), 0.0)):
            return
        watched.source.emit("push-buffer", Gst.Buffer.new_wrapped(picture))
