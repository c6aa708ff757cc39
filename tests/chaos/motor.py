"""Whether a motor turned without an order: the camera's true motion, beside every order that was on the bus.

An order allows motion from when it is given until its answer that ends it, until the service that carries it out has
died, or for LONGEST_S; and then for as long as a stop takes. While the camera cannot be reached nobody can stop it.
"""

from __future__ import annotations

import json
import threading
import time
from dataclasses import dataclass, field

import httpx

from services.client import Client
from services.payloads import FINAL
from tests.chaos.whole import Whole

EVERY_S = 0.2
STOPPED_S = 4.0  # after an end: the longest until the motor stands, on a busy machine
REACHED_S = 8.0  # after the camera can be reached again
LONGEST_S = 240.0  # a scan
NAMELESS_S = 20.0  # an order without an id


@dataclass
class Given:
    """An order as it was heard, and when it ended."""

    at: float
    what: str
    until: float = float("inf")


@dataclass
class Motor:
    """Watches in a thread; hears the bus by `heard`, from the traffic's thread."""

    whole: Whole
    orders: dict[str, Given] = field(default_factory=dict)
    turning: list[tuple[float, dict[str, float]]] = field(default_factory=list)
    deaths: list[float] = field(default_factory=list)
    unreachable: list[tuple[float, float]] = field(default_factory=list)
    samples: int = 0
    _stop: threading.Event = field(default_factory=threading.Event)

    def __enter__(self) -> Motor:
        self._thread = threading.Thread(target=self._run, name="motor", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(40)

    def pause(self, seconds: float) -> None:
        """Waits, unless all is over."""
        self._stop.wait(seconds)

    def _run(self) -> None:
        pid, door = self.whole.pid("camera-ip1"), httpx.Client(base_url=self.whole.door.url, timeout=10)
        with door:
            while not self._stop.wait(EVERY_S):
                now = time.monotonic()
                if (after := self.whole.pid("camera-ip1")) != pid:
                    pid = after
                    self.deaths.append(now)
                try:
                    state = door.get("/state").json()
                except httpx.HTTPError:
                    continue
                self.samples += 1
                if state["moving"]:
                    self.turning.append((now, state["pose"]))

    def hears(self, bus: Client) -> None:
        """Takes what came: orders, and their answers."""
        ahead = time.monotonic() - time.time()
        for message in bus.seen:
            now = message.received + ahead
            if message.topic == "camera/ip1/order_result":
                told = json.loads(message.payload)
                if told["state"] in FINAL and told.get("id") in self.orders:
                    self.orders[told["id"]].until = min(self.orders[told["id"]].until, now)
            elif message.topic.startswith(("camera/ip1/order/", "camera/ip1/position/set")):
                name = _id(message.payload)
                given = Given(now - EVERY_S, f"{message.topic} {message.payload[:80]!r}")
                if name is None:
                    given.until = now + NAMELESS_S
                self.orders[name or f"nameless {len(self.orders)}"] = given
        bus.seen.clear()

    @property
    def unbidden(self) -> list[str]:
        """Each moment in which it turned though it should have stood."""
        found = []
        for at, pose in self.turning:
            if not any(self._allows(given, at) for given in self.orders.values()) and not self._cannot(at):
                before = [given for given in self.orders.values() if given.at <= at]
                found.append(f"at {at:.1f} {pose} after {before[-1:]}, deaths {self.deaths}")
        return found

    def _allows(self, given: Given, at: float) -> bool:
        ends = [given.until, given.at + LONGEST_S, *(death for death in self.deaths if death > given.at)]
        return given.at <= at <= min(ends) + STOPPED_S

    def _cannot(self, at: float) -> bool:
        return any(since <= at <= until + REACHED_S for since, until in self.unreachable)


def _id(payload: bytes) -> str | None:
    try:
        return str(json.loads(payload)["id"])
    except (ValueError, KeyError, TypeError):
        return None
