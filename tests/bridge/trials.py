"""The bridge under traffic both ways while its broker and its ROS master come and go: what the soak makes many times.

Nothing may be lost but what was said while the broker was away; a new master must not cost anything.
"""

from __future__ import annotations

import json
import random
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import paho.mqtt.client as paho

from services.peers import wait_until
from tests.bridge import bench
from tests.bridge.bench_parts import mqtt_client
from tests.bridge.test_ros import publishers

RATE = 300.0  # messages a second, each way
TURN_S = 10.0
AROUND_S = 1.5  # before an outage what was under way may be lost with it; after it all must be there again
PATIENCE_S = 60.0
GROWTH_KB = 30_000
ITEMS = bench.ITEMS


@dataclass
class Road:
    """One direction: what was said when, and what arrived; numbers that grow."""

    said: dict[int, float] = field(default_factory=dict)
    came: set[int] = field(default_factory=set)
    newest_said: int = 0
    newest_came: int = 0

    def says(self, number: int, at: float) -> None:
        self.said[number] = at
        self.newest_said = number

    def takes(self, number: int) -> None:
        self.came.add(number)
        self.newest_came = max(self.newest_came, number)

    def flows(self, what: str) -> None:
        """Waits until what is said from now on arrives."""
        mark = self.newest_said
        wait_until(lambda: self.newest_came > mark, what, PATIENCE_S)

    def lost(self, outages: list[tuple[float, float]]) -> list[int]:
        """Numbers that are missing although nothing was out of order; what is older is forgotten."""
        due = [(number, at) for number, at in list(self.said.items()) if number <= self.newest_came]
        missing = [number for number, at in due if number not in self.came
                   and not any(begin - AROUND_S <= at <= end + AROUND_S for begin, end in outages)]  # fmt: skip
        for number, _ in due:
            self.said.pop(number)
            self.came.discard(number)
        return missing


@dataclass
class Traffic:
    """A bridge under load. `to_ros`, `to_mqtt`: both roads; `last`: the newest value that ROS heard of each item."""

    lab: bench.Lab
    to_ros: Road = field(default_factory=Road)
    to_mqtt: Road = field(default_factory=Road)
    last: dict[str, str] = field(default_factory=dict)
    outages: list[tuple[float, float]] = field(default_factory=list)
    ending: threading.Event = field(default_factory=threading.Event)
    memory_kb: int = 0
    turns: int = 0
    _client: paho.Client | None = None

    def start(self, ears: bench.Part) -> list[threading.Thread]:
        """Begins to say and to hear; ROS says nothing before somebody on MQTT hears it."""
        subscribed = threading.Event()
        self._client = client = mqtt_client(self.lab.port, "traffic")
        client.reconnect_delay_set(1, 1)
        client.on_connect = lambda *_: client.subscribe("home/+/set", qos=1)
        client.on_message = lambda _c, _d, message: self.to_mqtt.takes(int(message.payload))
        client.on_subscribe = lambda *_: subscribed.set()
        client.loop_start()
        assert subscribed.wait(PATIENCE_S)
        ears.go()
        threads = [threading.Thread(target=self._say), threading.Thread(target=self._hear, args=(ears,))]
        for thread in threads:
            thread.start()
        return threads

    def end(self) -> None:
        self.ending.set()
        assert self._client is not None
        self._client.disconnect()
        self._client.loop_stop()

    def _say(self) -> None:
        assert self._client is not None
        began, number = time.monotonic(), 0
        while not self.ending.wait(0.05):
            while number < (time.monotonic() - began) * RATE:
                if self._client.is_connected():
                    self.to_ros.says(number, time.monotonic())
                    self._client.publish(f"home/{ITEMS[number % len(ITEMS)]}/state", str(number), qos=1, retain=True)
                number += 1

    def _hear(self, ears: bench.Part) -> None:
        assert ears.process.stdout
        for line in ears.process.stdout:
            told = json.loads(line)
            for number, at in told["said"]:
                self.to_mqtt.says(number, at)
            for _, value in told["heard"]:
                self.to_ros.takes(int(value))
            self.last.update(told["heard"])

    def turn(self, rng: random.Random) -> float:
        """Some seconds of traffic with one accident; how long that took to be made good."""
        began = time.monotonic()
        self.ending.wait(rng.uniform(1.0, 3.0))
        seconds = rng.choice((self.lose_broker, self.lose_master))()
        self.ending.wait(max(1.0, TURN_S - (time.monotonic() - began)))
        for name, road in (("to ROS", self.to_ros), ("to MQTT", self.to_mqtt)):
            road.flows(f"what is said {name}")
            lost = road.lost(self.outages)
            assert not lost, f"{len(lost)} lost {name}, such as {lost[:3]}"
        self._weigh()
        return seconds

    def lose_broker(self) -> float:
        """It is reset, and has forgotten everything."""
        gone = time.monotonic()
        self.lab.restart_broker()
        back = time.monotonic()
        self.ending.wait(0.5)  # what was said before is told a few times a second only
        self.to_ros.flows("states on ROS again")
        self.to_mqtt.flows("a robot's word on MQTT again")
        self.outages.append((gone, time.monotonic()))
        return time.monotonic() - back

    def lose_master(self) -> float:
        """kill -9, and another one."""
        self.lab.master.kill()
        self.lab.master.start()
        back = time.monotonic()
        wait_until(lambda: publishers(self.lab.master, "/iot_updates") == ["/iot_bridge"], "registered", 30.0)
        return time.monotonic() - back

    def _weigh(self) -> None:
        """The memory of the bridge, from when it has met everything once."""
        status = Path(f"/proc/{self.lab.bridge_pid}/status").read_text()
        now = int(status.split("VmRSS:")[1].split()[0])
        self.turns += 1
        if self.turns == 3:
            self.memory_kb = now
        assert not self.memory_kb or now - self.memory_kb < GROWTH_KB, f"it grew from {self.memory_kb} to {now} kB"

    def settle(self) -> None:
        """At the end ROS has the last state of every item."""
        self.ending.set()
        finals = {item: f"{-1 - index}" for index, item in enumerate(ITEMS)}
        assert self._client is not None
        for item, value in finals.items():
            self._client.publish(f"home/{item}/state", value, qos=1, retain=True)
        wait_until(lambda: self.last == finals, "every item's last state", 30.0)


@contextmanager
def under_traffic() -> Iterator[Traffic]:
    """A bridge under load; at the end of the block every item's last state must be right."""
    keys = {"out": "/iot_set", "back": "/iot_updates", "keys": ITEMS, "rate": RATE}
    with bench.lab() as lab, lab.bridge(), lab.part("traffic", **keys) as ears:
        traffic = Traffic(lab)
        threads = traffic.start(ears)
        try:
            yield traffic
            traffic.settle()
        finally:
            traffic.end()
            ears.process.kill()
            for thread in threads:
                thread.join()
