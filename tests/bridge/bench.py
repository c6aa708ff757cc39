"""The bridge's benchmark: latency and throughput both ways on real parts, each beside its floor of the same run.

Floors: a bare paho subscriber to the same publisher, and a bare loop from paho's callback to rospy's publish.
`python -m tests.bridge.bench` prints it alone; `make bench` has it in its table.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from services.client import connected
from services.config import BusSettings
from services.peers import Missing, end, mosquitto, ros
from tests.bridge import patterns
from tests.bridge.conftest import ROOT
from tests.bridge.test_pictures import IMAGE, listening

MESSAGES, PACED, RATE = 20_000, 5_000, 1000.0
TRIPS, TRIP_RATE = 1_000, 100.0
PICTURES, PICTURES_FPS = 150, 15.0
ITEMS = [f"Number_{index}" for index in range(200)]
STATES = [f"home/{item}/state" for item in ITEMS]
RULES = """
  - {direction: to_mqtt, ros: flat_0, type: diagnostic_msgs/KeyValue, mqtt: 'flat/0/{key}', payload: '{value}', qos: 0}
  - {direction: to_mqtt, ros: flat_1, type: diagnostic_msgs/KeyValue, mqtt: 'flat/1/{key}', payload: '{value}'}
  - {direction: to_mqtt, ros: trip_out, type: diagnostic_msgs/KeyValue, mqtt: 'bench/{key}', payload: '{value}'}
  - {direction: to_ros, mqtt: 'bench/{key}', ros: trip_back, type: diagnostic_msgs/KeyValue,
     fields: {key: '{key}', value: '{payload}'}}
"""


@dataclass(frozen=True)
class Row:
    """One figure with its floor; `wanted` in words."""

    name: str
    unit: str
    value: float
    floor: float | None
    floor_is: str
    wanted: str


class Part:
    """One of `bench_parts.py`; ready when this is made."""

    def __init__(self, environment: dict[str, str], name: str, **arguments: Any) -> None:
        command = [sys.executable, "-m", "tests.bridge.bench_parts", name, json.dumps(arguments)]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT, env=environment, text=True
        )

    def ready(self) -> None:
        """Waits until it may begin."""
        assert self.process.stdout
        line = self.process.stdout.readline()
        assert line == "READY\n", line

    def go(self) -> None:
        """Lets it begin."""
        assert self.process.stdin
        self.process.stdin.write("go\n")
        self.process.stdin.flush()

    def result(self) -> dict[str, float]:
        """What it measured."""
        assert self.process.stdout
        figures: dict[str, float] = json.loads(self.process.stdout.readline())
        return figures


@dataclass
class Lab:
    """A broker, a master, and whatever is started on them."""

    port: int
    environment: dict[str, str]
    folder: Path
    broker: ExitStack
    master: ros.Master
    bridge_pid: int = 0

    @contextmanager
    def part(self, name: str, *, started: bool = False, **arguments: Any) -> Iterator[Part]:
        """Runs a part until the end of the block; `started`: it does not wait for a word."""
        part = Part(self.environment, name, **arguments)
        try:
            if not started:
                part.ready()
            yield part
        finally:
            end(part.process)
            for pipe in (part.process.stdin, part.process.stdout):
                assert pipe
                pipe.close()

    def restart_broker(self) -> None:
        """As if its machine had been reset, and nothing was kept: on the same port, without what it remembered."""
        self.broker.close()
        (self.folder / "mosquitto" / "mosquitto.db").unlink(missing_ok=True)
        self.broker.enter_context(mosquitto.private(self.folder / "mosquitto", port=self.port, anonymous=True))

    @contextmanager
    def bridge(self) -> Iterator[None]:
        """The service as an installation runs it."""
        config = self.folder / "apartment.yaml"
        command = [sys.executable, "-m", "services", "serve", "bridge", "--config", str(config)]
        with (self.folder / "bridge.log").open("ab") as log:
            process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=log, cwd=ROOT, env=self.environment, text=True
            )
        try:
            assert process.stdout
            while not process.stdout.readline().startswith("READY"):
                assert process.poll() is None, (self.folder / "bridge.log").read_text()
            self.bridge_pid = process.pid
            yield
        finally:
            end(process)
            assert process.stdout
            process.stdout.close()


@contextmanager
def lab() -> Iterator[Lab]:
    """Private peers, and the configuration of a home of 200 numbers; Missing without ROS or mosquitto."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        brokers = stack.enter_context(ExitStack())
        broker = brokers.enter_context(mosquitto.private(folder / "mosquitto", anonymous=True))
        master = stack.enter_context(ros.private(folder / "ros"))
        items = {item: {"type": "Number", "label": item} for item in ITEMS}
        (folder / "home.yaml").write_text(json.dumps({"items": items}))
        (folder / "bridge.yaml").write_text((ROOT / "config" / "bridge.yaml").read_text() + RULES)
        config = {
            "bus": {"port": broker.port},
            "state": str(folder / "state"),
            "home": "home.yaml",
            "bridge": {},
            "cameras": {"ip1": {"url": "http://127.0.0.1:9"}},
        }
        (folder / "apartment.yaml").write_text(json.dumps(config))
        yield Lab(broker.port, {**os.environ, **master.env, "PYTHONPATH": str(ROOT)}, folder, brokers, master)


