"""The turn: receive, handle, publish, tick, acknowledge. It drives one service on one bus.

What each error makes it do is said in `errors.py`; what is done about a message that crashes, in `aside.py`.
Not here: processes and restarts (`supervisor.py`), the network (`bus/`).
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Protocol

from services import __version__
from services.aside import Aside
from services.bus import Bus, Message
from services.errors import BadMessage, DeviceError, Unavailable
from services.payloads import Diagnostic, ServiceInfo, stamp
from services.topics import DIAGNOSTICS, SERVICE_INFO, brings_commands

INFO_EVERY_S = 5.0
DIAGNOSTIC_EVERY_S = 1.0  # facts of diagnostic_aggregator: stale after 5 s without one
PAUSE_S = 0.2  # while something we need is away
WARN_FOR_S = 10.0  # how long a dropped message shows in the diagnostics
LOGGED_PER_S = 5  # dropped messages with a line of their own; the rest is counted

Post = Callable[[Message], None]


class Service(Protocol):
    """What the runner drives. All calls come from one thread; time comes in as `now`, seconds since 1970.

    It may have `counters`, a mapping of texts to numbers, for `service/<service>/info`, and `leave(now)`, which
    returns its last words.
    """

    subscribes: tuple[str, ...]

    @property
    def due(self) -> float | None:
        """When tick is wanted next; None: only after a message."""
        ...

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        """Takes one message and yields what is to be published."""
        ...

    def tick(self, now: float) -> Iterable[Message]:
        """Called at the end of every turn, whether `due` or not."""
        ...


class Runner:
    """Turns of one service. `turn` is called again and again, by `run_service` or by virtual time."""

    def __init__(self, name: str, service: Service, bus: Bus, clock: Callable[[], float], aside: Aside) -> None:
        self.name = name
        self.service = service
        self.bus = bus
        self.clock = clock
        self.aside = aside
        self.log = logging.getLogger(f"services.run.{name}")
        self.counters: Counter[str] = Counter(bad=0, aside=0)
        self.received = self.published = 0
        self._started = clock()
        self._batch: list[Message] = []  # of this turn; kept while it cannot be completed
        self._handled = 0
        self._waiting_for = ""
        self._tick_again = 0.0  # not sooner, after one that could not say something
        self._next_info = self._next_diagnostic = self._started
        self._warned = (-WARN_FOR_S, "")
        self._logged: tuple[int, int] = (0, 0)  # second, lines in it
        bus.subscribe(service.subscribes, [one for one in service.subscribes if brings_commands(one)])

    @property
    def due(self) -> float:
        """When the next turn is wanted even if no message comes."""
        own = min(self._next_info, self._next_diagnostic)
        if self._waiting_for:
            return min(own, self.clock() + PAUSE_S)
        return own if self.service.due is None else min(own, max(self.service.due, self._tick_again))

    def turn(self, wait_s: float | None = 0.0) -> bool:
        """One turn; waits up to `wait_s` for a message. True when there was something to do.

        Anything but our own errors comes out of here after the message that caused it was noted: it is a bug.
        """
        if self._waiting_for:
            self.bus.receive(wait_s, most=0)
        else:
            self._batch, self._handled = self._without_put_aside(self.bus.receive(wait_s)), 0
        now = self.clock()
        if not self._complete(now):
            self._report(now)
            return False
        self.bus.ack(self._batch)
        worked, self._batch = bool(self._batch), []
        self._report(now)
        return worked

    def leave(self) -> None:
        """The service ends in good order: what it has to say to that."""
        last_words: Callable[[float], Iterable[Message]] = getattr(self.service, "leave", lambda now: ())
        for said in last_words(self.clock()):
            self._publish(said)

    def _without_put_aside(self, came: list[Message]) -> list[Message]:
        self.received += len(came)
        held = [message for message in came if self.aside.holds(message)] if self.aside.any else []
        self.bus.ack(held)
        self.counters["aside"] += len(held)
        return [message for message in came if message not in held] if held else came

    def _complete(self, now: float) -> bool:
        """Handles what is left of the batch and ticks; False when something we need is away."""
        try:
            for message in self._batch[self._handled :]:
                self._one(message, now)
                self._handled += 1
            self._tick(now)
        except Unavailable as error:
            if not self._waiting_for:
                self.log.warning("waiting: %s", error)
            self._waiting_for = str(error) or "something we need"
            self.counters["unavailable"] += 1
            return False
        if self._waiting_for:
            self.log.info("going on, after waiting: %s", self._waiting_for)
            self._waiting_for = ""
        return True

    def _one(self, message: Message, now: float) -> None:
        try:
            for said in self.service.handle(message, now):
                self._publish(said)
        except BadMessage as error:
            self._dropped("bad", str(error), now)
        except DeviceError as error:
            self._dropped("device_errors", f"{message.topic}: {error}", now)
        except Unavailable:
            raise
        except BaseException:
            if not message.topic.startswith("/"):  # what we posted ourselves is no message of the bus
                self.aside.crashed(message, now)
            raise

    def _publish(self, message: Message) -> None:
        self.published += 1
        self.bus.publish(message)

    def _tick(self, now: float) -> None:
        try:
            for said in self.service.tick(now):
                self._publish(said)
        except BadMessage as error:  # what it has taken cannot be said
            self._dropped("bad", str(error), now)
            self._tick_again = now + PAUSE_S
        except DeviceError as error:
            self._dropped("device_errors", str(error), now)

    def _dropped(self, counter: str, text: str, now: float) -> None:
        self.counters[counter] += 1
        self._warned = (now, text)
        second, lines = self._logged
        if second != int(now):
            second, lines = int(now), 0
        self._logged = (second, lines + 1)
        if lines < LOGGED_PER_S:
            self.log.warning("dropped: %s", text)
        elif lines == LOGGED_PER_S:
            self.log.warning("dropped: more in this second, see the counters in service/%s/info", self.name)

    def _report(self, now: float) -> None:
        if now >= self._next_diagnostic:
            self._next_diagnostic = now + DIAGNOSTIC_EVERY_S
            self.bus.publish(DIAGNOSTICS.message(self._diagnostic(now), component=f"service/{self.name}"))
        if now >= self._next_info:
            self._next_info = now + INFO_EVERY_S
            self.bus.publish(SERVICE_INFO.message(self.info(), service=self.name))

    def info(self) -> ServiceInfo:
        """What the service says of itself on `service/<service>/info`."""
        counters: dict[str, float] = {
            "received": self.received,
            "published": self.published,
            **self.counters,
            **{str(name): float(value) for name, value in getattr(self.service, "counters", {}).items()},
            "dropped": self.bus.dropped,
            "connections": self.bus.connections,
        }
        return ServiceInfo(
            version=__version__, started=stamp(self._started), counters=counters, aside=self.aside.names()
        )

    def _diagnostic(self, now: float) -> Diagnostic:
        level, text = 0, "running"
        if self._waiting_for:
            level, text = 2, f"waiting: {self._waiting_for}"
        elif now - self._warned[0] < WARN_FOR_S:
            level, text = 1, f"dropped: {self._warned[1]}"
        values = {"received": str(self.received), "published": str(self.published), "bad": str(self.counters["bad"])}
        return Diagnostic(level=level, message=text[:400], values=values, hardware_id=self.name)
