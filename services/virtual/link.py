"""A camera's Sender in virtual time: what `camera/lanes.py` does with threads, done by a queue and due times."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from dataclasses import replace

from services.bus import Message
from services.camera.brands.amcrest import Amcrest
from services.camera.device import Rank, Refused, Reply, Request
from services.camera.lanes import REPLY
from services.errors import DeviceError
from services.runner import Post
from services.virtual.wire import Wire

NEVER = float("inf")


class Lane:
    """One connection, one request in flight; a stop drops what waits to move."""

    def __init__(self, camera: Amcrest, wire: Wire, post: Post, clock: Callable[[], float]) -> None:
        self._camera, self._wire, self._post, self._clock = camera, wire, post, clock
        self._waiting: list[tuple[Rank, int, Request, int]] = []
        self._numbers = itertools.count()
        self._flying: Reply | None = None

    @property
    def due(self) -> float:
        """When the answer to the request in flight comes."""
        return NEVER if self._flying is None else self._flying.received

    def put(self, request: Request, ticket: int) -> None:
        """Sends it, or lets it wait for its turn."""
        if request.rank is Rank.STOP:
            for one in [one for one in self._waiting if one[0] is Rank.MOVE]:
                self._waiting.remove(one)
                now = self._clock()
                self._answer(Reply(one[2], one[3], None, Refused("overtaken by a stop"), now, now))
        heapq.heappush(self._waiting, (request.rank, next(self._numbers), request, ticket))
        self._send_next()

    def deliver(self, now: float) -> None:
        """Hands over the answer that has come by now, and sends what waits."""
        if self._flying is not None and self._flying.received <= now:
            reply, self._flying = self._flying, None
            self._answer(replace(reply, received=now))
            self._send_next()

    def _send_next(self) -> None:
        if self._flying is None and self._waiting:
            _, _, request, ticket = heapq.heappop(self._waiting)
            sent = self._wire.now = self._clock()
            result: object = None
            fault: DeviceError | None = None
            try:
                result = self._camera.send(request)
            except DeviceError as error:
                fault = error
            self._flying = Reply(request, ticket, result, fault, sent, self._wire.now)

    def _answer(self, reply: Reply) -> None:
        self._post(Message(REPLY, value=reply))


class Link:
    """The two lanes of a camera, control and pictures."""

    def __init__(self, control: Lane, pictures: Lane) -> None:
        self._lanes = (control, pictures)

    @property
    def due(self) -> float:
        """When the next answer comes."""
        return min(lane.due for lane in self._lanes)

    def submit(self, request: Request, ticket: int) -> None:
        """See `camera.lanes.Sender`."""
        self._lanes[request.rank is Rank.PICTURE].put(request, ticket)

    def deliver(self, now: float) -> None:
        """Hands over what has come by now."""
        for lane in self._lanes:
            lane.deliver(now)

    def close(self) -> None:
        """Nothing runs on its own here."""
