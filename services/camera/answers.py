"""The life of an order, as it is published: accepted, running, then one of done, failed, refused, cancelled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from uuid import uuid4

from services import topics
from services.bus import Message, topic_matches
from services.camera.orders import Command, canonical
from services.errors import BadMessage
from services.payloads import FINAL, Order, OrderResult, OrderState, Position, Who
from services.payloads.gleaned import glean

WHOSE = {"id", "by"}
MOST_SAID = 200  # bytes of what made no sense


@dataclass(eq=False)
class Job:
    """One order that came in; `command` is None until it was understood."""

    id: str
    key: str
    value: Any
    by: Who
    message: Message
    command: Command | None = None
    state: OrderState | None = None

    @property
    def ended(self) -> bool:
        """Whether it has had its last word."""
        return self.state in FINAL


def job(key: str, value: Any, by: Who, order_id: str | None, message: Message) -> Job:
    """A new order; it gets an id when it has none."""
    return Job(order_id or uuid4().hex[:12], key, value, by, message)


class Answers:
    """Says what becomes of orders: on the bus, and to the one who asked by MQTT 5.

    `ranges`: where the camera can look, in words, for who asks for something else than numbers. `counts`: where it is
    counted how orders end.
    """

    def __init__(
        self,
        camera: str,
        publish: Callable[[Message], None],
        where: Callable[[], Position | None],
        ranges: str,
        counts: dict[str, int],
    ) -> None:
        self.camera = camera
        self.publish = publish
        self.where = where
        self.ranges = ranges
        self.counts = counts
        counts |= {f"orders_{state}": 0 for state in FINAL}
        self._taken: list[Job] = []  # what has an answer, and not its last one

    def tell(self, job: Job, state: OrderState, error: str | None = None, *, clamped: bool = False) -> None:
        """Publishes a step; after the last one nothing more is said about an order."""
        if job.ended:
            return
        job.state = state
        self._taken = [one for one in self._taken if one is not job]
        if job.ended:
            self.counts[f"orders_{state}"] += 1
        else:
            self._taken.append(job)
        result = OrderResult(
            id=job.id,
            key=job.key,
            value=job.value,
            state=state,
            error=error,
            position=self.where() if job.ended else None,
            clamped=clamped,
        )
        message = topics.CAMERA_ORDER_RESULT.message(result, cam=self.camera)
        self.publish(message)
        answer = topics.reply(message, job.message)
        if answer is not None:
            self.publish(answer)

    def leave(self, why: str) -> None:
        """Nobody sees to any order any longer."""
        for one in list(self._taken):
            self.tell(one, "cancelled", why)

    def refuse(self, message: Message, error: BadMessage) -> None:
        """An order that cannot be taken is answered all the same, with its own id where one can be read."""
        if topic_matches(topics.CAMERA_ORDER.filter, message.topic):  # whatever the key, which may be no topic's
            key = canonical(message.topic.rpartition("/")[2])
        elif topic_matches(topics.CAMERA_POSITION_SET.filter, message.topic):
            key = "Position"
        else:
            return
        why = str(error)
        if isinstance(error, topics.LateCommand):
            wanted = error.read.payload
            value = wanted.value if isinstance(wanted, Order) else wanted.model_dump(exclude=WHOSE, exclude_none=True)
            refused = job(key, value, wanted.by, wanted.id, message)
        else:
            found = glean(message.payload)
            refused = job(key, message.payload[:MOST_SAID].decode(errors="replace"), found.by, found.id, message)
            why += f"; expected {self.ranges}" if key in ("Position", "Zoom") else ""
        self.tell(refused, "refused", why)
