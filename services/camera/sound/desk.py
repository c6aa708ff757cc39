"""The threads that record and play: one recording and one playing at a time, beside the camera's other work.

A Sender in front of the device's: it takes the requests about sound and hands on the rest. Their replies come the
same way. Not here: what G.711 and WAV are, and how sound travels (`web/`).
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from services.bus import Message
from services.camera.device import Refused, Reply, Request
from services.camera.errands import EndRecording, Play, Record, Recorded
from services.camera.lanes import REPLY, Sender
from services.camera.sound import g711, wav
from services.errors import DeviceError
from services.runner import Post
from services.whole_file import write_whole

END_S = 1.5
LARGEST = 200_000_000  # bytes of a file to be played
LONGEST_S = 1200.0  # what a camera is announced as the length of a body ends after that

log = logging.getLogger(__name__)


class Sound(Protocol):
    """What a brand offers: the camera's microphone and loudspeaker."""

    def record(self, seconds: float, ended: threading.Event) -> g711.Samples:
        """So much sound, 16 bits at 8 kHz; less when `ended` is set meanwhile. DeviceError when it breaks."""
        ...

    def play(self, data: bytes, ended: threading.Event) -> None:
        """Plays A-law bytes at their pace; returns at their end, or soon after `ended` is set."""
        ...


class Desk:
    """`sound` None: this brand has none."""

    def __init__(self, sender: Sender, sound: Sound | None, post: Post, clock: Callable[[], float] = time.time) -> None:
        self._sender, self._sound, self._post, self._clock = sender, sound, post, clock
        self._ended = {Record: threading.Event(), Play: threading.Event()}
        self._threads: dict[type[Record | Play], threading.Thread] = {}

    def submit(self, request: Request, ticket: int) -> None:
        """See `Sender`."""
        if isinstance(request, Record | Play):
            self._begin(request, ticket)
        elif isinstance(request, EndRecording):
            self._ended[Record].set()
            self._answer(request, ticket, None, None, self._clock())
        else:
            self._sender.submit(request, ticket)

    def close(self) -> None:
        """Gives up what is recorded and played, and closes the other Sender."""
        for ended in self._ended.values():
            ended.set()
        self._sender.close()
        for thread in self._threads.values():
            thread.join(END_S)

    def _begin(self, request: Record | Play, ticket: int) -> None:
        kind, now = type(request), self._clock()
        running = self._threads.get(kind)
        if running is not None and running.is_alive():
            doing = "recording" if kind is Record else "playing"
            return self._answer(request, ticket, None, Refused(f"the camera is {doing} already"), now)
        self._ended[kind].clear()
        thread = threading.Thread(target=self._work, args=(request, ticket, now), name=kind.__name__, daemon=True)
        self._threads[kind] = thread
        return thread.start()

    def _work(self, request: Record | Play, ticket: int, began: float) -> None:
        try:
            result = self._done(request)
        except DeviceError as error:
            self._answer(request, ticket, None, error, began)
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            self._answer(request, ticket, None, Refused(f"{request.file.name}: {why}"), began)
        else:
            self._answer(request, ticket, result, None, began)

    def _done(self, request: Record | Play) -> Recorded | None:
        if self._sound is None:
            raise Refused("this brand has no sound here")
        if isinstance(request, Record):
            return keep(request.file, self._sound.record(request.seconds, self._ended[Record]))
        if request.file.stat().st_size > LARGEST:
            raise ValueError("it is too large")
        self._sound.play(prepared(request.file.read_bytes()), self._ended[Play])
        return None

    def _answer(self, request: Request, ticket: int, result: object, error: DeviceError | None, sent: float) -> None:
        reply = Reply(request, ticket, result, error, sent, self._clock())
        self._post(Message(REPLY, value=reply, received=reply.received))


def keep(file: Path, samples: g711.Samples) -> Recorded:
    """Writes a WAV file, whole or not at all."""
    data = wav.write(samples)
    write_whole(file, data)
    return Recorded(len(samples) / g711.RATE, len(data))


def prepared(file: bytes) -> bytes:
    """Any WAV file as A-law at 8 kHz; ValueError says what is wrong with it."""
    sound, rate = wav.read(file)
    if len(sound) / rate > LONGEST_S:
        raise ValueError(f"it is longer than {LONGEST_S:.0f} s")
    return g711.encode(wav.to_samples(wav.resampled(sound, rate)))
