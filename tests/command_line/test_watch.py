"""`apartment watch`: what goes over the bus, as it comes."""

from __future__ import annotations

import json
import signal
from datetime import UTC
from pathlib import Path

import pytest

from services.bus import Message
from services.command_line import hearing
from services.command_line.watch import short, text_of
from services.errors import ConfigError
from services.peers.mosquitto import Broker
from tests.command_line.terminal import apartment, config_of, done, somebody


def test_what_is_retained_comes_first_and_then_what_is_said(mosquitto_broker: Broker, tmp_path: Path) -> None:
    config = config_of(tmp_path, mosquitto_broker)
    with somebody(mosquitto_broker, "home/#") as bus:
        bus.say("home/Lamp/state", "ON", retain=True)
        bus.until(lambda message: message.topic == "home/Lamp/state", 20.0)
        with apartment(config, "watch", "home/#", "--json") as terminal:
            first = json.loads(terminal.line())
            assert (first["topic"], first["payload"], first["retain"]) == ("home/Lamp/state", "ON", True)
            bus.say("home/Lamp/state", "OFF", retain=True)
            assert json.loads(terminal.line())["payload"] == "OFF"
            assert terminal.ended(signal.SIGINT) == 130


def test_watching_ends_by_itself_after_a_number_of_messages(mosquitto_broker: Broker, tmp_path: Path) -> None:
    config = config_of(tmp_path, mosquitto_broker)
    with somebody(mosquitto_broker, "camera/#") as bus:
        bus.say("camera/ip1/status", '{"state": "online", "reason": "\x1b[2J"}', retain=True)
        bus.until(lambda message: message.topic == "camera/ip1/status", 20.0)
    code, text = done(config, "watch", "camera/+/status", "camera/#", "--count", "1")
    assert code == 0
    assert text.count("\n") == 1
    assert "R camera/ip1/status {" in text
    assert "\x1b" not in text


def test_fewer_messages_than_wanted_are_told_by_the_exit_code(mosquitto_broker: Broker, tmp_path: Path) -> None:
    config = config_of(tmp_path, mosquitto_broker)
    assert done(config, "watch", "home/Never/state", "--count", "1", "--for", "0.5") == (1, "")


@pytest.mark.parametrize("wanted", ["", "home/#/state", "home/a+/state", "home/x#", "/bus/wake", "home/\n"])
def test_a_filter_that_is_none_is_refused(wanted: str) -> None:
    with pytest.raises(ConfigError, match="expected"):
        hearing.checked(["home/#", wanted])


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        (["home/#", "home/+/state"], ["home/#"]),
        (["#", "$SYS/#"], ["#", "$SYS/#"]),
        (["home/+", "home/#"], ["home/#"]),
        (["home/+/#", "home/#"], ["home/#"]),
        (["home/#", "home"], ["home/#"]),
        (["home/+/state", "home/+/state"], ["home/+/state"]),
        (["home/+/state", "home/Lamp/+"], ["home/+/state", "home/Lamp/+"]),
    ],
)
def test_filters_that_others_hold_are_left_out(given: list[str], kept: list[str]) -> None:
    assert hearing.checked(given) == kept


def test_json_is_coloured_and_text_is_not() -> None:
    plain = text_of(Message("home/a/state", b"ON", received=0.0), UTC)
    coloured = text_of(Message("home/a/state", b'{"a": 1}', retain=True, received=0.0), UTC)
    assert plain.plain == "00:00:00.000   home/a/state ON"
    assert coloured.plain == '00:00:00.000 R home/a/state {"a": 1}'
    assert len(coloured.spans) > len(plain.spans)


def test_a_payload_is_one_line_that_steers_no_terminal() -> None:
    assert short(b"a\nb\x1b[2J\xc2\x9b") == "a\\nb\\x1b[2J\\x9b"
    assert short(b"\xff\xd8") == "<2 bytes>"
    assert len(short(b"x" * 10_000)) == 400
