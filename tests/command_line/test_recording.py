"""`apartment record` and `replay`: what went over the bus, into a file and back."""

from __future__ import annotations

import gzip
import json
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services import __version__, peers
from services.bus import Message
from services.client import Client
from services.command_line import recording
from services.command_line.replay import Choice, look
from services.peers.mosquitto import Broker, private
from tests.command_line.terminal import apartment, config_of, done, somebody

START = 1_767_225_600.0
STATE = Message("home/Lamp/state", b"ON", True, 1, START)
EVENT = Message("camera/ip1/audio", b"{}", False, 1, START + 0.2)
ORDER = Message("camera/ip1/order/Goto", b"Kitchen", False, 1, START + 0.4)
PICTURE = Message("camera/ip1/snapshot", b"\xff\xd8\x00", False, 0, START + 0.6)
STRANGE = Message("zigbee2mqtt/Lamp/set", b"ON", False, 1, START + 0.8)
LAST = Message("home/Lamp/state", "21.5 °C\n".encode(), False, 1, START + 1.0)
ALL = (STATE, EVENT, ORDER, PICTURE, STRANGE, LAST)


def recorded(file: Path, messages: tuple[Message, ...] = ALL) -> Path:
    """A recording of these."""
    with recording.create(file) as output:
        lines = [recording.header(__version__, START, ["#"]), *map(recording.line, messages)]
        output.write("".join(f"{one}\n" for one in lines))
    return file


@pytest.mark.parametrize("name", ["a.jsonl", "a.jsonl.gz"])
def test_what_was_recorded_is_read_again(tmp_path: Path, name: str) -> None:
    assert tuple(recording.read(recorded(tmp_path / name))) == ALL


@given(
    st.binary(max_size=200), st.integers(0, 2), st.booleans(),
    st.text(st.characters(blacklist_categories=("Cs",), blacklist_characters="+#\0"), min_size=1, max_size=30).filter(
        lambda topic: topic[0] not in "/$"
    ),
)  # fmt: skip
def test_any_message_survives(payload: bytes, qos: int, retain: bool, topic: str) -> None:
    message = Message(topic, payload, retain, qos, START)
    assert recording.Line.model_validate_json(recording.line(message)).message() == message


BROKEN: dict[str, tuple[Callable[[list[str]], list[str]], int]] = {
    "nothing": (lambda _: [], 1),
    "no header": (lambda lines: lines[1:], 1),
    "another program's header": (lambda lines: ["{}", *lines[1:]], 1),
    "no JSON": (lambda lines: [*lines[:2], "nonsense", *lines[3:]], 3),
    "an unknown key": (lambda lines: [*lines[:2], '{"odd": 1}'], 3),
    "a bad time": (lambda lines: [*lines[:3], lines[3].replace("2026", "20x6")], 4),
    "a bad payload": (lambda lines: [*lines[:4], lines[4].replace("/9gA", "/9g")], 5),
    "no topic": (lambda lines: [*lines[:1], lines[1].replace("home/Lamp/state", "home/#")], 2),
    "a local topic": (lambda lines: [*lines[:1], lines[1].replace("home/Lamp/state", "/bus/wake")], 2),
}


@pytest.mark.parametrize("how", BROKEN)
def test_a_broken_recording_is_refused_with_its_line(tmp_path: Path, how: str) -> None:
    change, number = BROKEN[how]
    file = recorded(tmp_path / "a.jsonl")
    lines = file.read_text(encoding="utf-8").split("\n")[:-1]
    file.write_text("".join(f"{one}\n" for one in change(lines)), encoding="utf-8")
    with pytest.raises(recording.BrokenRecording, match=f"a.jsonl:{number}: "):
        look(file, Choice())


@pytest.mark.parametrize("name", ["a.jsonl", "a.jsonl.gz"])
def test_a_recording_that_is_cut_off_is_refused(tmp_path: Path, name: str) -> None:
    file = recorded(tmp_path / name)
    file.write_bytes(file.read_bytes()[:-10])
    with pytest.raises(recording.BrokenRecording, match=rf"{name}:[1-8]: "):
        look(file, Choice())


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.jsonl"
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(recording.BrokenRecording, match=r"a\.jsonl:1: "):
        look(file, Choice())


@pytest.mark.parametrize(
    ("choice", "said"),
    [
        (Choice(account=None), [STATE, EVENT, LAST]),
        (Choice(account=None, pictures=True), [STATE, EVENT, PICTURE, LAST]),
        (Choice(account=None, commands=True), [STATE, EVENT, ORDER, STRANGE, LAST]),
        (Choice(only=("home/#",), account=None, commands=True), [STATE, LAST]),
        (Choice(), []),
        (Choice(commands=True), [ORDER, STRANGE]),
    ],
)
def test_a_choice_says_what_is_said_again(choice: Choice, said: list[Message]) -> None:
    chosen = [choice.again(one)[0] for one in ALL]
    assert [one.topic for one in chosen if one is not None] == [one.topic for one in said]


def test_what_is_said_again_has_the_flags_of_its_kind() -> None:
    choice = Choice(account=None, commands=True, pictures=True)
    flags = [(one.retain, one.qos, one.expires_s) for message in ALL if (one := choice.again(message)[0]) is not None]
    assert flags == [(True, 1, None), (False, 1, None), (False, 1, 5), (False, 0, 5), (False, 1, None), (True, 1, None)]


