"""The topic table: names, flags by kind, and that nothing but BadMessage comes out of what strangers send."""

from __future__ import annotations

import contextlib
import json
import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services import topics
from services.bus import Message, topic_matches
from services.errors import BadMessage
from services.payloads import Diagnostic, Order, PositionSet, stamp
from services.topic import LEVELS, STALE_AFTER_S, Kind, Topic
from services.topics import BLOB_LIMIT, TABLE, TEXT_LIMIT, brings_commands, find, page, read

NOW = 1_769_839_500.0
ROWS = [pytest.param(row, id=row.pattern) for row in TABLE]
PRINTABLE = string.ascii_letters + string.digits + "_-/+#$ .é°\n"

ILLEGAL = {
    "item": ["", "1st", "a-b", "a b", "a/b", "é", "+", "#", "a\n"],
    "cam": ["", "Ip1", "1ip", "_ip", "ip-1", "a/b", "+"],
    "robot": ["", "Tiago", "1", "a b", "a/b"],
    "service": ["", "Bridge", "a b", "a/b", "é"],
    "key": ["", "Go to", "Goto1", "a/b", "_"],
    "id": ["", "a b", "a/b", "é", "x" * 65, "+"],
    "marker": ["", "12345", "-1", "a", "1.5", "٣"],
    "platform": ["", "Sensor", "a-b", "a/b", "1"],
    "entity": ["", "Pan", "a b", "a/b", "é"],
    "component": ["", "/", "a/", "/a", "a//b", "a b", "é", "+"],
    "device": ["", "Home", "-a", "a_b", "a/b", "$a", "+"],
    "node": ["", "Lamp", "-a", "a_b", "a/b", "$a", "+"],
    "property": ["", "Value", "-a", "a_b", "a/b", "$a", "+"],
    "attribute": ["", "$", "name", "$Name", "$a/b", "+"],
    "trait": ["", "$", "name", "$state", "$names", "x$name", "set", "+"],
}


SPECIAL = {"marker": "1", "attribute": "$name", "trait": "$unit"}  # legal levels where `a` is none


def legal(row: Topic) -> st.SearchStrategy[dict[str, str]]:
    """Levels that a row allows."""
    return st.fixed_dictionaries({name: st.from_regex(LEVELS[name], fullmatch=True) for name in row.names})


def message(topic: str, payload: bytes, *, age: float = 0.0, retain: bool = False) -> Message:
    """What a stranger sends."""
    return Message(topic, payload, retain=retain, received=NOW - age)


def test_every_kind_of_level_has_illegal_examples() -> None:
    assert set(ILLEGAL) == set(LEVELS)


@pytest.mark.parametrize("row", ROWS)
@given(data=st.data())
def test_a_name_is_found_again_with_its_levels(row: Topic, data: st.DataObject) -> None:
    levels = data.draw(legal(row))
    topic = row.name(**levels)
    assert find(topic) == (row, levels)
    assert topic_matches(row.filter, topic)
    assert topic_matches(row.filter_for(**levels), topic)
    assert [other.pattern for other in TABLE if other.regex.fullmatch(topic)] == [row.pattern]


@pytest.mark.parametrize("row", [pytest.param(row, id=row.pattern) for row in TABLE if row.names])
@given(data=st.data())
def test_an_illegal_level_is_refused_and_never_another_row(row: Topic, data: st.DataObject) -> None:
    levels = data.draw(legal(row))
    name = data.draw(st.sampled_from(row.names))
    levels[name] = data.draw(st.sampled_from(ILLEGAL[name]))
    with pytest.raises(BadMessage, match="is not a topic like"):
        row.name(**levels)


@given(st.text(PRINTABLE))
def test_a_level_is_legal_exactly_when_its_row_reads_it_back(text: str) -> None:
    for row in TABLE:
        levels = {name: "a1"[: 2 if name not in ("key", "marker") else 1] for name in row.names} | SPECIAL
        for name in row.names:
            try:
                topic = row.name(**(levels | {name: text}))
            except BadMessage:
                continue
            assert find(topic)[1][name] == text


@given(st.text(max_size=200))
def test_an_unknown_topic_is_refused(topic: str) -> None:
    with contextlib.suppress(BadMessage):
        row, levels = find(topic)
        assert row.name(**levels) == topic


NO_TOPICS = ["", "/", "home", "home/", "home/X/state/", "/home/X/state", "home/X/STATE", "$SYS/x", "diagnostics"]


@pytest.mark.parametrize("topic", NO_TOPICS)
def test_what_only_looks_like_a_topic_is_refused(topic: str) -> None:
    with pytest.raises(BadMessage):
        find(topic)


@pytest.mark.parametrize("row", ROWS)
def test_the_kind_decides_the_flags(row: Topic) -> None:
    sent = row.message(b"x", **{name: SPECIAL.get(name, "a") for name in row.names})
    assert sent.retain is (row.kind is Kind.STATE)
    assert sent.qos == (0 if row.kind is Kind.BLOB else 1)
    assert (sent.expires_s is not None) is (row.kind in (Kind.COMMAND, Kind.BLOB))


