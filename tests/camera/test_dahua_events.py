"""The event stream's parser: every form that firmware writes, cut anywhere."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.camera.brands.dahua import events
from services.camera.brands.dahua.events import Parser
from services.camera.device import Event

START, STOP = Event("VideoMotion", "Start"), Event("VideoMotion", "Stop")
BEAT = Event("", "Heartbeat")
DATA = 'Code=VideoMotion;action=Start;index=0;data={\n   "SmartMotionEnable" : false\n}\n'
REGION = (
    'Code=VideoMotion;action=Start;index=0;data={\n   "Id" : [ 0 ],\n   "RegionName" : [ "Region1" ],\n'
    '   "SmartMotionEnable" : true\n}\n'
)
PLAIN = "Code=VideoMotion;action=Start;index=0"
HEADER = (
    "HTTP/1.1 200 OK\r\nCache-Control: no-cache\r\nPragma: no-cache\r\nExpires: Thu, 01 Dec 2099 16:00:00 GMT\r\n"
    "Connection: Keep-Alive\r\nContent-Type: multipart/x-mixed-replace; boundary=myboundary\r\n\r\n"
)


def part(text: str, length: int | None = None, space: str = "", before: str = "", after: str = "\r\n\r\n") -> str:
    count = len(text) if length is None else length
    return f"--myboundary\r\nContent-Type: text/plain\r\nContent-Length:{space}{count}\r\n\r\n{before}{text}{after}"


BEAT_PART = part("Heartbeat")


def test_the_captured_lengths_are_exact() -> None:
    assert (len(DATA), len(DATA.replace("Start", "Stop")), len(REGION), len(PLAIN)) == (78, 77, 127, 37)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (part(DATA, after="\r\n\r\n\r\n"), [START]),
        (part(REGION), [START]),
        (part(PLAIN), [START]),
        (part(PLAIN, space=" "), [START]),
        (part(PLAIN.replace("Start", "Stop")), [STOP]),
        (part("Code=VideoMotionInfo;action=State;index=0"), [Event("VideoMotionInfo", "State")]),
        (part("Code=AlarmLocal;action=Pulse;index=2"), [Event("AlarmLocal", "Pulse", 2)]),
        (part(PLAIN, length=39), [START]),
        (part(PLAIN, before="\r\n"), [START]),
        (part(PLAIN, before="\r\n", length=39), [START]),
        (part(PLAIN, after="\r\n\r\n\r\n\r\n\r\n"), [START]),
        (HEADER + part(PLAIN), [START]),
        (BEAT_PART, [BEAT]),
        (part(DATA) + BEAT_PART + part(PLAIN.replace("Start", "Stop")), [START, BEAT, STOP]),
    ],
)
def test_an_event_is_read_at_once_in_every_form(text: str, expected: list[Event]) -> None:
    assert Parser().feed(text.encode()) == expected


@pytest.mark.parametrize("length", [5, 44, 60, 200, 100000])
def test_a_wrong_length_is_overruled_by_the_next_boundary(length: int) -> None:
    parser = Parser()
    assert parser.feed((part(DATA, length=length) + BEAT_PART).encode())[-1:] == [BEAT]
    assert Parser().feed((part(DATA, length=length) + BEAT_PART).encode()) == [START, BEAT]


def test_rubbish_between_parts_is_passed_over() -> None:
    text = "xx--mybound" + part(PLAIN) + "\0\0--\r\n--myboundary\r\nno header\r\n\r\nCode=?;\r\n" + BEAT_PART
    assert Parser().feed(text.encode()) == [START, BEAT]


def test_a_flood_without_a_boundary_is_not_kept() -> None:
    parser = Parser()
    for _ in range(100):
        assert parser.feed(b"--myboundary\r\nContent-Length: 99999999\r\n\r\n" + b"x" * 20000) == []
    assert len(parser._waiting) < 2 * events.MOST
    assert parser.feed(part(PLAIN).encode() + BEAT_PART.encode())[-1] == BEAT


PARTS = st.sampled_from(
    [
        part(DATA, after="\r\n\r\n\r\n"),
        part(REGION, space=" "),
        part(PLAIN, length=39),
        part(DATA, length=50),
        part(PLAIN, length=44),
        part(PLAIN, before="\r\n"),
        part(PLAIN.replace("Start", "Stop"), after="\r\n"),
        BEAT_PART,
        HEADER,
        "\r\n\r\n",
        "garbage--my",
    ]
)


@given(st.lists(PARTS, max_size=8), st.lists(st.integers(0, 1500), max_size=12))
def test_however_the_network_cuts_it_the_events_are_the_same(parts: list[str], cuts: list[int]) -> None:
    data = "".join(parts).encode()
    whole = Parser().feed(data)
    parser, pieces = Parser(), list[Event]()
    for start, end in pairwise([0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]):
        pieces += parser.feed(data[start:end])
    assert pieces == whole


@given(st.lists(PARTS, max_size=6))
def test_byte_by_byte_gives_the_same_too(parts: list[str]) -> None:
    data = "".join(parts).encode()
    parser = Parser()
    assert [event for at in range(len(data)) for event in parser.feed(data[at : at + 1])] == Parser().feed(data)


@pytest.mark.parametrize(
    ("header", "name"),
    [
        ("multipart/x-mixed-replace; boundary=myboundary", "myboundary"),
        ('multipart/x-mixed-replace;boundary="--abc"', "abc"),
        ("multipart/x-mixed-replace", "myboundary"),
    ],
)
def test_the_boundary_is_the_one_of_the_header(header: str, name: str) -> None:
    assert events.boundary(header) == name


def test_the_request_line_has_raw_brackets() -> None:
    target = events.attach(("VideoMotion", "AlarmLocal"), 4)
    assert target == "/cgi-bin/eventManager.cgi?action=attach&codes=[VideoMotion,AlarmLocal]&heartbeat=4"


@pytest.mark.parametrize(("body", "on"), [("channels[0]=0\r\n", True), ("Error: No Events\r\n", False), ("", False)])
def test_whether_motion_is_going_on_is_read(body: str, on: bool) -> None:
    assert events.read_indexes(body) is on
