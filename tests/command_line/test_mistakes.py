"""Everyday mistakes end in a line that says what was wrong, before the work begins; a file's loss takes no result."""

from __future__ import annotations

import errno
import io
import os
import socket
from pathlib import Path

import pytest
from rich.table import Table
from typer.testing import CliRunner

from services.__main__ import app
from services.client import Client
from services.command_line.options import Screen
from services.errors import ConfigError
from services.payloads.robot import MissionOrder, MissionResult, MissionState, Whereabouts, WhereReply
from services.peers.mosquitto import Broker
from services.topics import (
    MISSION_ORDER,
    MISSION_RESULT,
    MISSION_STATE,
    MISSION_WHERE,
    MISSION_WHERE_REPLY,
)
from tests.command_line.playing import CAMERAS
from tests.command_line.terminal import ROOT, Terminal, apartment, config_of, done, somebody

MISSION = f"mission: {{robots: {{tiago: {{places: {ROOT}/config/tiago/robot_places.yaml}}}}}}\n"
ODD = "Sofa [/b] [old] :door: \x1b[2J"
SHOWN = "Sofa [/b] [old] :door: \\x1b[2J"


@pytest.fixture
def site(mosquitto_broker: Broker, tmp_path: Path) -> Path:
    """A configuration with a camera and a mission, which tests play."""
    stored = "persistence: {url: 'sqlite:///bus.db'}\n"
    return config_of(tmp_path, mosquitto_broker, sections=CAMERAS + MISSION + stored)


def test_a_file_that_cannot_be_written_is_a_line(site: Path) -> None:
    assert done(site, "topics", "--write", "/no/such/x.md") == (1, "/no/such/x.md: No such file or directory\n")


@pytest.mark.parametrize(
    "words",
    [
        "mission find 582 --plot",
        "scan ip1 --target 582 --plot",
        "history Kitchen_Temp --plot",
        "calibrate board --out",
        "calibrate lens ip1 --out",
        "calibrate mount ip1 --at 582=1,2,1 --at 17=2,2,1 --at 9=1,3,1 --yes-move --out",
        "bench --part bus --out",
    ],
)
@pytest.mark.parametrize("there", [False, True], ids=["in no folder", "a folder"])
def test_where_nothing_can_be_written_is_said_before_anything_begins(
    site: Path, tmp_path: Path, words: str, there: bool
) -> None:
    file = tmp_path / ("there" if there else "nowhere") / "x.png"
    if there:
        file.mkdir(parents=True)
    ended = CliRunner().invoke(app, [*words.split(), str(file), "--config", str(site)])
    assert isinstance(ended.exception, ConfigError), (ended.exception, ended.output)
    (fault,) = ended.exception.faults
    assert fault == f"--{words.rpartition('--')[2]}: expected a file that can be written, got {str(file)!r}"


@pytest.mark.parametrize("service", ["metrics", "dashboard"])
def test_a_port_that_is_taken_is_a_line(mosquitto_broker: Broker, tmp_path: Path, service: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        config = config_of(tmp_path, mosquitto_broker, sections=f"{service}: {{port: {port}}}\n")
        code, text = done(config, "serve", service)
    assert (code, text) == (1, f"{service}: cannot listen on 127.0.0.1:{port}: {os.strerror(errno.EADDRINUSE)}\n")


def test_nothing_that_is_shown_is_markup_or_steers_the_terminal() -> None:
    screen = Screen(file=io.StringIO(), width=100, force_terminal=True, color_system=None)
    table = Table("place")
    table.add_row(ODD)
    screen.print(ODD, table, "a\nb", sep="\n")
    assert isinstance(screen.file, io.StringIO)
    shown = screen.file.getvalue()
    assert shown.count(SHOWN) == 2
    assert "\x1b" not in shown
    assert "a\nb\n" in shown


def order_of(house: Client) -> MissionOrder:
    """The order for a mission that comes."""
    order: MissionOrder = house.payload(MISSION_ORDER.filter, timeout_s=30.0)
    return order


def found(house: Client, order: MissionOrder, terminal: Terminal) -> None:
    """A mission that ends well, by somebody whose words are odd."""
    state = MissionState(state="look", id=order.id, marker=582, reason=ODD, since="2026-01-31T07:05:00.000Z")
    house.publish(MISSION_STATE.message(state, robot="tiago"))
    house.pump()
    assert SHOWN in terminal.line()
    assert order.id is not None
    stamp = "2026-01-31T07:05:01.000Z"
    result = MissionResult(id=order.id, marker=582, state="found", reason=ODD, stamp=stamp)
    house.publish(MISSION_RESULT.message(result, robot="tiago"))
    house.pump()


def test_the_words_of_a_mission_are_shown_as_they_are(site: Path, mosquitto_broker: Broker) -> None:
    with (
        somebody(mosquitto_broker, MISSION_ORDER.filter) as house,
        apartment(site, "mission", "find", "582") as terminal,
    ):
        found(house, order_of(house), terminal)
        assert (terminal.ended(), terminal.rest()) == (0, [f"found: {SHOWN}"])


def test_a_picture_that_cannot_be_written_takes_no_result(site: Path, tmp_path: Path, mosquitto_broker: Broker) -> None:
    picture = tmp_path / "x.png"
    words = ("mission", "find", "582", "--plot", str(picture))
    with somebody(mosquitto_broker, MISSION_ORDER.filter) as house, apartment(site, *words) as terminal:
        order = order_of(house)
        picture.mkdir()
        found(house, order, terminal)
        assert terminal.ended() == 1
        assert terminal.rest() == [f"found: {SHOWN}", f"{picture}: {os.strerror(errno.EISDIR)}"]


def test_a_place_is_shown_as_it_is_named_where_a_marker_was(site: Path, mosquitto_broker: Broker) -> None:
    with (
        somebody(mosquitto_broker, MISSION_WHERE.filter) as house,
        apartment(site, "mission", "where", "582") as terminal,
    ):
        asked = house.payload(MISSION_WHERE.filter, timeout_s=30.0)
        seen = Whereabouts(
            by="ip1", place="TV [old]", position=None, sigma_m=None, age_s=3.0, stamp="2026-01-31T07:05:00.000Z"
        )
        reply = WhereReply(id=asked.id, marker=582, sightings=[seen])
        house.publish(MISSION_WHERE_REPLY.message(reply, robot="tiago", id=asked.id))
        house.pump()
        assert terminal.ended() == 0
        assert "TV [old]" in "\n".join(terminal.rest())
