"""The demo: the whole apartment on this machine, with private peers, telling its story on the terminal.

With mosquitto, MariaDB and ROS installed it uses them, each started privately; without, an embedded broker and
SQLite, and it says what is missing. Not here: the services themselves; they run as they would in a lab.
"""

from __future__ import annotations

import math
import tempfile
import time
from contextlib import ExitStack, closing
from pathlib import Path

from rich.console import Console
from rich.panel import Panel
from rich.table import Table

from services import client, persistence, topics
from services.client import Client
from services.command_line.scan import ordered, progress
from services.config import Apartment
from services.payloads import ScanResult
from services.process import ready_line
from services.simulated import Parts, Simulated, parts_of, services_of
from services.simulators.world import World
from services.simulators.world import load as load_world
from services.storage import open_storage

TARGET = 582
WITHIN_M = 0.10  # contract section 1
SCAN_S = 240.0
LOG_SHOWN = 4000  # characters of the services' log, when something went wrong


def demo(out: Console, *, once: bool) -> bool:
    """Runs it; True when the marker was found at its place, within WITHIN_M of where it is, and is in the database."""
    with tempfile.TemporaryDirectory(prefix="apartment-") as name, ExitStack() as stack:
        with out.status("Starting broker, database and ROS master ..."):
            parts = stack.enter_context(parts_of(Path(name), real=True, usual_ports=True))
        _show_parts(out, parts)
        with out.status("Starting the services ..."):
            running = stack.enter_context(services_of(Path(name), parts))
        _show_services(out, running)
        try:
            good = _story(out, running, once=once)
        except TimeoutError as error:
            out.print(str(error), style="bold red", markup=False)
            good = False
        if not good:
            out.print(running.log.read_text(errors="replace")[-LOG_SHOWN:], style="dim", markup=False)
        return good


def _show_parts(out: Console, parts: Parts) -> None:
    table = Table("part", "used", "missing", title="The apartment", title_justify="left")
    for row in parts.used:
        table.add_row(*row)
    out.print(table)


def _show_services(out: Console, running: Simulated) -> None:
    out.print(ready_line("demo", running.addresses), markup=False, style="dim")
    out.print(f"Running: {', '.join(running.ready)}.")
    out.print(f"Their log: {running.log}", style="dim")
    out.print(f"The dashboard: {running.ready['dashboard']['url']}")
    port = running.apartment.bus.port
    out.print(f"Try it: mosquitto_pub -p {port} -t home/Kitchen_Light/command -m ON", style="dim")
    out.print(f"        mosquitto_pub -p {port} -t camera/ip1/order/Goto -m Kitchen", style="dim")
    out.print(f"        mosquitto_sub -p {port} -v -t 'home/#' -t 'camera/#'", style="dim")
    if running.parts.ros:
        out.print(f"        ROS_MASTER_URI={running.parts.ros.uri} rostopic echo /iot_updates", style="dim")


def _story(out: Console, running: Simulated, *, once: bool) -> bool:
    filters = [row.filter for row in (topics.HOME_STATE, topics.CAMERA_ORDER_RESULT,
                                      topics.CAMERA_SCAN_STATE, topics.CAMERA_SCAN_RESULT)]  # fmt: skip
    apartment = running.apartment
    with client.connected(apartment.bus, filters) as bus:
        _home_lives(out, bus)
        result = _scan(out, bus, apartment.cameras[0])
        good = result is not None and _judge(out, result, load_world(running.config.with_name("world.yaml")))
        stored = result is not None and _stored(out, apartment, result)
        if not once:
            _until_ctrl_c(out, bus)
        return good and stored


def _home_lives(out: Console, bus: Client) -> None:
    bus.publish(topics.HOME_COMMAND.message("ON", item="Kitchen_Light"))
    state = bus.payload(topics.HOME_STATE.name(item="Kitchen_Light"), lambda text: text == "ON", 15.0)
    items = {message.topic for message in bus.seen if message.topic.startswith("home/")}
    out.print(f"The home answers: Kitchen_Light is {state}; {len(items)} items have a state.")


def _scan(out: Console, bus: Client, camera: str) -> ScanResult | None:
    out.print(f"The camera {camera} looks for marker {TARGET} ...")
    with progress(out) as advance:
        end = ordered(bus, camera, "ON", advance, SCAN_S)
    found = [
        topics.read(message, message.received).payload for message in bus.seen if message.topic.endswith("/scan/result")
    ]
    result = next((one for one in found if one.marker == TARGET), None)
    if result is None:
        out.print(f"Marker {TARGET} was not found: {end.error or end.state}", style="bold red")
    return result


def _judge(out: Console, result: ScanResult, world: World) -> bool:
    """Against the truth, which only the demo and the simulators know."""
    truth = next(marker for marker in world.markers if marker.id == result.marker)
    table = Table("", "place", "x", "y", "z", title=f"Marker {result.marker}", title_justify="left")
    position = result.position
    if position is None:
        out.print(f"Marker {result.marker} seen from {result.place}, but not where: {result.why}", style="bold red")
        return False
    seen = (position.x, position.y, position.z)
    for name, place, numbers in (("found", result.place, seen), ("true", truth.place, truth.position)):
        table.add_row(name, place, *(f"{number:.3f} m" for number in numbers))
    out.print(table)
    error = math.dist(seen, truth.position)
    good = error <= WITHIN_M and result.place == truth.place
    style = "bold green" if good else "bold red"
    out.print(
        f"Off by {error * 1000:.0f} mm (at most {WITHIN_M * 1000:.0f}), distance {result.distance:.2f} m.", style=style
    )
    return good


def _stored(out: Console, apartment: Apartment, result: ScanResult) -> bool:
    config = apartment.instances["persistence"].config
    end = time.monotonic() + 10.0
    assert isinstance(config, persistence.Config)
    with closing(open_storage(config.address)) as storage:
        while time.monotonic() < end:
            rows = [row for row in storage.sightings(result.marker, limit=10) if row.scan == result.scan]
            if rows:
                out.print(f"Stored: sighting of {rows[0].marker} at {rows[0].place}, scan {rows[0].scan}.")
                return True
            time.sleep(0.1)
    out.print("The sighting is not in the database.", style="bold red")
    return False


def _until_ctrl_c(out: Console, bus: Client) -> None:
    out.print(Panel("Everything keeps running. What happens is shown here; Ctrl-C ends it.", expand=False))
    while True:
        for message in bus.pump(1.0):
            if not message.topic.endswith("/scan/state"):
                out.print(f"{message.topic}  {message.payload.decode(errors='replace')[:150]}", markup=False)
        bus.seen.clear()  # it may run for weeks
