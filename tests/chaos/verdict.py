"""What has to hold when all faults are over: everybody is well, nothing wrong is retained, every row is there once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import uuid
from collections import Counter
from collections.abc import Callable
from contextlib import suppress

import httpx
from prometheus_client.parser import text_string_to_metric_families

from services import topics
from services.bus import Message
from services.client import Client, connected
from services.errors import BadMessage, Unavailable
from services.peers import wait_until
from services.storage import open_storage, read_address
from services.topic import Kind
from tests.chaos.whole import NUMBERED, Whole

DRAINED_S = 60.0
SHARP_DEG = 0.5
Check = Callable[[], bool]


def green(whole: Whole, bus: Client) -> dict[str, Check]:
    """By name what everybody has to be, as people see it from outside; each may be asked again."""
    newest: dict[str, Message] = {}
    page = whole.flat.supervisor.children["dashboard"]
    metrics = whole.flat.supervisor.children["metrics"]

    def said(topic: str) -> bytes:
        for message in bus.pump():
            newest[message.topic] = message
        bus.seen.clear()
        return newest[topic].payload if topic in newest else b""

    def diagnostic(component: str) -> bool:
        told = said(f"diagnostics/{component}")
        return bool(told) and not newest[f"diagnostics/{component}"].retain and json.loads(told)["level"] < 2

    def switched() -> bool:
        wanted = "OFF" if said("home/Kitchen_Light/state") == b"ON" else "ON"
        bus.say("home/Kitchen_Light/command", wanted)
        return _within(2.0, lambda: said("home/Kitchen_Light/state") == wanted.encode())

    def asked() -> bool:
        name = uuid.uuid4().hex
        bus.say("history/get", json.dumps({"id": name, "item": "Kitchen_Light", "limit": 3}))
        return _within(2.0, lambda: b'"error":null' in said(f"history/reply/{name}"))

    def found() -> bool:
        name = uuid.uuid4().hex
        bus.say("mission/tiago/where", json.dumps({"marker": 582, "id": name}))
        return _within(2.0, lambda: bool(said(f"mission/tiago/where/reply/{name}")))

    def ordered() -> bool:
        name = uuid.uuid4().hex
        bus.say("camera/ip1/order/Flip", json.dumps({"value": True, "id": name}))

        def done() -> bool:
            told = said("camera/ip1/order_result")
            return bool(told) and json.loads(told)["id"] == name and json.loads(told)["state"] == "done"

        return _within(3.0, done)

    def shown() -> bool:
        return page.ready is not None and bool(_asked(f"{page.ready['url']}api/broker").get("online"))

    def counted() -> bool:
        return metrics.ready is not None and _online(metrics.ready["metrics"]) >= set(whole.services) - {
            "simulated-camera"
        }

    checks: dict[str, Check] = {
        "camera online": lambda: b'"online"' in said("camera/ip1/status"),
        "alarm listens": lambda: b'"value":-1' not in said("camera/ip1/motion"),
        "home": switched,
        "history": asked,
        "mission": found,
        "order": ordered,
        "page": shown,
        "metrics": counted,
        "ROS": lambda: diagnostic("bridge"),
        "database": lambda: diagnostic("persistence/broker"),
        "robot": lambda: said("robot/tiago/pose") != b"",
    }
    for name in whole.services:
        if name != "simulated-camera":
            checks[f"{name} online"] = lambda name=name: said(f"service/{name}/status") == b"online"  # type: ignore[misc]
        if name not in ("simulated-camera", "metrics", "hubs"):
            checks[f"{name} well"] = lambda name=name: diagnostic(f"service/{name}")  # type: ignore[misc]
    return checks


def slowness() -> float:
    """How much longer than its own computing a program takes here now: 1 on an idle machine."""
    began, before = time.monotonic(), os.times()
    subprocess.run([sys.executable, "-c", "import services.dashboard"], check=True)
    after = os.times()
    computing = after.children_user + after.children_system - before.children_user - before.children_system
    return max(1.0, (time.monotonic() - began) / max(computing, 0.05))


def seconds_until_green(whole: Whole, since: float, limit_s: float) -> float:
    """Since that moment (monotonic); AssertionError tells who is not well by then."""
    with connected(whole.bus, ["#"]) as bus:
        left = green(whole, bus)

        def well() -> bool:
            for name, check in list(left.items()):
                if check():
                    del left[name]
            return not left

        with suppress(TimeoutError):
            wait_until(well, "everybody to be well", limit_s)
        assert not left, f"{time.monotonic() - since:.1f} s after the last fault: {', '.join(left)}"
    return time.monotonic() - since


def _within(seconds: float, happened: Check) -> bool:
    with suppress(TimeoutError):
        wait_until(happened, "", seconds)
        return True
    return False


def _asked(url: str) -> dict[str, object]:
    try:
        answer: dict[str, object] = httpx.get(url, timeout=5, trust_env=False).json()
    except (httpx.HTTPError, ValueError):
        return {}
    return answer


def _online(url: str) -> set[str]:
    try:
        text = httpx.get(url, timeout=5, trust_env=False).text
    except httpx.HTTPError:
        return set()
    samples = [one for family in text_string_to_metric_families(text) for one in family.samples]
    return {one.labels["service"] for one in samples if one.name == "apartment_service_online" and one.value == 1.0}


def lost_and_doubled(whole: Whole, acknowledged: set[int], said: int) -> tuple[list[int], list[int]]:
    """Numbers that were acknowledged and are not stored; that are stored more than once, or were never said."""
    counted: Counter[int] = Counter()

    def complete() -> bool:
        counted.clear()
        with suppress(Unavailable):
            counted.update(_stored(whole))
        return acknowledged <= counted.keys()

    with suppress(TimeoutError):
        wait_until(complete, "every row", DRAINED_S)
    doubled = sorted(number for number, times in counted.items() if times > 1 or not 0 <= number < said)
    return sorted(acknowledged - counted.keys()), doubled


def _stored(whole: Whole) -> list[int]:
    server = whole.parts.database
    assert server is not None
    storage = open_storage(read_address(server.tcp_url, password=server.password))
    names = ",".join(f"'{name}'" for name in NUMBERED)
    try:
        return [
            int(num)
            for (num,) in storage.read(
                "SELECT s.num FROM item i JOIN sample s ON s.item_id=i.item_id "
                f"WHERE i.name IN ({names}) AND s.num IS NOT NULL"
            )
        ]
    finally:
        storage.close()


def wrong_retained(whole: Whole) -> list[str]:
    """What stands retained and should not: what is no state, cannot be read, or does not say what is."""
    with connected(whole.bus, ["#"]) as bus:
        bus.collect(2.0)
        kept = {message.topic: message for message in bus.seen if message.retain}
        wrong = [f"{topic}: {fault}" for topic, message in kept.items() if (fault := _fault(message))]
        wrong += [
            f"{topic}: {_text(kept, topic)}"
            for topic in kept
            if topic.endswith("/scan/state") and json.loads(kept[topic].payload)["state"] == "running"
        ]
        wrong += _about_the_camera(whole, kept)
        wrong += _about_the_home(whole, bus, kept)
    return wrong


def _fault(message: Message) -> str:
    try:
        known = topics.read(message, message.received)
    except BadMessage as error:
        return str(error)
    return "" if known.topic.kind is Kind.STATE else f"retained {known.topic.kind.value}"


def _text(kept: dict[str, Message], topic: str) -> str:
    return kept[topic].payload.decode(errors="replace")[:200] if topic in kept else "nothing"


def _about_the_camera(whole: Whole, kept: dict[str, Message]) -> list[str]:
    state = whole.door.state()
    told, true = json.loads(kept["camera/ip1/position"].payload), state["reading"]
    off = max(abs((told[axis] - true[axis] + 180) % 360 - 180) for axis in ("pan", "tilt"))
    wrong = off > SHARP_DEG or told["moving"] != state["moving"]
    return [f"camera/ip1/position: {told}, really {true}"] if wrong else []


def _about_the_home(whole: Whole, bus: Client, kept: dict[str, Message]) -> list[str]:
    """The home is told to say all its states again: it does when it meets the broker. What differs, was wrong."""
    bus.forget()
    line = whole.broker["simulated-home"]
    line.cut()
    bus.until(lambda one: one.topic == "service/simulated-home/status" and one.payload == b"offline", 30.0)
    line.mend()
    bus.until(lambda one: one.topic == "service/simulated-home/status" and one.payload == b"online", 30.0)
    bus.collect(2.0)
    true = {one.topic: one.payload for one in bus.seen if not one.retain and one.topic.startswith("home/")}
    return [
        f"{topic}: {_text(kept, topic)}, really {payload.decode()}"
        for topic, payload in true.items()
        if topic.endswith("/state") and not _lives(topic) and (topic not in kept or kept[topic].payload != payload)
    ]


def _lives(topic: str) -> bool:
    """Items that change by themselves, or that are ours."""
    return any(word in topic for word in ("Temp", "Humidity", "Power", "Motion", "Chaos", "Presence", "Time", "Sun"))
