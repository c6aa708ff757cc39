"""Trials of the whole apartment that the system test makes once and the soak many times.

Each does something bad, asserts that everybody is well again, and returns the figure that people want to see.
"""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from services import peers, topics
from services.client import Client, connected
from services.simulated import CONFIG, Simulated, start_mosquitto
from services.virtual import VirtualApartment

BUS_SERVICES = ("camera-ip1", "bridge", "persistence", "simulated-home")


@contextmanager
def virtual_flat(folder: Path, change: Callable[[Path], None] = lambda _: None) -> Iterator[VirtualApartment]:
    """The simulated apartment in virtual time, on a copy of its configuration and a database of its own.

    `change` is given the copy before anything reads it.
    """
    config = Path(shutil.copytree(CONFIG, folder / "config")) / "simulated.yaml"
    change(config)
    own = {"APARTMENT_DATABASE": f"sqlite:///{folder}/bus.db", "APARTMENT_WITHOUT_ROS": "true"}
    own["APARTMENT_STATE"] = str(folder / "state")
    with VirtualApartment(config, own) as flat:
        yield flat


def pids(flat: Simulated, without: str = "") -> dict[str, int]:
    """The processes as they are, all but one."""
    children = flat.supervisor.children.values()
    return {child.name: child.process.pid for child in children if child.process and child.name != without}


def settled(flat: Simulated, name: str, killed: int = 0) -> int:
    """The pid of a service that runs and is ready; it is another one than that of a process that was killed."""
    child = flat.supervisor.children[name]

    def runs() -> bool:
        return child.process is not None and child.process.pid != killed and child.ready is not None

    peers.wait_until(runs, f"{name} to be ready")
    assert child.process is not None
    return child.process.pid


def kill(flat: Simulated, name: str) -> float:
    """kill -9 of one service; seconds until it is online again. Nobody else may come or go."""
    pid, others = settled(flat, name), pids(flat, name)
    with connected(flat.apartment.bus, ["service/+/status"]) as bus:
        bus.payload(f"service/{name}/status", lambda text: text == "online")
        bus.forget()
        os.kill(pid, signal.SIGKILL)
        killed = time.monotonic()
        for state in ("offline", "online"):
            bus.until(lambda m, state=state: m.topic == f"service/{name}/status" and m.payload == state.encode(), 10.0)  # type: ignore[misc]
        seconds = time.monotonic() - killed
        noticed = {message.topic for message in bus.seen if not message.retain}
    assert noticed == {f"service/{name}/status"}
    assert pids(flat, name) == others
    settled(flat, name, killed=pid)
    return seconds


def kill_camera(flat: Simulated) -> float:
    """kill -9 of the simulated camera; seconds until an order is done again. It may be back before it is missed."""
    pid, others = settled(flat, "simulated-camera"), pids(flat, "simulated-camera")
    with connected(flat.apartment.bus, ["camera/ip1/#"]) as bus:
        bus.payload("camera/ip1/status", lambda status: status.state == "online")
        os.kill(pid, signal.SIGKILL)
        killed = time.monotonic()
        answers: list[str] = []

        def carried_out() -> bool:
            result = bus.order("ip1", "Goto", "Dining")
            answers.append(f"{result.state} {result.error or ''}")
            return result.state == "done"

        peers.wait_until(carried_out, f"an order to be done; answers: {answers}", 60.0)
        seconds = time.monotonic() - killed
        bus.forget()
    assert pids(flat, "simulated-camera") == others
    settled(flat, "simulated-camera", killed=pid)
    return seconds