def to_ros(lab: Lab, qos: int, count: int, rate: float, through: str) -> dict[str, float]:
    """From a publisher on MQTT to a subscriber on ROS, or by `bare` to one on MQTT."""
    with ExitStack() as stack:
        if through == "loop":
            stack.enter_context(lab.part("loop_to_ros", port=lab.port, mqtt="home/+/state", topic="/loop", qos=qos))
        if through == "bare":
            arguments: dict[str, Any] = {"port": lab.port, "topic": "home/+/state", "qos": qos, "count": count}
            ear = stack.enter_context(lab.part("hear_mqtt", **arguments))
        else:
            topic = "/loop" if through == "loop" else "/iot_updates"
            ear = stack.enter_context(lab.part("hear_ros", topic=topic, count=count))
        said = {"port": lab.port, "topics": STATES, "qos": qos, "count": count, "rate": rate}
        stack.enter_context(lab.part("blast", **said)).go()
        return ear.result()


def to_mqtt(lab: Lab, qos: int, count: int, rate: float, through: str) -> dict[str, float]:
    """From a publisher on ROS to a bare subscriber on MQTT."""
    with ExitStack() as stack:
        if through == "loop":
            stack.enter_context(lab.part("loop_to_mqtt", port=lab.port, topic="/loop", qos=qos))
        ear = stack.enter_context(lab.part("hear_mqtt", port=lab.port, topic=f"flat/{qos}/+", qos=qos, count=count))
        topic = "/loop" if through == "loop" else f"/flat_{qos}"
        stack.enter_context(lab.part("say_ros", topic=topic, keys=ITEMS, count=count, rate=rate)).go()
        return ear.result()


def round_trip(lab: Lab, count: int, through: str) -> dict[str, float]:
    """From ROS to MQTT and back to who said it."""
    with ExitStack() as stack:
        if through == "loop":
            stack.enter_context(lab.part("loop_to_mqtt", port=lab.port, topic="/loop_out", qos=1))
            loop = {"port": lab.port, "mqtt": "flat/1/+", "topic": "/loop_back", "qos": 1}
            stack.enter_context(lab.part("loop_to_ros", **loop))
        out, back = ("/loop_out", "/loop_back") if through == "loop" else ("/trip_out", "/trip_back")
        return stack.enter_context(lab.part("round_trip", out=out, back=back, count=count, rate=TRIP_RATE)).result()


