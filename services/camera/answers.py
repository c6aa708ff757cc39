"""The life of an order, as it is published: accepted, running, then one of done, failed, refused, cancelled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from uuid import uuid4

from services import topics
from services.bus import Message
from services.camera.orders import Command, canonical
from services.errors import BadMessage
from services.payloads import FINAL, OrderResult, OrderState, Position, Who


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
    """Says what becomes of orders: on the bus, and to the one who asked by MQTT 5."""

    def __init__(self, camera: str, publish: Callable[[Message], None], where: Callable[[], Position | None]) -> None:
        self.camera = camera
        self.publish = publish
        self.where = where
        self.counts = dict.fromkeys(FINAL, 0)

    def tell(self, job: Job, state: OrderState, error: str | None = None, *, clamped: bool = False) -> None:
        """Publishes a step; after the last one nothing more is said about an order."""
        if job.ended:
            return
        job.state = state
        if job.ended:
            self.counts[state] += 1
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

    def refuse(self, message: Message, error: BadMessage) -> None:
        """An order that cannot be taken is answered all the same, with its own id where it could be read."""
        row, levels = topics.find(message.topic)
        wanted = error.read.payload if isinstance(error, topics.LateCommand) else None
        if row is topics.CAMERA_ORDER:
            key, value = canonical(levels["key"]), wanted.value if wanted else ""
        elif row is topics.CAMERA_POSITION_SET:
            key, value = "Position", wanted.model_dump(exclude={"id", "by"}, exclude_none=True) if wanted else {}
        else:
            return
        refused = job(key, value, wanted.by if wanted else "human", wanted.id if wanted else None, message)
        self.tell(refused, "refused", str(error))
