"""Where was a marker last: answered at once, with its age, and by a new scan where that is too old."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from services.bus import Message
from services.mission.refresh import Refresh
from services.payloads import OrderResult
from services.payloads.robot import Where, WhereReply
from services.topics import read
from services.virtual import VirtualApartment
from tests.trials import virtual_flat

FRESH_S = 40.0


class Asker:
    """Asks in a virtual flat, and hears everything that is said there."""

    def __init__(self, flat: VirtualApartment) -> None:
        self.flat = flat
        self.heard: list[Message] = []

    def ask(self, name: str, marker: int = 582, **fields: object) -> WhereReply:
        """The first answer, which has to come at once."""
        self.flat.client.say("mission/tiago/where", json.dumps({"marker": marker, "id": name, **fields}))
        assert self.flat.until(lambda: bool(self.replies(name)), 1.0)
        return self.replies(name)[0]

    def replies(self, name: str) -> list[WhereReply]:
        """All answers so far."""
        self.heard.extend(self.flat.client.pump())
        topic = f"mission/tiago/where/reply/{name}"
        return [read(one, self.flat.now).payload for one in self.heard if one.topic == topic]

    def scans(self) -> int:
        """How many scans were ordered."""
        self.heard.extend(self.flat.client.pump())
        return sum(one.topic == "camera/ip1/order/Scan" for one in self.heard)

    def again(self, name: str) -> WhereReply:
        """The second answer."""
        assert self.flat.until(lambda: len(self.replies(name)) > 1, 300.0)
        return self.replies(name)[1]


@pytest.fixture
def asker(tmp_path: Path) -> Iterator[Asker]:
    def quicker(config: Path) -> None:
        text = config.read_text().replace("targets: [582]", "targets: [582]\n    frames: 1")
        config.write_text(text.replace("mission:\n", f"mission:\n  fresh_s: {FRESH_S}\n"))

    with virtual_flat(tmp_path, quicker) as flat:
        yield Asker(flat)


def test_a_marker_that_nobody_has_seen_is_looked_for_and_told_when_found(asker: Asker) -> None:
    first = asker.ask("a")
    assert (first.sightings, first.refreshing) == ([], True)
    second = asker.again("a")
    assert ([one.by for one in second.sightings], second.refreshing) == (["ip1"], False)
    assert second.sightings[0].place == "Living room"
    assert asker.scans() == 1


def test_a_sighting_ages_and_is_refreshed_when_it_is_too_old(asker: Asker) -> None:
    asker.ask("a")
    asker.again("a")
    young = asker.ask("b")
    asker.flat.until(lambda: False, 10.0)
    older = asker.ask("c")
    assert older.sightings[0].age_s == pytest.approx(young.sightings[0].age_s + 10, abs=1.5)
    assert (young.refreshing, older.refreshing, asker.scans()) == (False, False, 1)
    asker.flat.until(lambda: False, FRESH_S)
    old = asker.ask("d")
    assert old.refreshing
    assert old.sightings[0].age_s > FRESH_S
    assert asker.again("d").sightings[0].age_s < FRESH_S
    assert asker.scans() == 2


def test_who_wants_no_scan_gets_none(asker: Asker) -> None:
    assert not asker.ask("a", refresh=False).refreshing
    asker.flat.until(lambda: False, 5.0)
    assert asker.scans() == 0


def test_two_who_ask_share_one_look(asker: Asker) -> None:
    assert asker.ask("a").refreshing
    assert asker.ask("b").refreshing
    assert asker.again("a").sightings == asker.again("b").sightings
    assert asker.scans() == 1


def test_a_look_that_somebody_stops_is_told_and_not_made_again_at_once(asker: Asker) -> None:
    assert asker.ask("a", marker=999).refreshing
    asker.flat.client.say("camera/ip1/order/Scan", "OFF")
    assert asker.again("a").sightings == []
    assert not asker.ask("b", marker=999).refreshing
    assert asker.scans() == 2  # ours, and the one that stopped it


def test_a_mission_keeps_the_cameras_to_itself(asker: Asker) -> None:
    asker.flat.client.say("mission/tiago/order", '{"find": 582, "id": "m"}')
    asker.flat.until(lambda: False, 2.0)
    assert not asker.ask("a", marker=17).refreshing
    assert asker.scans() == 0


def test_a_look_without_an_end_is_over_after_its_time() -> None:
    refresh = Refresh(FRESH_S, 240.0)
    asked = Where(marker=582, id="a")
    (order,) = refresh.begin("tiago", asked, ["ip1"], 1000.0)
    assert refresh.due == 1240.0
    assert refresh.late(1239.0) == []
    assert refresh.late(1240.0) == [("tiago", asked)]
    assert refresh.due is None
    late = OrderResult(id=json.loads(order.payload)["id"], key="Scan", value="", state="done", error=None)
    assert refresh.ended(late) == []


def test_a_look_ends_with_its_last_camera() -> None:
    refresh = Refresh(FRESH_S, 240.0)
    orders = list(refresh.begin("tiago", Where(marker=582, id="a"), ["ip1", "hall"], 1000.0))
    ids = [json.loads(order.payload)["id"] for order in orders]
    ends = [OrderResult(id=one, key="Scan", value="", state="cancelled", error="by a human") for one in ids]
    assert refresh.ended(ends[0]) == []
    assert [asked.id for _, asked in refresh.ended(ends[1])] == ["a"]