def rows(messages: int = MESSAGES, paced: int = PACED, trips: int = TRIPS) -> Iterator[Row]:
    """All figures; RuntimeError when a message was lost."""
    with lab() as here, here.bridge():
        yield from _both(here, messages, paced)
        loop, ours = (_whole(round_trip(here, trips, through), trips) for through in ("loop", "bridge"))
        for name, wanted in (("p50", "<= 1 ms"), ("p99", "<= 5 ms")):
            yield Row(f"round trip at 100 Hz, {name}", "ms", ours[name], loop[name], "two bare loops", wanted)
        with here.part("newcomer", started=True, topic="/iot_updates", count=len(ITEMS)) as part:
            late = part.result()
        yield Row("200 items, from the first to the last", "ms", late["snapshot"], None, "", "<= 50 ms")
        yield Row("200 items, from the newcomer's beginning", "ms", late["whole"], None, "", "")
        yield from _pictures(here)


def _both(here: Lab, messages: int, paced: int) -> Iterator[Row]:
    for qos in (1, 0):
        bare = _whole(to_ros(here, qos, paced, RATE, "bare"), paced)
        ours = _whole(to_ros(here, qos, paced, RATE, "bridge"), paced)
        for name in ("p50", "p99"):
            text = f"MQTT to ROS, QoS {qos}, at 1000/s, {name}"
            wanted = "<= 2 x" if name == "p99" else ""
            yield Row(text, "ms", ours[name], bare[name], "a bare paho subscriber", wanted)
        loop = _whole(to_ros(here, qos, messages, 0, "loop"), messages)
        flat = _whole(to_ros(here, qos, messages, 0, "bridge"), messages)
        wanted = ">= 0.9 x" if qos else ">= 25,000/s"
        yield Row(f"MQTT to ROS, QoS {qos}, flat out", "msg/s", flat["rate"], loop["rate"], "a bare loop", wanted)
    for qos in (1, 0):
        loop, ours = (_whole(to_mqtt(here, qos, paced, RATE, through), paced) for through in ("loop", "bridge"))
        for name in ("p50", "p99"):
            yield Row(f"ROS to MQTT, QoS {qos}, at 1000/s, {name}", "ms", ours[name], loop[name], "a bare loop", "")
        loop, ours = (_whole(to_mqtt(here, qos, messages, 0, through), messages) for through in ("loop", "bridge"))
        text = f"ROS to MQTT, QoS {qos}, flat out"
        yield Row(text, "msg/s", ours["rate"], loop["rate"], "a bare loop", ">= 0.9 x" if qos else "")


def _pictures(here: Lab) -> Iterator[Row]:
    """What the bridge adds to the stream, by the number that each picture shows."""
    with (
        patterns.stream(PICTURES_FPS) as stream,
        connected(BusSettings(port=here.port)) as bus,
        listening(here.master, IMAGE) as ear,
    ):
        bus.say("camera/ip1/stream", json.dumps({"rtsp": True, "mjpeg": False, "url": stream.url}))
        images = ear.wait_for(IMAGE, PICTURES)[20:]
    added = sorted(1000 * (one["at"] - stream.put[one["number"]]) for one in images)
    for name, share in (("p50", 0.5), ("p99", 0.99)):
        yield Row(f"a picture on its way, {name}", "ms", added[int(share * len(added))], None, "", "<= 150 ms")
    rate = (len(images) - 1) / (images[-1]["at"] - images[0]["at"])
    yield Row("pictures on image_raw", "1/s", rate, PICTURES_FPS, "the stream", "1 x")


def _whole(figures: dict[str, float], count: int) -> dict[str, float]:
    if figures["came"] != count:
        raise RuntimeError(f"{figures['came']} of {count} came")
    return figures


def table(figures: list[Row]) -> Table:
    """For people."""
    made = Table("the bridge", "value", "floor", "ratio", "wanted", "the floor is")
    for row in figures:
        floor = "" if row.floor is None else f"{row.floor:,.2f} {row.unit}"
        ratio = "" if row.floor is None else f"{row.value / row.floor:.2f}"
        made.add_row(row.name, f"{row.value:,.2f} {row.unit}", floor, ratio, row.wanted, row.floor_is)
    return made


def main() -> None:
    """Prints the table."""
    try:
        console = Console(width=None if sys.stdout.isatty() else 170)
        console.print(table([one for one in rows() if console.print(one.name, f"{one.value:.2f}") is None]))
    except Missing as missing:
        Console().print(str(missing))


if __name__ == "__main__":
    main()