def test_text_and_models_are_encoded() -> None:
    assert topics.HOME_STATE.message("21.5 °C", item="Lab_Temp").payload == "21.5 °C".encode()
    sent = topics.DIAGNOSTICS.message(Diagnostic(level=1, message="slow"), component="camera/ip1")
    assert sent.topic == "diagnostics/camera/ip1"
    assert json.loads(sent.payload) == {"level": 1, "message": "slow", "values": {}, "hardware_id": ""}


def test_a_message_is_read_back_as_what_was_sent() -> None:
    sent = topics.CAMERA_POSITION_SET.message(PositionSet(pan=10.0, tilt=-3.5), cam="ip1")
    got = read(message(sent.topic, sent.payload), NOW)
    assert got.topic is topics.CAMERA_POSITION_SET
    assert got.levels == {"cam": "ip1"}
    assert got.payload == PositionSet(pan=10.0, tilt=-3.5)


WANTED = {  # the others take what follows
    "history/get": b'{"id": "q"}',
    "mission/<robot>/order": b'{"find": 582}',
    "mission/<robot>/where": b'{"marker": 582, "id": "q"}',
    "robot/<robot>/goto": b'{"point": "Sofa"}',
    "robot/<robot>/cancel": b"{}",
}
COMMANDS = [pytest.param(row, id=row.pattern) for row in TABLE if row.kind is Kind.COMMAND]


@pytest.mark.parametrize("row", COMMANDS)
def test_a_retained_command_is_refused(row: Topic) -> None:
    topic = row.name(**dict.fromkeys(row.names, "a"))
    with pytest.raises(BadMessage, match="retained"):
        read(message(topic, WANTED.get(row.pattern, b'{"pan": 1}'), retain=True), NOW)


@pytest.mark.parametrize("row", ROWS)
def test_commands_alone_come_by_the_filters_of_commands_and_by_wider_ones(row: Topic) -> None:
    one = row.filter_for(**dict.fromkeys(row.names, "a"))
    assert [brings_commands(one), brings_commands("#")] == [row.kind is Kind.COMMAND, True]


@pytest.mark.parametrize("row", COMMANDS)
def test_a_late_command_is_refused_and_one_in_time_is_not(row: Topic) -> None:
    topic = row.name(**dict.fromkeys(row.names, "a"))
    read(message(topic, WANTED.get(row.pattern, b'{"pan": 1}'), age=STALE_AFTER_S - 0.01), NOW)
    with pytest.raises(BadMessage, match=r"5\.1 s old"):
        read(message(topic, WANTED.get(row.pattern, b'{"pan": 1}'), age=STALE_AFTER_S + 0.1), NOW)


def test_an_old_state_is_a_state() -> None:
    assert read(message("home/A/state", b"ON", age=1e6, retain=True), NOW).payload == "ON"


@pytest.mark.parametrize(
    ("topic", "limit"),
    [("home/A/state", TEXT_LIMIT), ("camera/ip1/order/Scan", TEXT_LIMIT), ("camera/ip1/snapshot", BLOB_LIMIT)],
)
def test_what_is_too_large_is_refused(topic: str, limit: int) -> None:
    assert read(message(topic, b"x" * limit), NOW)
    with pytest.raises(BadMessage, match=f"at most {limit}"):
        read(message(topic, b"x" * (limit + 1)), NOW)


DEEP = 100_000
BAD_PAYLOADS = [
    ("home/A/state", b"\xb0C"),  # what a Java with another charset sends
    ("home/A/command", b"\xff\xfe"),
    ("camera/ip1/order/Goto", b"\xc3"),
    ("camera/ip1/position/set", b""),
    ("camera/ip1/position/set", b"{}"),
    ("camera/ip1/position/set", b"null"),
    ("camera/ip1/position/set", b"[1, 2, 3]"),
    ("camera/ip1/position/set", b'{"pan": "left"}'),
    ("camera/ip1/position/set", b'{"pan": "5"}'),
    ("camera/ip1/position/set", b'{"pan": true}'),
    ("camera/ip1/position/set", b'{"pan": NaN}'),
    ("camera/ip1/position/set", b'{"pan": Infinity}'),
    ("camera/ip1/position/set", b'{"pan": 1e999}'),
    ("camera/ip1/position/set", b'{"pan": ' + b"1" * 5000 + b"}"),
    ("camera/ip1/position/set", b'{"pan": ' + b"1" * 4300 + b"}"),
    ("camera/ip1/position/set", b'{"pan": 1, "speed": 2}'),
    ("camera/ip1/position/set", b'{"pan": 1, "id": "' + b"x" * 65 + b'"}'),
    ("camera/ip1/position/set", b"[" * DEEP),
    ("camera/ip1/places", b"[" * DEEP + b"]" * DEEP),
    ("camera/ip1/places", b'{"Kitchen": {"pan": 1, "tilt": null}}'),
    ("camera/ip1/order/Scan", b'{"value": ' + b"[" * DEEP + b"]" * DEEP + b"}"),
    ("camera/ip1/order/Scan", b'{"value": NaN}'),
    ("camera/ip1/order/Scan", b'{"value": {"targets": [1e999]}}'),
    ("camera/ip1/order/Scan", b'{"targets": [-Infinity]}'),
    ("camera/ip1/order/Scan", b'{"value": ' + b"9" * 400 + b"}"),
    ("camera/ip1/order/Scan", b'{"value": "\\ud800"}'),
    ("camera/ip1/order/Scan", b'{"value": 1, "by": "burglar"}'),
    ("camera/ip1/order/Scan", b'{"value": 1'),
    ("camera/ip1/motion", b'{"value": 2, "since": "x"}'),
    ("camera/ip1/status", b'{"state": "asleep"}'),
    ("diagnostics/x", b'{"level": 4, "message": ""}'),
    ("diagnostics/x", b'{"level": 1, "message": "", "values": {"a": 5}}'),
    ("service/bridge/info", b'{"version": "1", "started": "x", "counters": {"a": "many"}}'),
    ("camera/ip1/scan/state", b'{"state": "running", "progress": 1.5}'),
]


