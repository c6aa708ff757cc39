"""`apartment mission ...`: sends a robot to find a marker, takes it back, asks where a marker was."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from services import client
from services.bus import Message
from services.client import Client
from services.command_line.options import CONFIG, Config, Json, Marker, out, writable
from services.config import Apartment, load
from services.errors import ConfigError
from services.payloads.robot import MissionOrder, MissionResult, MissionState, Where, WhereReply
from services.topics import MISSION_ORDER, MISSION_RESULT, MISSION_STATE, MISSION_WHERE, MISSION_WHERE_REPLY, read

app = typer.Typer(no_args_is_help=True, help="Send a robot to find a marker, with the house's help.")
Robot = Annotated[str | None, typer.Option("--robot", help="Which, where there are several.")]
ANSWER_S = 5.0
LOOK_S = 600.0  # a scan may take so long
FILTERS = (MISSION_STATE.filter, MISSION_RESULT.filter, MISSION_WHERE_REPLY.filter)
Tell = Callable[[str], None]


@app.command(epilog="Example: apartment mission find 582")
def find(
    marker: Marker,
    robot: Robot = None,
    timeout_s: Annotated[float, typer.Option("--timeout", help="Seconds to wait for the end.")] = 1800.0,
    plot: Annotated[Path | None, typer.Option(help="Draw what happened into this PNG file.")] = None,
    config: Config = CONFIG,
    json: Json = False,
) -> None:
    """Find a marker and tell each step; exit 1 when it was not found."""
    writable(plot, "--plot")
    with _robot(config, robot) as (bus, name):
        draw = _drawing(bus, config, plot, (name, marker)) if plot is not None else None
        result = _found(bus, name, marker, timeout_s, (lambda _: None) if json else out.print)
    out.print_json(result.model_dump_json()) if json else out.print(f"{result.state}: {result.reason}")
    if draw is not None:
        draw()
    if result.state != "found":
        raise typer.Exit(1)


@app.command(epilog="Example: apartment mission cancel")
def cancel(robot: Robot = None, config: Config = CONFIG) -> None:
    """End what the robot does for a mission, and all missions that wait."""
    with _robot(config, robot) as (bus, name):
        _cancelled(bus, name)


@app.command(epilog="Example: apartment mission where 582")
def where(
    marker: Marker,
    robot: Robot = None,
    wait: Annotated[bool, typer.Option("--wait", help="For the house to look again, where that is long ago.")] = False,
    config: Config = CONFIG,
    json: Json = False,
) -> None:
    """Show who has seen a marker where, how sure and how long ago; exit 1 when nobody has.

    When that is too long ago the house looks again meanwhile.
    """
    with _robot(config, robot) as (bus, name):
        reply = _seen(bus, name, marker, wait=wait)
    out.print_json(reply.model_dump_json()) if json else out.print(_table(reply))
    if reply.refreshing and not json:
        out.print("that is long ago or never: the house looks again now")
    if not reply.sightings:
        raise typer.Exit(1)


@contextmanager
def _robot(config: Path, wanted: str | None) -> Iterator[tuple[Client, str]]:
    """The bus, and the robot that is meant."""
    apartment = load(config, ("mission",))
    name, _ = robot_of(apartment, wanted)
    with client.connected(apartment.bus, FILTERS) as bus:
        yield bus, name


def robot_of(apartment: Apartment, wanted: str | None) -> tuple[str, Path]:
    """The robot that is meant, and its file: the one that was named, or the only one; ConfigError otherwise."""
    from services.mission import Config as Missions  # for these commands alone

    mission = apartment.instances.get("mission")
    known = mission.config if mission is not None and isinstance(mission.config, Missions) else None
    robots = {name: known.folder / one.places for name, one in known.robots.items()} if known else {}
    if wanted is None and len(robots) == 1:
        return next(iter(robots.items()))
    if wanted not in robots:
        names = ", ".join(robots) or "none there"
        raise ConfigError([f"{apartment.file}:1: mission.robots: expected one of {names}, got {wanted!r}"])
    return wanted, robots[wanted]


def _found(bus: Client, robot: str, marker: int, timeout_s: float, tell: Tell) -> MissionResult:
    """Orders the mission and waits for its end; `tell` is called with each step. TimeoutError when none comes."""
    order = MissionOrder(find=marker, id=uuid.uuid4().hex[:12])
    bus.publish(MISSION_ORDER.message(order, robot=robot))

    def ended(message: Message) -> bool:
        if message.topic == MISSION_STATE.name(robot=robot):
            _tell(read(message, message.received).payload, order.id, tell)
            return False
        topic = MISSION_RESULT.name(robot=robot)
        return message.topic == topic and read(message, message.received).payload.id == order.id

    end = bus.until(ended, timeout_s, f"the end of mission {order.id}")
    result: MissionResult = read(end, end.received).payload
    return result


def _drawing(bus: Client, config: Path, file: Path, what: tuple[str, int]) -> Callable[[], None]:
    """Listens from now on to what a picture shows; what is returned draws it, once the mission has ended."""
    from services.command_line import mission_plot  # maps and pictures, for who wants one

    bus.subscribe(*mission_plot.FILTERS)
    told = mission_plot.Timeline(*what, time.time())
    return lambda: mission_plot.write(file, load(config, ("mission",)), told, bus.seen)


def _tell(state: MissionState, ours: str | None, tell: Tell) -> None:
    if state.id == ours:
        tell(f"{state.elapsed_s:6.1f} s  {state.state:<5} {state.reason}")
    elif ours in state.waiting:
        tell(f"waits for its turn: {state.reason or state.state}")


def _cancelled(bus: Client, robot: str) -> None:
    """Ends what the robot does and all that waits; TimeoutError when it is not idle after ANSWER_S."""
    bus.publish(MISSION_ORDER.message(MissionOrder(cancel=True), robot=robot))
    bus.payload(MISSION_STATE.name(robot=robot), lambda state: state.state == "idle", ANSWER_S)


def _seen(bus: Client, robot: str, marker: int, *, wait: bool) -> WhereReply:
    """Who has seen it where; with `wait` after the house has looked. TimeoutError when nobody answers."""
    asked = Where(marker=marker, id=uuid.uuid4().hex[:12])
    bus.publish(MISSION_WHERE.message(asked, robot=robot))
    topic = MISSION_WHERE_REPLY.name(robot=robot, id=asked.id)
    reply: WhereReply = bus.payload(topic, timeout_s=ANSWER_S)
    if wait and reply.refreshing:
        reply = bus.payload(topic, lambda later: not later.refreshing, LOOK_S)
    return reply


def _table(reply: WhereReply) -> Table:
    """The sightings for people, newest first; positions in the apartment frame."""
    shown = Table("seen by", "place", "position, m", "sure to, mm", "ago, s")
    for one in reply.sightings:
        at = "" if one.position is None else f"{one.position.x:.2f} {one.position.y:.2f} {one.position.z:.2f}"
        sure = "" if one.sigma_m is None else f"{1000 * one.sigma_m:.0f}"
        shown.add_row(one.by, one.place or "", at, sure, f"{one.age_s:.0f}")
    return shown
