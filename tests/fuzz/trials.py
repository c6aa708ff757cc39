"""The whole apartment under rubbish: messages on every topic in every role, and HTTP on every port of ours.

Nobody stops, grows or tells of an exception, what is bad is counted, and afterwards everybody answers as before. The
tests send some thousands, `make soak PART=fuzz` a hundred thousand; the seed is printed.
"""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx

from services import topics
from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.client import Client, connected
from services.peers import wait_until
from services.topics import CAMERA_ORDER_RESULT, CAMERA_STREAM
from tests.chaos.trials import call_off, crashes, pids
from tests.chaos.verdict import seconds_until_green
from tests.chaos.vitals import Vitals
from tests.chaos.whole import Whole, whole
from tests.fuzz import messages, requests

ROUND = 500  # messages, after which everybody has to have heard them
REQUESTS = 0.1  # for each message
GREEN_S = 60.0
AT_ONCE = 4  # requests
KEEPS_UP_S = 120.0
SCAN_S = 300.0
LISTENING = (
    "simulated-home",
    "persistence",
    "history",
    "camera-ip1",
    "bridge",
    "hubs",
    "mission",
    "dashboard",
    "metrics",
)
log = logging.getLogger("fuzz")


@dataclass
class Found:
    """What came of it."""

    messages: int
    requests: int
    seconds: float
    bad: dict[str, float]
    answers: Counter[str]
    leaks: list[str]
    crashes: list[str]
    restarted: list[str]

    @property
    def faults(self) -> dict[str, object]:
        """What must not be."""
        wrong = {
            "leaks": self.leaks,
            "crashes": self.crashes,
            "restarted": self.restarted,
            "not counted": [name for name, count in self.bad.items() if not count],
            "answers": [status for status in self.answers if status.startswith("500")],  # 501: no such method
        }
        return {what: one for what, one in wrong.items() if one}


@contextmanager
def apartment(folder: Path) -> Iterator[Whole]:
    """All of it."""
    with whole(folder) as running:
        yield running


def warm(running: Whole) -> None:
    """A whole scan: what that needs of memory is no growth when rubbish happens to order one late."""
    with connected(running.bus, [CAMERA_ORDER_RESULT.filter]) as bus:
        result = bus.order("ip1", "Scan", {"full": True}, SCAN_S)
    assert result.state == "done", result


def fuzz(running: Whole, seed: int, count: int) -> Found:
    """So many messages, and a tenth as many requests."""
    log_begins, before, vitals, began = running.flat.log.stat().st_size, pids(running), Vitals(), time.monotonic()
    source = messages.Source(seed, running.flat.apartment.instances["persistence"].config.home, running.services)  # type: ignore[attr-defined]
    answers: Counter[str] = Counter()
    with ExitStack() as stack:
        roles = {role: stack.enter_context(_client(running, role)) for role in ("", *_roles())}
        bus = stack.enter_context(connected(running.bus, ["home/Kitchen_Light/state", "service/+/info"]))
        counted = {name: _bad(bus, name, 0) for name in LISTENING}
        ports = _ports(running, seed)
        for done in range(0, count, ROUND):
            for _ in range(min(ROUND, count - done)):
                message, role = source.draw()
                roles.get(role, roles[""]).bus.publish(message._replace(once=True))
            for client in roles.values():
                client.pump()
            answers.update(_requests(ports, round(min(ROUND, count - done) * REQUESTS)))
            _heard(bus, roles)
            vitals.look(pids(running))
        bad = {name: _bad(bus, name, counted[name] + 1) - counted[name] for name in LISTENING}
        for topic in source.retained:
            roles[""].say(topic, b"", retain=True)
    told = running.flat.log.read_text(errors="replace")[log_begins:]
    restarted = [name for name, pid in pids(running).items() if before[name] != pid]
    seconds = time.monotonic() - began
    _well_again(running)
    vitals.look(pids(running))
    for life in vitals.survivors:
        log.warning("%-17s %s now, grown %s", life.name, life.now, {k: round(v, 1) for k, v in life.grown.items()})
    return Found(count, answers.total(), seconds, bad, answers, vitals.leaks, crashes(told), restarted)


