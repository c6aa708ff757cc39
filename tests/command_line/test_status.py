"""`apartment status`: how everything stands, on one screen."""

from __future__ import annotations

import json
from datetime import UTC
from io import StringIO
from pathlib import Path

from rich.console import Console

from services.bus import Message
from services.command_line.standing import KEPT, Standing
from services.command_line.status import data, screen
from services.payloads import Diagnostic, ServiceInfo
from services.peers.mosquitto import Broker
from services.topics import DIAGNOSTICS, SERVICE_INFO, SERVICE_STATUS
from tests.command_line.terminal import apartment, config_of, done, somebody

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
