"""What every service can be told besides its own work: how much to log, and to start again with its configuration.

Not here: the service itself, which hears nothing of this; starting it again, that is `supervisor.py` or systemd.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping

from services.bus import Message
from services.errors import BadMessage
from services.runner import Service
from services.topics import SERVICE_LOG_LEVEL, SERVICE_RELOAD, read

LEVELS = {name: getattr(logging, name.upper()) for name in ("debug", "info", "warning", "error")}
OURS = logging.getLogger("services")  # not what libraries log: theirs may tell what is nobody's business


class Steered:
    """A service that also hears the two topics; the runner drives it like the one inside."""

    def __init__(self, name: str, inside: Service, reload: Callable[[], None]) -> None:
        self._inside = inside
        self._reload = reload
        self._log = logging.getLogger(f"services.run.{name}")
        self._own = (SERVICE_LOG_LEVEL.name(service=name), SERVICE_RELOAD.name(service=name))
        self.subscribes = (*inside.subscribes, *self._own)

    @property
    def due(self) -> float | None:
        """See `Service`."""
        return self._inside.due

    @property
    def counters(self) -> Mapping[str, float]:
        """Those of the service, and the level at which its process logs, as `logging` numbers it."""
        return {**getattr(self._inside, "counters", {}), "log_level": OURS.getEffectiveLevel()}

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        """See `Service`."""
        if message.topic in self._own:
            return self._told(message, now)
        said = self._inside.handle(message, now)
        if not self._log.isEnabledFor(logging.DEBUG):
            return said
        self._log.debug("heard %s, %d bytes", message.topic, len(message.payload))
        return self._noted(said)

    def tick(self, now: float) -> Iterable[Message]:
        """See `Service`."""
        said = self._inside.tick(now)
        return self._noted(said) if self._log.isEnabledFor(logging.DEBUG) else said

    def leave(self, now: float) -> Iterable[Message]:
        """See `Service`."""
        last_words: Callable[[float], Iterable[Message]] = getattr(self._inside, "leave", lambda now: ())
        return last_words(now)

    def _noted(self, said: Iterable[Message]) -> Iterator[Message]:
        """Without what it says: a picture is long, and somebody's business."""
        for message in said:
            self._log.debug("said %s, %d bytes", message.topic, len(message.payload))
            yield message

    def _told(self, message: Message, now: float) -> Iterator[Message]:
        wanted: str = read(message, now).payload
        if message.topic == self._own[1]:
            if message.token is None or not message.token.again:  # the broker keeps it for who ended before the ack
                self._reload()
        elif wanted.lower() in LEVELS:
            OURS.setLevel(LEVELS[wanted.lower()])
        else:
            raise BadMessage(f"{message.topic}: expected of {', '.join(LEVELS)}, got {wanted[:80]!r}")
        yield from ()
