"""How much is kept for pages: what goes first when there is no room, and what never goes."""

from __future__ import annotations

import asyncio
import json

import pytest

from services.dashboard.hub import PAST_TEXT, QUEUE, QUEUE_TEXT, Group, Hub, Page
from services.dashboard.latest import MOST_TEXT, MOST_TOPICS
from services.dashboard.service import LINK
from services.dashboard.view import LONGEST, View
from tests.dashboard.test_view import entry, rows, said


def room(hub: Hub, kind: str, many: int = MOST_TOPICS, text: str = "x") -> None:
    """Says something on so many topics that nobody has seen before."""
    what = "state" if kind == "s" else "command"
    begin = len(hub.latest)
    hub.spread([entry(f"home/More_{begin + number}/{what}", text, kind) for number in range(many)])


@pytest.mark.parametrize("kind", ["s", "c"])
def test_that_the_broker_is_there_is_known_however_much_is_said(kind: str) -> None:
    hub = Hub()
    hub.spread([entry(LINK, "online")])
    room(hub, kind)
    room(hub, kind)
    assert len(hub.latest) == MOST_TOPICS
    assert hub.latest[LINK].text == "online"
    assert [LINK, "online", 1000, "s"] in json.loads(hub.snapshot(Group(("#",))))


def test_without_room_commands_go_before_states_and_the_oldest_before_those_that_were_said_again() -> None:
    hub = Hub()
    hub.spread([entry("home/A/state", "1"), entry("home/B/state", "1"), entry("home/C/command", "ON", "c")])
    hub.spread([entry("home/A/state", "2")])
    room(hub, "c")
    assert ("home/A/state" in hub.latest, "home/B/state" in hub.latest) == (True, True)
    assert "home/C/command" not in hub.latest
    room(hub, "s", MOST_TOPICS - 1)
    assert hub.latest["home/A/state"].text == "2"
    assert "home/B/state" not in hub.latest


def test_what_is_kept_has_a_bound_in_characters_too() -> None:
    hub, long = Hub(), "x" * 200_000
    hub.spread([entry("home/A/state", "1")])
    for number in range(100):
        hub.spread([entry(f"home/Long_{number}/state", long), entry("camera/ip1/order_result", long, "e")])
    told = hub.snapshot(Group(("#",)))
    assert MOST_TEXT - 2 * len(long) < sum(len(one.text) for one in hub.latest.values()) <= MOST_TEXT
    assert len(told) < MOST_TEXT + PAST_TEXT + 10_000
    assert "home/Long_99/state" in hub.latest
    assert "home/A/state" not in hub.latest
    for number in range(100):
        hub.spread([entry(f"home/Long_{number}/state", "short")])
    room(hub, "s", 1000)
    assert len(hub.latest) == 1100  # what went made room


def test_an_answer_is_told_and_not_kept() -> None:
    async def trial() -> None:
        hub = Hub()
        stream = hub.batches(("mission/#",))
        assert rows(await anext(stream)) == []
        for number in range(3):
            hub.spread([entry(f"mission/tiago/where/reply/page-{number}", "{}", "e")])
            assert rows(await anext(stream)) == [[f"mission/tiago/where/reply/page-{number}", "{}", 1000, "e"]]
        assert list(hub.latest) == []
        hub.close()

    asyncio.run(trial())


def test_a_page_that_does_not_read_holds_few_characters() -> None:
    async def trial() -> None:
        page = Page(Group(("#",)))
        page.behind = False
        for _ in range(QUEUE):
            page.put("x" * 1_000_000)
            assert sum(map(len, page.queue)) <= QUEUE_TEXT + 1_000_000
        assert page.behind

    asyncio.run(trial())


def test_json_is_whole_however_long_and_a_text_is_cut() -> None:
    view = View()
    places = {f"Place {number}": {"pan": 1.0, "tilt": 2.0, "zoom": 0.0, "preset": None} for number in range(500)}
    view.take(said("camera/ip1/places", json.dumps(places)), 100.0)
    view.take(said("home/A/state", "x" * 2 * LONGEST), 100.0)
    whole, cut = (one.text for one in view.batch(100.0))
    assert len(whole) > LONGEST
    assert json.loads(whole) == places
    assert cut == "x" * LONGEST
