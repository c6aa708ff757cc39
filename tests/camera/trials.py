"""Trials of cameras on real parts that the tests make once and the soak many times.

Each does something bad, asserts what is promised about it, and returns the figure that people want to see.
"""

from __future__ import annotations

import time
from statistics import median
from typing import Any

from services.client import Client
from tests.small_flat import SmallFlat

NOTICED_S = 15.0  # a fault shows in the status within this
TURNS = 9  # orders per camera, before and while


def hang(flat: SmallFlat, victim: str) -> float:
    """One of several cameras answers nobody; how much longer an order of the others takes then (ratio of medians)."""
    others = [name for name in flat.doors if name != victim]
    with flat.client("camera/+/order_result", "camera/+/status") as bus:
        before = latency(bus, others)
        flat.doors[victim].tell("freeze", on=True)
        try:
            bus.say(f"camera/{victim}/order/Move", "Left 2 20")  # so that something of it is on its way all the time
            during = latency(bus, others)
            bus.payload(f"camera/{victim}/status", lambda status: status.state != "online", NOTICED_S)
            during += latency(bus, others)
        finally:
            flat.doors[victim].tell("freeze", on=False)
        lost = [name for name in others if not online(bus, name)]
        bus.forget()
        bus.payload(f"camera/{victim}/status", lambda status: status.state == "online", 30.0)
        assert bus.order(victim, "Flip", "True").state == "done"
    assert lost == []
    return median(during) / median(before)


def latency(bus: Client, cameras: list[str]) -> list[float]:
    """Seconds from an order to its end, in turn for each of these cameras; the camera is asked for every one."""
    seconds = []
    for _ in range(TURNS):
        for name in cameras:
            began = time.monotonic()
            result = bus.order(name, "Flip", "True")
            seconds.append(time.monotonic() - began)
            assert result.state == "done", result
            bus.seen[:] = [message for message in bus.seen if message.topic.endswith("/status")]
    return seconds


def online(bus: Client, camera: str) -> bool:
    """Whether the newest status of a camera, as far as it was heard, says so."""
    return b'"online"' in newest(bus, f"camera/{camera}/status")


def newest(bus: Client, topic: str) -> bytes:
    """The newest payload that was heard there."""
    said: list[Any] = [message.payload for message in bus.seen if message.topic == topic]
    return bytes(said[-1]) if said else b""
