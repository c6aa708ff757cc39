"""Looking for markers in frames, in processes of its own during a scan, so that motors never wait for pixels.

Results go to the inbox as `/camera/analysed`. `Inline` does the same at once, for virtual time and tests.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import threading
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from typing import Literal, Protocol

from services.bus import Message
from services.camera.requests import Away
from services.camera.video import pictures
from services.runner import Post
from services.vision.detect import Detection, detect

ANALYSED = "/camera/analysed"

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Task:
    """One frame, and what to look for in it. `flip`, `mirror`: as it was delivered.

    `draw`: send the picture back; one with a marker in it is sent back in any case.
    """

    scan: str
    number: int
    jpeg: bytes
    flip: bool
    mirror: bool
    kind: Literal["ceiling", "shelf"]
    dictionary: str
    targets: tuple[int, ...]
    draw: bool = False


@dataclass(frozen=True)
class Analysed:
    """What was found in a frame of a scan; `size` is (width, height) in pixels, `error` empty if all went well."""

    scan: str
    number: int
    size: tuple[int, int] = (0, 0)
    detections: tuple[Detection, ...] = ()
    jpeg: bytes | None = None
    error: str = ""


class Analyst(Protocol):
    """Takes frames and posts what is in them."""

    def submit(self, task: Task) -> None:
        """Returns at once; the answer comes as `/camera/analysed`."""
        ...

    def close(self) -> None:
        """Forgets what waits."""
        ...


def analyse(task: Task) -> Analysed:
    """Decodes, sets upright, finds the markers, draws them when asked."""
    try:
        image = pictures.upright(pictures.decode(task.jpeg), flip=task.flip, mirror=task.mirror, kind=task.kind)
    except Away as error:
        return Analysed(task.scan, task.number, error=str(error))
    found = tuple(detect(image, task.dictionary, task.targets))
    shown = task.draw or bool(found)
    jpeg = pictures.encode(pictures.drawn(image, [(one.marker, one.corners) for one in found])) if shown else None
    return Analysed(task.scan, task.number, (image.shape[1], image.shape[0]), found, jpeg)


def _begin_work() -> None:
    """In a worker process: one thread of OpenCV, and an end when the service is killed."""
    pictures.one_thread()
    threading.Thread(target=_follow_parent, daemon=True).start()


def _follow_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


class Inline:
    """An Analyst without processes."""

    def __init__(self, post: Post) -> None:
        self.post = post

    def submit(self, task: Task) -> None:
        """Works here and now."""
        self.post(Message(ANALYSED, value=analyse(task)))

    def close(self) -> None:
        """Nothing to forget."""


class Pool:
    """An Analyst in worker processes ("spawn": forking after OpenCV has started its threads hangs)."""

    def __init__(self, post: Post, workers: int) -> None:
        self.post = post
        self.pool = ProcessPoolExecutor(
            workers, mp_context=multiprocessing.get_context("spawn"), initializer=_begin_work
        )

    def submit(self, task: Task) -> None:
        """Lets a worker do it; one that died fails the frame, not the service."""
        try:
            future = self.pool.submit(analyse, task)
        except RuntimeError as error:  # a broken pool is a RuntimeError too
            self.post(Message(ANALYSED, value=Analysed(task.scan, task.number, error=f"no worker: {error}")))
            return
        future.add_done_callback(lambda done: self._done(task, done))

    def close(self) -> None:
        """Ends the processes."""
        self.pool.shutdown(wait=False, cancel_futures=True)

    def _done(self, task: Task, done: Future[Analysed]) -> None:
        if done.cancelled():
            return
        error = done.exception()
        if error is not None:
            log.error("a frame could not be analysed: %r", error)
        value = done.result() if error is None else Analysed(task.scan, task.number, error=repr(error))
        self.post(Message(ANALYSED, value=value))
