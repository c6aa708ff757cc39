"""Looking for markers in frames, in processes of its own during a scan, so that motors never wait for pixels.

The frames of one place are looked at together, when all have come: one search in their mean instead of one in each.
Results go to the inbox as `/camera/analysed`, one for each frame. `Inline` does the same with every frame at once and
by itself, for virtual time and tests. The scan itself is `search.py`.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import threading
from collections.abc import Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, Protocol

from services.bus import Message
from services.camera.device import Away
from services.camera.video import pictures
from services.runner import Post
from services.vision.detect import Detection
from services.vision.exposure import cut_off
from services.vision.still import Picture, Still, detect_still

ANALYSED = "/camera/analysed"
GATHER_S = 1.0  # after the newest frame of a place: one that was lost must not hold up the others
DECODERS = 2  # threads of a worker that decode: there are frames for both, and decoding is a third of the work
BEHIND = 19  # niceness of the workers: what turns the camera and reads its stream comes first on a busy machine

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Task:
    """One frame, and what to look for in it. `flip`, `mirror`: as it was delivered.

    `draw`: send the picture back; of the frames of a place the first with a marker in it is sent back in any case.
    `of` frames with this `still` come in all, taken by a camera that stood still in between; 1: this one alone.
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
    still: int = 0
    of: int = 1


@dataclass(frozen=True)
class Analysed:
    """What was found in a frame of a scan; `size` is (width, height) in pixels, `error` empty if all went well.

    `cut_off` tells of each detection whether its light or dark is (`vision/exposure.py`).
    """

    scan: str
    number: int
    size: tuple[int, int] = (0, 0)
    detections: tuple[Detection, ...] = ()
    cut_off: tuple[bool, ...] = ()
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


def analyse(tasks: Sequence[Task]) -> list[Analysed]:
    """The frames of one place (at least one): decoded, set upright, searched together, drawn on when asked."""
    with ThreadPoolExecutor(min(DECODERS, len(tasks))) as decoders:
        decoded = list(decoders.map(_decoded, tasks))
    frames = {task.number: image for task, image in zip(tasks, decoded, strict=True) if not isinstance(image, Away)}
    seen: dict[int, list[Detection]] = {number: [] for number in frames}
    for size in {image.shape for image in frames.values()}:
        numbers = [number for number, image in frames.items() if image.shape == size]
        for one in detect_still([frames[number] for number in numbers], tasks[0].dictionary, tasks[0].targets):
            for number, detection in _in_each(one, numbers):
                seen[number].append(detection)
    shown = next((number for number in seen if seen[number]), None)
    return [
        _analysed(task, image, seen.get(task.number, []), draw=task.draw or task.number == shown)
        for task, image in zip(tasks, decoded, strict=True)
    ]


def _decoded(task: Task) -> Picture | Away:
    """The frame in grey, upright; or why there is none."""
    try:
        grey = pictures.decode_grey(task.jpeg)
    except Away as error:
        return error
    return pictures.upright(grey, flip=task.flip, mirror=task.mirror, kind=task.kind)


def _in_each(one: Still, numbers: Sequence[int]) -> list[tuple[int, Detection]]:
    """The marker as it is in each of the frames that agree."""
    if len(numbers) == 1:
        return [(numbers[0], one.detection)]
    return [(numbers[index], seen) for index, seen in zip(one.frames, one.each, strict=True)]


def _analysed(task: Task, image: Picture | Away, found: Sequence[Detection], *, draw: bool) -> Analysed:
    if isinstance(image, Away):
        return Analysed(task.scan, task.number, error=str(image))
    jpeg = _drawn(task, found) if draw else None
    beside = tuple(cut_off(image, one.corners) for one in found)
    return Analysed(task.scan, task.number, (image.shape[1], image.shape[0]), tuple(found), beside, jpeg)


def _drawn(task: Task, found: Sequence[Detection]) -> bytes:
    """The frame in its colours, with what was found in it."""
    image = pictures.upright(pictures.decode(task.jpeg), flip=task.flip, mirror=task.mirror, kind=task.kind)
    return pictures.encode(pictures.drawn(image, [(one.marker, one.corners) for one in found]))


def _begin_work() -> None:
    """In a worker process: one thread of OpenCV, behind whoever turns the camera; it ends with the service."""
    os.nice(BEHIND)
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
        for analysed in analyse([task]):
            self.post(Message(ANALYSED, value=analysed))

    def close(self) -> None:
        """Nothing to forget."""


class Pool:
    """An Analyst in worker processes ("spawn": forking after OpenCV has started its threads hangs)."""

    def __init__(self, post: Post, workers: int) -> None:
        self.post = post
        self.pool = ProcessPoolExecutor(
            workers, mp_context=multiprocessing.get_context("spawn"), initializer=_begin_work
        )
        self._gathered: dict[tuple[str, int], _Gathered] = {}
        self._lock = threading.Lock()

    def submit(self, task: Task) -> None:
        """Lets a worker look when all frames of the place are there, or no more come."""
        if task.of <= 1:
            self._work([task])
            return
        place = (task.scan, task.still)
        with self._lock:
            before = self._gathered.get(place)
            if before is not None:
                before.timer.cancel()
            timer = threading.Timer(GATHER_S, self._late, (place,))
            timer.daemon = True
            timer.start()
            tasks = [*(before.tasks if before else ()), task]
            self._gathered[place] = _Gathered(timer, tasks)
            whole = len(tasks) >= task.of
        if whole:
            self._late(place)

    def close(self) -> None:
        """Ends the processes."""
        with self._lock:
            for waiting in self._gathered.values():
                waiting.timer.cancel()
            self._gathered.clear()
        self.pool.shutdown(wait=False, cancel_futures=True)

    def _late(self, place: tuple[str, int]) -> None:
        """What has come of a place is looked at."""
        with self._lock:
            waiting = self._gathered.pop(place, None)
        if waiting is not None:
            waiting.timer.cancel()
            self._work(waiting.tasks)

    def _work(self, tasks: list[Task]) -> None:
        """One that died fails the frames, not the service."""
        try:
            future = self.pool.submit(analyse, tasks)
        except RuntimeError as error:  # a broken pool is a RuntimeError too
            self._failed(tasks, f"no worker: {error}")
            return
        future.add_done_callback(lambda done: self._done(tasks, done))

    def _done(self, tasks: list[Task], done: Future[list[Analysed]]) -> None:
        if done.cancelled():
            return
        error = done.exception()
        if error is not None:
            log.error("frames could not be analysed: %r", error)
            self._failed(tasks, repr(error))
            return
        for analysed in done.result():
            self.post(Message(ANALYSED, value=analysed))

    def _failed(self, tasks: list[Task], error: str) -> None:
        for task in tasks:
            self.post(Message(ANALYSED, value=Analysed(task.scan, task.number, error=error)))


@dataclass
class _Gathered:
    """The frames of a place as far as they have come, and when no more are waited for."""

    timer: threading.Timer
    tasks: list[Task]
