"""The thread that keeps the camera's event stream open and posts what comes. What it means is said in `motion.py`."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

from services.bus import Message
from services.camera.device import Away, BadLogin, Event
from services.camera.web.endless import Silent
from services.errors import DeviceError
from services.runner import Post

HEARD = "/camera/alarm"
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.5, 10.0  # between two attempts to attach
TIMELY = 2.0  # heartbeats: one that comes later after the last proves nothing, and silence then proves nothing either
WELL_S = 10.0  # a stream that lasted so long was a good one: the next attempt is made soon
END_S = 2.0

log = logging.getLogger(__name__)


class Ear(Protocol):
    """What a brand offers: the camera's events. `heartbeat_s`: how often a sign of life was asked for."""

    heartbeat_s: float

    def listen(self, *, patient: bool) -> Iterator[list[Event]]:
        """Attaches, yields an empty list then, and what comes; DeviceError when that ends or is not to be had.

        `patient`: nothing may come for long, since there is no heartbeat.
        """
        ...

    def close(self) -> None:
        """From any thread: ends `listen`."""
        ...


@dataclass(frozen=True)
class Heard:
    """`attached` just now, or `lost` and why, or events that came (a heartbeat is one).

    `silent`: lost because nothing came.
    """

    at: float
    events: tuple[Event, ...] = ()
    attached: bool = False
    lost: str | None = None
    silent: bool = False


class Listener:
    """Listens until it is closed; posts Heard as `/camera/alarm`."""

    def __init__(self, name: str, ear: Ear, post: Post, clock: Callable[[], float] = time.time) -> None:
        self._ear, self._post, self._clock = ear, post, clock
        self._beats = self._mute = False  # a heartbeat came in time; nothing did, for as long as some would have
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"{name} events", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Returns when the thread has ended, or after END_S."""
        self._closing.set()
        self._ear.close()
        self._thread.join(END_S)

    def _run(self) -> None:
        pause = FIRST_PAUSE_S
        while not self._closing.is_set():
            began, least = self._clock(), 0.0
            lost, silent = "the camera ended it", False
            try:
                self._listen()
            except BadLogin as error:
                lost, least = str(error), error.again_s
            except Silent as error:
                lost, silent = str(error), True
                self._mute = not self._beats
            except DeviceError as error:
                lost = str(error)
            if self._closing.is_set():
                return
            self._tell(Heard(self._clock(), lost=lost, silent=silent))
            pause = FIRST_PAUSE_S if self._clock() - began > WELL_S else min(LONGEST_PAUSE_S, 2 * pause)
            self._closing.wait(max(pause, least))

    def _listen(self) -> None:
        attached, patient, beat_at = False, self._mute and not self._beats, 0.0
        for came in self._ear.listen(patient=patient):
            if self._closing.is_set():
                return
            now, beat = self._clock(), any(not event.code for event in came)
            timely = beat and now - beat_at <= TIMELY * self._ear.heartbeat_s
            self._beats |= timely
            events = tuple(event for event in came if event.code or timely)
            if events or not attached:
                self._tell(Heard(now, events, attached=not attached))
            attached, beat_at = True, now if beat or not attached else beat_at
            if patient and self._beats:
                raise Away("it has a heartbeat after all, and is watched by that from now on")

    def _tell(self, heard: Heard) -> None:
        self._post(Message(HEARD, value=heard, received=heard.at))