@pytest.mark.parametrize(("topic", "payload"), BAD_PAYLOADS, ids=lambda value: repr(value)[:60])
def test_a_payload_that_is_not_what_the_table_says_is_refused(topic: str, payload: bytes) -> None:
    with pytest.raises(BadMessage) as caught:
        read(message(topic, payload), NOW)
    assert str(caught.value).startswith(topic + ": ")
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize(
    "change",
    [{"covariance": []}, {"covariance": [[1e-4]]}, {"covariance": [[0, 0, 0], [0, 0, 0], [0, 0]]},
     {"covariance": [[0] * 4] * 4}, {"stamp": "0001-01-01T00:00:00+01:00"}, {"first_seen": "2026-01-31T07:05:00"},
     {"stamp": "9999-12-31T23:59:59.9999-01:00"}, {"stamp": "9999-12-31T23:59:59.999999Z"}],
    ids=str,
)  # fmt: skip
def test_a_result_has_a_covariance_of_three_axes_and_a_time_that_can_be_told(change: dict[str, object]) -> None:
    result = {"camera": "ip1", "marker": 582, "dictionary": "d", "place": "", "position": None, "scan": "s",
              "stamp": stamp(NOW), "first_seen": stamp(NOW), "covariance": [[0, 0, 0]] * 3}  # fmt: skip
    assert read(message("camera/ip1/scan/result", json.dumps(result).encode()), NOW)
    with pytest.raises(BadMessage, match=f"{next(iter(change))}"):
        read(message("camera/ip1/scan/result", json.dumps({**result, **change}).encode()), NOW)


def test_the_message_says_where_what_was_expected_and_what_came() -> None:
    with pytest.raises(BadMessage, match=r"camera/ip1/places: Kitchen\.tilt: .*number.*got 'None'"):
        read(message("camera/ip1/places", b'{"Kitchen": {"pan": 1, "tilt": null}}'), NOW)


@pytest.mark.parametrize(
    ("payload", "order"),
    [
        (b"Kitchen", Order(value="Kitchen")),
        (b"", Order(value="")),
        (b"Left 3 0.5", Order(value="Left 3 0.5")),
        (b'{"value": "ON", "id": "7", "by": "mission"}', Order(value="ON", id="7", by="mission")),
        (b' {"targets": [582, 17]}', Order(value={"targets": [582, 17]})),
        (b"[1, 2]", Order(value="[1, 2]")),
    ],
)
def test_an_order_is_text_or_json(payload: bytes, order: Order) -> None:
    assert read(message("camera/ip1/order/Goto", payload), NOW).payload == order


TOPICS = st.sampled_from([row.name(**{name: SPECIAL.get(name, "a") for name in row.names}) for row in TABLE])
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: (
        st.lists(inner) | st.dictionaries(st.sampled_from(["value", "pan", "id", "state"]) | st.text(), inner)
    ),
)


PAYLOADS = st.binary() | st.text().map(str.encode) | JSON.map(lambda value: json.dumps(value).encode())


@given(TOPICS | st.text(), PAYLOADS, st.booleans())
def test_only_bad_message_ever_comes_out_of_what_strangers_send(topic: str, payload: bytes, retain: bool) -> None:
    with contextlib.suppress(BadMessage):
        read(message(topic, payload, retain=retain), NOW)


def test_an_answer_goes_to_the_one_who_asked() -> None:
    asked = Message("camera/ip1/order/Goto", reply_to="lab/7", correlation=b"c")
    answer = topics.HOME_STATE.message("ON", item="A")
    told = topics.reply(answer, asked)
    assert told is not None
    assert (told.topic, told.payload, told.correlation, told.retain) == ("lab/7", b"ON", b"c", False)
    assert topics.reply(answer, Message("camera/ip1/order/Goto")) is None


def test_the_page_for_people_has_a_row_for_every_topic() -> None:
    text = page.markdown()
    for row in TABLE:
        assert text.count(f"| `{row.pattern}` |") == 1
