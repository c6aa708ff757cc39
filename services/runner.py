"""The turn: receive, handle, publish, tick, acknowledge."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

from services.bus import Message

Post = Callable[[Message], None]


class Service(Protocol):
    """What the runner drives. All calls come from one thread; time comes in as `now`, seconds since 1970."""

    subscribes: tuple[str, ...]
    due: float | None  # when tick is wanted next; None: only after a message

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        """Takes one message and yields what is to be published."""
        ...

    def tick(self, now: float) -> Iterable[Message]:
        """Called at the end of every turn, whether `due` or not."""
        ...
