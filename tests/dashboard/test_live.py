"""What pages make of what they hear: long words, what is taken away, and a part of a page that fails."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from services.client import Client
from services.peers import wait_until
from tests.dashboard.browser import WAIT_MS, view

pytestmark = [pytest.mark.mosquitto, pytest.mark.chromium]

RESULT = {
    "camera": "ip1", "marker": 999, "dictionary": "DICT_5X5_1000", "place": "Kitchen", "position": None,
    "why": "one look", "first_seen": "2026-01-31T07:05:00.123Z", "stamp": "2026-01-31T07:05:00.123Z", "scan": "tried",
}  # fmt: skip


@contextmanager
def borrowed(bus: Client, topic: str) -> Iterator[Any]:
    """A state that somebody else has said; it is said again in the end."""
    before = bus.until(lambda message: message.topic == topic, 20.0, topic).payload
    try:
        yield json.loads(before)
    finally:
        bus.say(topic, before, retain=True)


def test_hundreds_of_places_are_all_shown(shown: Page, bus: Client) -> None:
    with borrowed(bus, "camera/ip1/places"):
        view(shown, "camera")
        place = {"pan": 1.0, "tilt": 2.0, "zoom": 0.0, "preset": None}
        bus.say("camera/ip1/places", json.dumps({f"Place {number}": place for number in range(500)}), retain=True)
        expect(shown.locator(".places button")).to_have_count(500, timeout=WAIT_MS)
        assert len(shown.request.get("/api/cameras/ip1/places").json()) == 500


def test_a_marker_that_is_taken_away_is_gone_from_an_open_page(shown: Page, bus: Client) -> None:
    view(shown, "camera")
    row = shown.locator(".found li", has_text="999")
    bus.say("camera/ip1/marker/999", json.dumps(RESULT), retain=True)
    row.wait_for()
    bus.say("camera/ip1/marker/999", "", retain=True)
    row.wait_for(state="detached")


@pytest.mark.parametrize(
    ("name", "topic", "changed", "shows"),
    [
        ("missions", "mission/tiago/state", {"reason": "heard afterwards"}, "heard afterwards"),
        ("camera", "camera/ip1/position", {"pan": 12.3}, "12.3°"),
        ("camera", "camera/ip1/scan/state", {"state": "failed", "reason": "heard afterwards"}, "heard afterwards"),
    ],
)
def test_a_state_that_is_taken_away_and_said_again_is_no_fault_of_the_page(
    shown: Page, bus: Client, name: str, topic: str, changed: dict[str, Any], shows: str
) -> None:
    with borrowed(bus, topic) as before:
        view(shown, name)
        bus.say(topic, "", retain=True)
        wait_until(lambda: shown.request.get(f"/api/states?topics={topic}").json() == {}, "nothing to be there")
        bus.say(topic, json.dumps({**before, **changed}), retain=True)
        shown.get_by_text(shows).first.wait_for()


def test_a_part_of_the_page_that_fails_takes_nothing_from_the_others(shown: Page, bus: Client) -> None:
    view(shown, "apartment")
    shown.evaluate(
        """async () => {
          const told = document.body.dataset;
          window.addEventListener("error", (event) => { told.failed = event.message; event.preventDefault(); });
          const live = await import("/live.js");
          live.watch("home/Tried/state", () => { throw new Error("one part fails"); });
          live.watch("home/Tried/state", (entry) => { told.heard = entry.text; });
        }"""
    )
    for text in ("ON", "OFF", ""):
        bus.say("home/Tried/state", text, retain=True)
        expect(shown.locator("body")).to_have_attribute("data-heard", text, timeout=WAIT_MS)
    expect(shown.locator("body")).to_have_attribute("data-failed", re.compile("one part fails"))