def restart_broker(flat: Simulated, how: signal.Signals) -> float:
    """Ends the broker and starts it again; seconds until every service is connected, online and heard.

    That they are connected is read in the broker's own log: a retained `online` may be from before.
    """
    before, parts = pids(flat), flat.parts
    log = parts.folder / "mosquitto" / "mosquitto.log"
    if how is signal.SIGKILL:
        os.kill(parts.broker_pid, signal.SIGKILL)
    parts.broker.close()
    old = len(log.read_text())
    start_mosquitto(parts)
    back = time.monotonic()
    peers.wait_until(
        lambda: all(_came_back(name, log.read_text()[old:]) for name in BUS_SERVICES), "all services", 10.0
    )
    with connected(flat.apartment.bus, ["service/+/status", "home/Kitchen_Light/+", "camera/ip1/#"]) as bus:
        for name in BUS_SERVICES:
            bus.payload(f"service/{name}/status", lambda text: text == "online")
        assert bus.order("ip1", "SetTarget", "582").state == "done"
        seconds = time.monotonic() - back
        bus.payload("camera/ip1/places")
        switch(bus)
    assert pids(flat) == before
    return seconds


def _came_back(name: str, log: str) -> bool:
    """Whether the broker tells of a connection of that service, whose name there has a part that nobody can guess."""
    return re.search(rf" as {name}(-[0-9a-f]{{16}})? \(", log) is not None


def switch(bus: Client) -> None:
    """The kitchen light goes on and off: a command arrives, and its answer does."""
    for state in ("ON", "OFF"):
        bus.forget()
        bus.say("home/Kitchen_Light/command", state)
        bus.payload("home/Kitchen_Light/state", lambda text, state=state: text == state, 60.0)  # type: ignore[misc]


def rubbish(flat: Simulated, count: int, seed: int) -> dict[str, float]:
    """Messages of rubbish under the filters that people subscribe to; how many each service counted as bad."""
    before, rng = pids(flat), random.Random(seed)
    with connected(flat.apartment.bus, ["service/+/info", "home/Kitchen_Light/state"]) as bus:
        counted = {name: counters(bus, name, 0)["bad"] for name in BUS_SERVICES}
        for number in range(count):
            bus.say(rubbish_topic(rng), rubbish_payload(rng), qos=number % 2)
            if number % 500 == 0:
                bus.forget()
        switch(bus)
        bad = {name: counters(bus, name, counted[name] + 1)["bad"] - counted[name] for name in BUS_SERVICES}
    assert pids(flat) == before
    return bad


def counters(bus: Client, name: str, bad: float) -> dict[str, float]:
    """What a service counts, once it has counted so many bad messages."""
    return dict(bus.payload(f"service/{name}/info", lambda info: info.counters["bad"] >= bad, 60.0).counters)


def rubbish_topic(rng: random.Random) -> str:
    row = rng.choice([row for row in topics.TABLE if row.payload is not bytes])
    levels = {
        "cam": rng.choice(["ip1", "ip2", "x" * 50]),
        "service": rng.choice(["nobody", "a-b"]),
        "component": "x/y",
        "item": rng.choice(["Kitchen_Light", "Hall_Dimmer", "No_Such_Item", "Lamp_Color"]),
        "key": rng.choice(["Goto", "Scan", "Nonsense"]),
        "marker": str(rng.randrange(2000)),
        "robot": rng.choice(["tiago", "nobody"]),
        "attribute": "$state",
        "trait": "$name",
        **dict.fromkeys(("platform", "entity", "id", "device", "node", "property"), "x"),
    }
    return re.sub(r"<(\w+)>", lambda m: levels[m[1]], row.pattern) + rng.choice(["", "", "", "/more", "é"])


def rubbish_payload(rng: random.Random) -> bytes:
    kind = rng.randrange(8)
    if kind == 0:
        return rng.randbytes(rng.randrange(200))
    if kind == 1:
        return b"[" * rng.randrange(1, 20_000)
    if kind == 2:
        return b'{"value":' * 500 + b"1" + b"}" * 500
    if kind == 3:
        return b"x" * (300_000 if rng.random() < 0.05 else 5000)
    if kind == 4:
        return b"\xff\xfe" + rng.randbytes(20)
    if kind == 5:
        return json.dumps(
            {"value": {"targets": [rng.choice([-1, 1e308, "x", None])]}, "id": "x" * rng.choice([3, 300])}
        ).encode()
    if kind == 6:
        return b"NaN"
    return "".join(chr(rng.randrange(1, 0x2FF)) for _ in range(30)).encode()
