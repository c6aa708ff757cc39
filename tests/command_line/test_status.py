"""`apartment status`: how everything stands, on one screen."""

from __future__ import annotations

import json
import os
import pty
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from services import peers
from services.bus import Message
from services.command_line.standing import KEPT, Standing
from services.command_line.status import data, screen
from services.payloads import Diagnostic, ServiceInfo
from services.peers.mosquitto import Broker
from services.topics import DIAGNOSTICS, SERVICE_INFO, SERVICE_STATUS
from tests.command_line.terminal import LIMIT_S, ROOT, apartment, config_of, done, somebody

NOON = 1_767_268_800.0


def said(message: Message, at: float, *, retain: bool = False) -> Message:
    """As it comes to somebody who listens."""
    return message._replace(received=NOON + at, retain=retain)


def diagnostic(of: str, received: int, level: int = 0, text: str = "running") -> Message:
    values = {"received": str(received), "published": str(2 * received)}
    return DIAGNOSTICS.message(Diagnostic(level=level, message=text, values=values), component=of)


def online(name: str) -> Message:
    return SERVICE_STATUS.message("online", service=name)


def shown(standing: Standing) -> str:
    """The screen as text."""
    console = Console(file=StringIO(), width=160)
    console.print(screen(standing, UTC))
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


def coloured(standing: Standing) -> str:
    """The screen as a terminal with few colours gets it."""
    console = Console(file=StringIO(), width=160, force_terminal=True, color_system="standard")
    console.print(screen(standing, UTC))
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


