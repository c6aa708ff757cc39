"""Reckoning beside the main thread: a plan asks for it as it asks the camera, and is answered the same way.

A Sender in front of the others: it takes what is to be reckoned and hands on the rest. OpenCV and numpy let other
threads run meanwhile, so a thread is enough; a scan, which looks at a hundred frames, has processes (`scan/`).
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar, cast

from services.bus import Message
from services.camera.device import Errand, Rank, Refused, Reply, Request
from services.camera.lanes import REPLY, Sender
from services.camera.plan import Plan, ask
from services.errors import DeviceError
from services.runner import Post

T = TypeVar("T")
END_S = 1.5


@dataclass(frozen=True, eq=False)
class Study(Errand):
    """Something to be reckoned; a ValueError of it is answered as Refused."""

    work: Callable[[], object]
    rank = Rank.PICTURE  # its answer tells nothing about the camera


def study(work: Callable[[], T]) -> Plan[tuple[T, float]]:
    """Has it reckoned; what came out, and the time then. DeviceError when it cannot be."""
    reply = yield from ask(Study(work))
    return cast(T, reply.result), reply.received


class Studio:
    """A Sender. `at_once`: on the caller's thread, for virtual time and tests."""

    def __init__(
        self, sender: Sender, post: Post, clock: Callable[[], float] = time.time, *, at_once: bool = False
    ) -> None:
        self._sender, self._post, self._clock, self._at_once = sender, post, clock, at_once
        self._thread: threading.Thread | None = None

    def submit(self, request: Request, ticket: int) -> None:
        """See `Sender`."""
        if not isinstance(request, Study):
            self._sender.submit(request, ticket)
        elif self._at_once:
            self._work(request, ticket, self._clock())
        else:
            work = (request, ticket, self._clock())
            self._thread = threading.Thread(target=self._work, args=work, name="study", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Closes the other Sender; nobody waits long for what is still reckoned."""
        self._sender.close()
        if self._thread is not None:
            self._thread.join(END_S)

    def _work(self, request: Study, ticket: int, began: float) -> None:
        result: object = None
        fault: DeviceError | None = Refused("it could not be reckoned: a fault of this program, see its log")
        try:
            result, fault = request.work(), None
        except DeviceError as error:
            fault = error
        except ValueError as error:
            fault = Refused(str(error))
        finally:
            reply = Reply(request, ticket, result, fault, began, self._clock())
            self._post(Message(REPLY, value=reply, received=reply.received))