def say_all(bus: Client, file: Path) -> None:
    """Says one of each kind until the last of them is in the file."""

    def is_there() -> bool:
        for message in ALL:
            bus.say(message.topic, message.payload, retain=message.retain, qos=message.qos)
        bus.pump(0.2)
        return file.exists() and LAST.payload in b"".join(map(payload_of, lines_of(file)))

    peers.wait_until(is_there, "the recording")


def lines_of(file: Path) -> list[str]:
    """The whole lines of a recording without its header, also while it is written."""
    return file.read_text(encoding="utf-8").split("\n")[1:-1]


def payload_of(line: str) -> bytes:
    return recording.Line.model_validate_json(line).message().payload


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 0)])
def test_a_signal_closes_the_file_whole(mosquitto_broker: Broker, tmp_path: Path, number: int, code: int) -> None:
    file = tmp_path / "a.jsonl"
    config = config_of(tmp_path, mosquitto_broker)
    with somebody(mosquitto_broker) as bus, apartment(config, "record", str(file)) as terminal:
        say_all(bus, file)
        assert terminal.ended(number) == code
    assert {one.topic for one in recording.read(file)} >= {one.topic for one in ALL if one is not PICTURE}
    assert PICTURE.topic not in {one.topic for one in recording.read(file)}


def test_a_packed_recording_ends_at_its_limit(mosquitto_broker: Broker, tmp_path: Path) -> None:
    file = tmp_path / "a.jsonl.gz"
    config = config_of(tmp_path, mosquitto_broker)
    words = ["record", str(file), "home/#", "--limit", "0.01", "--for", "60"]
    with somebody(mosquitto_broker) as bus, apartment(config, *words) as terminal:

        def has_ended() -> bool:
            bus.say("home/Text/state", "x" * 1000)
            bus.pump(0.01)
            return terminal.process.poll() is not None

        peers.wait_until(has_ended, "the limit")
        assert terminal.ended() == 0
    with gzip.open(file, "rt", encoding="utf-8") as lines:
        assert json.loads(lines.readline())["version"] == __version__
    assert all(len(one.payload) == 1000 for one in recording.read(file))


def test_a_file_that_is_there_is_not_written_over(mosquitto_broker: Broker, tmp_path: Path) -> None:
    file = recorded(tmp_path / "a.jsonl")
    code, text = done(config_of(tmp_path, mosquitto_broker), "record", str(file), "--for", "1")
    assert (code, "expected a new file" in text) == (2, True)
    assert tuple(recording.read(file)) == ALL


def test_a_replay_keeps_the_distances_and_leaves_out_what_moves(mosquitto_broker: Broker, tmp_path: Path) -> None:
    file, config = recorded(tmp_path / "a.jsonl"), config_of(tmp_path, mosquitto_broker)
    with somebody(mosquitto_broker, "#") as bus:
        begun = time.monotonic()
        code, text = done(config, "replay", str(file), "--speed", "0.5")
        assert code == 0, text
        assert time.monotonic() - begun >= 2.0
        assert "says 1 events, 2 states" in text
        assert "leaves out 1 commands, 1 on unknown topics, 1 pictures" in text
        bus.until(lambda one: one.payload == LAST.payload, 20.0)
        came = [one for one in bus.seen if not one.topic.startswith("reply/")]
        assert [one.topic for one in came] == ["home/Lamp/state", "camera/ip1/audio", "home/Lamp/state"]


def test_a_replay_moves_something_only_when_that_is_confirmed(mosquitto_broker: Broker, tmp_path: Path) -> None:
    file, config = recorded(tmp_path / "a.jsonl"), config_of(tmp_path, mosquitto_broker)
    words = ["replay", str(file), "--commands", "--as-fast-as-it-can"]
    with somebody(mosquitto_broker, "#") as bus:
        code, text = done(config, *words)
        assert (code, "MAY MOVE: camera/ip1/order/Goto, zigbee2mqtt/Lamp/set" in text) == (2, True)
        code, text = done(config, *words, "--yes")
        assert code == 0, text
        bus.until(lambda one: one.topic == ORDER.topic, 20.0)
        assert sum(one.topic == ORDER.topic for one in bus.seen) == 1


def test_many_messages_are_all_taken_by_the_broker(mosquitto_broker: Broker, tmp_path: Path) -> None:
    many = tuple(STATE._replace(topic=f"home/Item_{one}/state", received=START + one) for one in range(1700))
    file, config = recorded(tmp_path / "a.jsonl", many), config_of(tmp_path, mosquitto_broker)
    code, text = done(config, "replay", str(file), "--as-fast-as-it-can")
    assert (code, "said 1700 of 1700 messages" in text) == (0, True), text
    with somebody(mosquitto_broker, "home/#") as bus:
        bus.until(lambda one: one.topic == "home/Item_1699/state" and one.retain, 20.0)


def test_the_broker_s_rights_bound_a_replay(tmp_path: Path) -> None:
    file = recorded(tmp_path / "a.jsonl")
    with private(tmp_path / "mosquitto") as broker:
        config = config_of(tmp_path, broker, account="operator")
        code, text = done(config, "replay", str(file))
        assert (code, "3 on topics of others" in text) == (1, True), text


def test_a_broken_file_is_refused_before_anything_is_said(mosquitto_broker: Broker, tmp_path: Path) -> None:
    file, config = recorded(tmp_path / "a.jsonl"), config_of(tmp_path, mosquitto_broker)
    with file.open("a", encoding="utf-8") as output:
        output.write("nonsense\n")
    code, text = done(config, "replay", str(file), "--as-fast-as-it-can")
    assert (code, f"{file}:8: " in text) == (1, True), text