@contextmanager
def on_a_terminal(config: Path, *words: str) -> Iterator[Callable[[Callable[[str], bool]], None]]:
    """A command on a terminal; what is yielded reads from its screen until a condition holds."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "services", *words, "--config", str(config)], stdin=theirs, stdout=theirs,
        stderr=theirs, cwd=ROOT, env={**os.environ, "TERM": "xterm", "COLUMNS": "160", "LINES": "40"},
    )  # fmt: skip
    os.close(theirs)
    text, end = "", time.monotonic() + LIMIT_S

    def read(until: Callable[[str], bool]) -> None:
        nonlocal text
        while not until(text):
            assert select.select([ours], [], [], max(0.0, end - time.monotonic()))[0], text[-2000:]
            text += os.read(ours, 65536).decode(errors="replace")

    try:
        yield read
    finally:
        peers.end(process)
        os.close(ours)


def test_a_rate_comes_from_two_live_diagnostics() -> None:
    standing = Standing.of(["bridge"], [])
    standing.hear(said(online("bridge"), 0.0, retain=True))
    standing.hear(said(diagnostic("service/bridge", 10), 0.0, retain=True))
    standing.hear(said(diagnostic("service/bridge", 100), 0.1))
    assert not standing.settled
    standing.hear(said(diagnostic("service/bridge", 150), 1.1))
    assert standing.settled
    row = json.loads(json.dumps(data(standing)))["services"]["bridge"]
    assert (row["status"], row["rates"]) == ("online", {"received": 50.0, "published": 100.0})


def test_a_service_that_is_away_is_not_waited_for_but_told() -> None:
    standing = Standing.of(["bridge"], ["ip1"])
    assert not standing.settled
    standing.hear(said(SERVICE_STATUS.message("offline", service="bridge"), 0.0, retain=True))
    assert (standing.settled, standing.well) == (True, False)
    assert "offline" in shown(standing)


def test_what_is_not_well_comes_first_and_what_was_is_remembered() -> None:
    standing = Standing()
    standing.hear(said(diagnostic("service/a", 0, 1, "dropped: x"), 0.0))
    standing.hear(said(diagnostic("camera/ip1", 0, 2, "away"), 1.0))
    standing.hear(said(diagnostic("camera/ip1", 0, 2, "away"), 2.0))
    standing.hear(said(diagnostic("service/a", 0), 3.0))
    told = [(one.who, one.level, one.now, one.time[-7:]) for one in standing.troubles()]
    assert told == [("camera/ip1", "error", True, "01.000Z"), ("service/a", "warning", False, "00.000Z")]


def test_troubles_do_not_grow_for_ever() -> None:
    standing = Standing()
    for number in range(100):
        standing.hear(said(diagnostic("camera/ip1", 0, 2, f"away {number}"), number))
    assert len(standing.troubles()) == KEPT


def test_cameras_robots_and_failed_orders_are_on_the_screen() -> None:
    standing = Standing.of([], ["ip1"])
    for topic, payload in {
        "camera/ip1/status": json.dumps({"state": "degraded", "reason": "no [b]stream\x1b[2J"}),
        "camera/ip1/position": '{"pan": 10.04, "tilt": 5, "zoom": 0}',
        "camera/ip1/scan/state": '{"state": "running", "progress": 0.5}',
        "camera/ip1/order_result": '{"id": "a", "key": "Goto", "value": "", "state": "refused", "error": "no place"}',
        "robot/tiago/pose": '{"x": 1, "y": 2, "yaw_deg": 0, "stamp": "2026-01-01T12:00:00.000Z"}',
        "home/Lamp/state": "ON",
        "nobody/knows": "this",
    }.items():
        standing.hear(said(Message(topic, payload.encode()), 0.0))
    text = shown(standing)
    for words in ("no [b]stream", "10.0° 5.0°", "running 50 %", "Goto: no place", "tiago", "1.00 2.00"):
        assert words in text
    assert "\x1b" not in text


def test_a_camera_and_a_mission_whose_service_is_gone_are_not_shown_as_there() -> None:
    standing = Standing.of(["camera-ip1", "mission"], ["ip1"])
    for topic, payload in {
        "service/camera-ip1/status": "online",
        "service/mission/status": "online",
        "camera/ip1/status": '{"state": "online", "reason": "all well"}',
        "camera/ip1/scan/state": '{"state": "running", "progress": 0.4}',
        "mission/tiago/state": '{"state": "not_found", "marker": 582, "reason": "at Sofa", "since": "x"}',
    }.items():
        standing.hear(said(Message(topic, payload.encode()), 0.0, retain=True))
    there = ("all well", "running 40 %", "not_found", "582", "at Sofa")
    text = shown(standing)
    assert [words for words in (*there, "service offline") if words not in text] == ["service offline"]
    for name in ("camera-ip1", "mission"):
        standing.hear(said(SERVICE_STATUS.message("offline", service=name), 1.0))
    text = shown(standing)
    assert text.count("service offline") == 2
    assert [words for words in there if words in text] == []
    told = data(standing)
    assert (told["cameras"]["ip1"]["away"], told["robots"]["tiago"]["away"]) == ("service offline", "service offline")


def test_a_service_that_says_nothing_for_five_seconds_is_stale() -> None:
    standing = Standing.of(["bridge", "history"], [])
    standing.look(NOON, connected=True)
    for name in ("bridge", "history"):
        standing.hear(said(online(name), 0.0, retain=True))
        standing.hear(said(diagnostic(f"service/{name}", 0), 0.0, retain=True))
    standing.hear(said(diagnostic("service/bridge", 100), 4.0))
    standing.look(NOON + 5.0, connected=True)
    assert "stale" not in shown(standing)
    standing.look(NOON + 6.0, connected=True)
    stale = {line.split()[0]: "stale" in line for line in shown(standing).splitlines()[1:3]}
    assert stale == {"bridge": False, "history": True}
    assert [one["stale"] for one in data(standing)["services"].values()] == [False, True]
    standing.look(NOON + 9.5, connected=True)
    assert shown(standing).count("stale") == 2


@pytest.mark.parametrize(("retain", "after", "old"), [(True, 9.0, False), (True, 11.0, True), (False, 11.0, False)])
def test_where_a_robot_was_is_told_as_that(retain: bool, after: float, old: bool) -> None:
    """What the broker retains is as old as it says; what comes is of now, whatever clock the robot has."""
    standing = Standing()
    pose = Message("robot/tiago/pose", b'{"x": 1, "y": 2, "yaw_deg": 0, "stamp": "2026-01-01T12:00:00.000Z"}')
    standing.hear(said(pose, 10.0, retain=retain))
    standing.look(NOON + after, connected=True)
    assert ("was 1.00 2.00" in shown(standing)) is old
    assert "1.00 2.00" in shown(standing)
    assert data(standing)["robots"]["tiago"]["was_there"] is old


def test_without_a_broker_that_is_the_first_line_and_nothing_has_a_colour() -> None:
    standing = Standing.of(["bridge"], [])
    standing.look(NOON, connected=True)
    standing.hear(said(online("bridge"), 0.0, retain=True))
    assert (standing.well, "\x1b[32monline" in coloured(standing)) == (True, True)
    for later in (1.0, 4.0):
        standing.look(NOON + later, connected=False)
    text = coloured(standing)
    assert "no broker since 12:00:01" in text.splitlines()[0]
    assert "\x1b[2monline" in text
    assert "\x1b[32m" not in text
    assert (standing.well, data(standing)["no_broker_since"]) == (False, "2026-01-01T12:00:01.000Z")
    standing.look(NOON + 5.0, connected=True)
    assert (standing.well, "no broker" in coloured(standing)) == (True, False)


def test_a_live_screen_says_that_the_broker_died(mosquitto_broker: Broker, tmp_path: Path) -> None:
    config = config_of(tmp_path, mosquitto_broker, sections="hubs: {}\n")
    with on_a_terminal(config, "status", "--live") as read:
        read(lambda text: "never seen" in text)
        os.kill(mosquitto_broker.pid, signal.SIGKILL)
        read(lambda text: "no broker since" in text)


def test_status_shows_what_runs(mosquitto_broker: Broker, tmp_path: Path) -> None:
    config = config_of(tmp_path, mosquitto_broker, sections="hubs: {}\n")
    with apartment(config, "serve", "hubs") as serving, somebody(mosquitto_broker, "service/#", "diagnostics/#") as bus:
        assert serving.ready()
        bus.until(lambda one: one.topic == "diagnostics/service/hubs", 30.0)
        code, text = done(config, "status")
        assert code == 0, text
        assert all(words in text for words in ("hubs", "online", "received/s", "running"))
        assert text.count("\n") < 20


def test_a_live_screen_wants_a_terminal(mosquitto_broker: Broker, tmp_path: Path) -> None:
    code, text = done(config_of(tmp_path, mosquitto_broker), "status", "--live")
    assert (code, "--live: expected a terminal" in text) == (2, True)


def test_an_old_info_is_shown_with_its_start() -> None:
    standing = Standing()
    info = ServiceInfo(version="0.3", started="2026-01-01T12:00:00.000Z", counters={"bad": 3})
    standing.hear(said(SERVICE_INFO.message(info, service="bridge"), 0.0, retain=True))
    assert "01.01. 12:00:00" in shown(standing)