def _well_again(running: Whole) -> None:
    """Who was told wrong states of others is told the right ones when they meet the broker again."""
    call_off(running)
    running.stop_broker()
    running.start_broker()
    seconds_until_green(running, time.monotonic(), GREEN_S)


def _roles() -> list[str]:
    """Accounts that are nobody's of the running, or that may be doubled."""
    return sorted({role for row in topics.TABLE for role in row.writers if "<" not in role} | {"operator"})


@contextmanager
def _client(running: Whole, role: str) -> Iterator[Client]:
    password = running.parts.environment.get(f"BUS_{role.upper()}_PASSWORD")
    name = f"fuzz-{role or 'anybody'}"
    bus = MqttBus(Address(name, port=running.parts.broker_port, user=role or None, password=password))
    try:
        wait_until(lambda: bool(bus.receive(0.02)) or bus.connected, f"{name} at the broker")
        yield Client(bus)
    finally:
        bus.close()


def _heard(bus: Client, roles: dict[str, Client]) -> None:
    """Until what was sent is at the broker, and everybody behind it answers."""

    def sent() -> bool:
        for client in roles.values():
            client.pump()
        return all(not client.bus._in_flight for client in roles.values())  # type: ignore[attr-defined]

    wait_until(sent, "the broker to take it all", KEEPS_UP_S)
    bus.forget()
    for state in ("OFF", "ON"):
        bus.say("home/Kitchen_Light/command", state)
    bus.payload("home/Kitchen_Light/state", lambda text: text == "ON", KEEPS_UP_S)
    bus.forget()


def _bad(bus: Client, name: str, least: float) -> float:
    """What a service has counted as bad; 0 more where it never counts so much."""
    try:
        info = bus.payload(f"service/{name}/info", lambda info: info.counters["bad"] >= least, 20.0)
    except TimeoutError:
        return least - 1
    return float(info.counters["bad"])


def _ports(running: Whole, seed: int) -> list[requests.Source]:
    """Dashboard (with and without the session's token), the camera's stream, metrics."""
    page = running.flat.supervisor.children["dashboard"].ready
    metrics = running.flat.supervisor.children["metrics"].ready
    assert page is not None
    assert metrics is not None
    api = httpx.get(f"{page['url']}api/openapi.json", trust_env=False).json()
    token = httpx.get(f"{page['url']}api/session", trust_env=False).json()["csrf"]
    with connected(running.bus, [CAMERA_STREAM.filter]) as bus:
        stream = httpx.URL(bus.payload(CAMERA_STREAM.name(cam="ip1")).url)
    paths = [*api["paths"], "/", "/main.js", "/style.css", "/favicon.ico"]
    others = ["/camera/ip1/rtsp.mjpg", "/camera/ip1/snapshot.jpg", "/camera/{x}/stream.mjpg"]
    return [
        requests.Source(seed, page["port"], paths, {"X-CSRF-Token": token}),
        requests.Source(seed + 1, page["port"], paths, {}),
        requests.Source(seed + 2, int(stream.port or 80), [stream.path, *others], {}),
        requests.Source(seed + 3, int(httpx.URL(metrics["metrics"]).port or 80), ["/metrics", "/", "/favicon.ico"], {}),
    ]


def _requests(ports: list[requests.Source], count: int) -> Counter[str]:
    drawn = [(source.port, source.draw()) for number in range(count) for source in [ports[number % len(ports)]]]
    with ThreadPoolExecutor(AT_ONCE) as pool:
        answers = pool.map(lambda one: requests.exchange(*one), drawn)
    return Counter(_status(answer) for answer in answers)


def _status(answer: bytes) -> str:
    words = answer.partition(b"\r\n")[0].split(b" ", 2)
    return words[1].decode() if len(words) > 1 and words[0].startswith(b"HTTP/") else "no answer"
