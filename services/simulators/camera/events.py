"""The camera's alarms: who listens, what is going on, and how it is written into an endless answer."""

from __future__ import annotations

from queue import Empty, SimpleQueue
from threading import Lock

BOUNDARY = "myboundary"
START = (
    "HTTP/1.1 200 OK\r\nCache-Control: no-cache\r\nPragma: no-cache\r\nExpires: Thu, 01 Dec 2099 16:00:00 GMT\r\n"
    f"Connection: Keep-Alive\r\nContent-Type: multipart/x-mixed-replace; boundary={BOUNDARY}\r\n\r\n"
).encode()


def part(text: str) -> bytes:
    """One part of the endless answer, as firmware of the 941's age writes it (form B)."""
    return f"--{BOUNDARY}\r\nContent-Type: text/plain\r\nContent-Length:{len(text)}\r\n\r\n{text}\r\n\r\n".encode()


def wanted(codes: str) -> frozenset[str]:
    """The codes of a request's `codes=[VideoMotion,AlarmLocal]`; `All` stands for every one."""
    return frozenset(code for code in codes.strip("[]").split(",") if code)


class Subscription:
    """One listener's queue."""

    def __init__(self, codes: frozenset[str]) -> None:
        self.codes = codes
        self._waiting: SimpleQueue[str] = SimpleQueue()

    def tell(self, code: str, text: str) -> None:
        """Hands an event on, if it was asked for."""
        if code in self.codes or "All" in self.codes:
            self._waiting.put(text)

    def wake(self) -> None:
        """Ends a wait at once (the listener's connection is to be closed)."""
        self._waiting.put("")

    def next(self, timeout_s: float) -> str | None:
        """The next event's text; None when none came in that time, empty when woken."""
        try:
            return self._waiting.get(timeout=timeout_s)
        except Empty:
            return None


class Events:
    """What is going on, and who wants to know. For several threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._listeners: list[Subscription] = []
        self._on: dict[str, set[int]] = {}

    def subscribe(self, codes: frozenset[str]) -> Subscription:
        """A new listener; it must be given back to `leave`."""
        with self._lock:
            self._listeners.append(Subscription(codes))
            return self._listeners[-1]

    def leave(self, subscription: Subscription) -> None:
        """The listener has gone."""
        with self._lock:
            self._listeners.remove(subscription)

    def tell(self, code: str, action: str, index: int = 0) -> None:
        """Something begins (`Start`), ends (`Stop`) or happens (`Pulse`)."""
        with self._lock:
            active = self._on.setdefault(code, set())
            if action == "Start":
                active.add(index)
            elif action == "Stop":
                active.discard(index)
            for listener in self._listeners:
                listener.tell(code, f"Code={code};action={action};index={index}")

    def active(self, code: str) -> list[int]:
        """The channels on which this is going on."""
        with self._lock:
            return sorted(self._on.get(code, ()))

    def wake_all(self) -> None:
        """Ends every listener's wait."""
        with self._lock:
            for listener in self._listeners:
                listener.wake()
