"""Batches of what goes on, and who is handed them."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

from services.bus import Message
from services.dashboard.hub import QUEUE, Group, Hub, Page
from services.dashboard.view import BATCH_S, RATES, Entry, View, heard, sayable
from services.errors import BadMessage


def said(topic: str, text: str, at: float = 0.0) -> Message:
    return Message(topic, text.encode(), received=at)


def test_the_first_change_after_a_pause_goes_out_at_once_and_the_next_ones_together() -> None:
    view = View()
    view.take(said("home/A/state", "1"), 100.0)
    assert [entry.text for entry in view.batch(100.0)] == ["1"]
    view.take(said("home/A/state", "2"), 100.01)
    view.take(said("home/A/state", "3"), 100.02)
    view.take(said("home/B/state", "4"), 100.03)
    assert view.batch(100.05) == ()
    assert view.due == pytest.approx(100.0 + BATCH_S)
    assert [(entry.topic, entry.text) for entry in view.batch(100.1)] == [("home/A/state", "3"), ("home/B/state", "4")]
    assert view.due is None


def test_of_events_all_are_told() -> None:
    view = View()
    for number in range(3):
        view.take(said("camera/ip1/audio", f'{{"file": "{number}.wav", "seconds": 1.0, "bytes": 8}}'), 100.0)
    assert [json.loads(entry.text)["file"] for entry in view.batch(100.0)] == ["0.wav", "1.wav", "2.wav"]


def test_messages_per_second_are_told_by_the_first_level() -> None:
    view = View()
    view.batch(100.0)
    for number in range(20):
        view.take(said("home/A/state", str(number)), 100.5)
    rates = [json.loads(entry.text) for entry in view.batch(102.0) if entry.topic == RATES]
    assert rates == [{"home": 10.0}]


@pytest.mark.parametrize(
    ("topic", "text", "fault"),
    [
        ("nowhere/at/all", "1", "no topic like"),
        ("camera/ip1/position", '{"pan": "x"}', "pan"),
        ("camera/ip1/places", "[", "places"),
        ("camera/ip1/order_result", "", "payload"),
    ],
)
def test_what_is_not_as_the_table_says_never_comes_to_a_page(topic: str, text: str, fault: str) -> None:
    view = View()
    with pytest.raises(BadMessage, match=fault):
        view.take(said(topic, text), 0.0)
    assert view.due is None


@pytest.mark.parametrize("retain", [True, False])  # without: it came while we listened (MQTT 5, 3.3.1.3)
def test_a_retained_topic_that_was_taken_away_is_told_as_that(retain: bool) -> None:
    view = View()
    view.take(said("camera/ip1/marker/582", "")._replace(retain=retain), 100.0)
    assert view.batch(100.0) == (Entry("camera/ip1/marker/582", "", 0, "s"),)


@pytest.mark.parametrize(
    ("topic", "payload", "fault"),
    [
        ("home/Kitchen_Light/state", "ON", "may not say that"),
        ("camera/ip1/places", "{}", "may not say that"),
        ("service/mission/status", "offline", "may not say that"),
        ("nowhere", "", "no topic like"),
        ("mission/tiago/order", '{"find": "yes"}', "find"),
        ("home/+/command", "ON", "no topic like"),
    ],
)
def test_what_the_dashboard_may_not_say_is_refused(topic: str, payload: str, fault: str) -> None:
    with pytest.raises(BadMessage, match=fault):
        sayable(said(topic, payload))


def test_what_it_may_say_goes_out_as_its_topic_wants() -> None:
    message = sayable(said("home/Kitchen_Light/command", "ON")._replace(retain=False, qos=0))
    assert (message.retain, message.qos, message.expires_s) == (False, 1, 5)


def test_of_pictures_only_those_are_listened_to_that_cannot_be_fetched() -> None:
    assert "camera/+/snapshot" not in heard()
    assert "camera/+/scan/image" in heard()
    assert "home/+/state" in heard()


def entry(topic: str, text: str, kind: str = "s") -> Entry:
    return Entry(topic, text, 1000, kind)


def rows(event: str) -> Any:
    return json.loads(event.partition("data: ")[2])


def test_a_page_is_given_everything_then_what_changes_of_what_it_asks_for() -> None:
    async def trial() -> None:
        hub = Hub()
        hub.spread([entry("home/A/state", "1"), entry("camera/ip1/status", "x")])
        stream = hub.batches(("home/+/state",))
        first = await anext(stream)
        assert first.startswith("event: snapshot\n")
        assert rows(first) == [["home/A/state", "1", 1000, "s"]]
        hub.spread([entry("home/A/state", "2"), entry("camera/ip1/status", "y")])
        assert rows(await anext(stream)) == [["home/A/state", "2", 1000, "s"]]
        assert hub.pages == 1
        await stream.aclose()  # type: ignore[attr-defined]
        assert hub.pages == 0

    asyncio.run(trial())


def test_a_page_that_does_not_keep_up_is_given_everything_anew_and_holds_no_queue() -> None:
    async def trial() -> None:
        hub = Hub()
        slow, quick = hub.batches(("home/#",)), hub.batches(("home/#",))
        await anext(slow)
        await anext(quick)
        for number in range(QUEUE * 3):
            hub.spread([entry("home/A/state", str(number)), entry(f"home/B{number}/state", "x")])
            assert rows(await anext(quick))[0][1] == str(number)
        again = await anext(slow)
        assert again.startswith("event: snapshot\n")
        assert ["home/A/state", str(QUEUE * 3 - 1), 1000, "s"] in rows(again)
        hub.close()

    asyncio.run(trial())


def test_a_page_holds_a_bounded_queue() -> None:
    async def trial() -> None:
        page = Page(Group(("#",)))
        page.behind = False
        for _ in range(QUEUE * 10):
            page.put("x")
        assert len(page.queue) <= QUEUE

    asyncio.run(trial())


def test_what_was_is_told_before_what_is_and_a_topic_taken_away_is_gone() -> None:
    hub = Hub()
    for number in range(3):
        hub.spread([entry("camera/ip1/order_result", str(number), "e")])
    hub.spread([entry("home/A/state", "1")])
    hub.spread([entry("home/A/state", "")])
    told = json.loads(hub.snapshot(Group(("#",))))
    assert [row[1] for row in told] == ["0", "1", "2"]
