"""What people do meanwhile: orders, commands, questions and missions, drawn from a seed. Nobody waits for answers.

Orders of the camera are heard until all is over, whoever gives them.
"""

from __future__ import annotations

import itertools
import json
import random
import threading
from dataclasses import dataclass, field

from services.client import Client, connected
from tests.chaos.motor import Motor
from tests.chaos.whole import Whole

EVERY_S = (0.3, 3.0)
HEARD = ("camera/ip1/order/+", "camera/ip1/position/set", "camera/ip1/order_result")


@dataclass
class Traffic:
    """In a thread; `said` by kind."""

    whole: Whole
    motor: Motor
    seed: int
    said: dict[str, int] = field(default_factory=dict)
    _quiet: threading.Event = field(default_factory=threading.Event)
    _stop: threading.Event = field(default_factory=threading.Event)

    def __enter__(self) -> Traffic:
        self._thread = threading.Thread(target=self._run, name="traffic", daemon=True)
        self._thread.start()
        return self

    def stop(self) -> None:
        """Nothing more is said; a mission that is under way still gives orders, so they are heard on."""
        self._quiet.set()

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(20)

    def _run(self) -> None:
        rng, numbers = random.Random(self.seed), itertools.count()
        with connected(self.whole.bus, HEARD) as bus:
            while not self._stop.is_set():
                if not self._quiet.is_set():
                    self._say(bus, rng, f"chaos-{next(numbers)}")
                bus.collect(rng.uniform(*EVERY_S))
                self.motor.hears(bus)

    def _say(self, bus: Client, rng: random.Random, name: str) -> None:
        kind = rng.choices(["goto", "move", "scan", "home", "history", "mission", "snapshot"], [4, 4, 1, 4, 2, 1, 1])[0]
        self.said[kind] = self.said.get(kind, 0) + 1
        if kind == "goto":
            order(bus, "Goto", rng.choice(["Kitchen", "Sofa", "Dining", "Hall"]), name)
        elif kind == "move":
            order(bus, "Move", rng.choice(["Left 3 0.5", "Right 2 2", "Up 4 0.5", "Down 2 1", "Stop"]), name)
        elif kind == "scan":
            order(bus, "Scan", rng.choice([True, True, False]), name)
        elif kind == "home":
            bus.say("home/Kitchen_Light/command", rng.choice(["ON", "OFF"]))
        elif kind == "history":
            bus.say("history/get", json.dumps({"id": name, "item": "Kitchen_Light", "limit": 10}))
        elif kind == "mission":
            bus.say("mission/tiago/order", json.dumps(rng.choice([{"find": 582, "id": name}, {"cancel": True}])))
        else:
            bus.say("camera/ip1/snapshot/get", "")


def order(bus: Client, key: str, value: object, name: str) -> None:
    """One that carries an id."""
    bus.say(f"camera/ip1/order/{key}", json.dumps({"value": value, "id": name}))
