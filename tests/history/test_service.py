"""The service by `handle`: every question gets its answer, and a database that is away is told."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from services import topics
from services.apartment.home import Home
from services.bus import Message
from services.errors import Unavailable
from services.history import Config, start
from services.history.service import History
from services.payloads import Point
from services.payloads.robot import MissionEvent, MissionResult
from services.storage import Batch, Item, Mission, Sample, open_storage
from services.topics import HISTORY_GET, LateCommand
from tests.storage.day import at

NOW = at("10:00")


def asked(**question: object) -> Message:
    return Message(HISTORY_GET.name(), json.dumps({"id": "q1", **question}).encode(), received=NOW)


def filled(folder: Path) -> Config:
    storage = open_storage("sqlite:///bus.db", folder)
    storage.add_items([Item("Note", "String")])
    storage.write(Batch([Sample("Note", round(at("07:00") * 1e6) + n, None, f"{n} " + "ä" * 1000) for n in range(300)]))
    storage.close()
    return Config(url="sqlite:///bus.db", folder=folder, home=Home(items={}))


def test_a_question_is_answered_on_its_own_topic_and_where_it_asks_for_it(tmp_path: Path) -> None:
    with start(filled(tmp_path), lambda message: None) as service:
        question = asked(item="Note", limit=1)._replace(reply_to="reply/me", correlation=b"7")
        told, also = service.handle(question, NOW)
        assert told.topic == "history/reply/q1"
        assert not told.retain
        answer = json.loads(told.payload)
        assert answer["samples"][0][0] == "2026-01-31T07:00:00.000Z"
        assert answer["error"] is None
        assert (also.topic, also.correlation, also.payload) == ("reply/me", b"7", told.payload)
        assert service.counters["questions"] == 1


def test_missions_are_told_as_they_were_when_they_ended(tmp_path: Path) -> None:
    def mission(name: str, began: str, **more: object) -> Mission:
        unknown = dict.fromkeys(("reason", "place", "x", "y", "z", "seen_by", "ended", "story"))
        started = round(at(began) * 1e6)
        return Mission(mission=name, robot="tiago", marker=582, started=started, **{**unknown, "state": "go", **more})

    found = {
        "state": "found", "reason": "seen", "place": "Sofa", "x": 1.0, "y": 2.0, "z": 0.5, "seen_by": "ip1",
        "ended": round(at("07:01") * 1e6), "story": '[[0.0, "go", "to Sofa"], [59.5, "found", "there"]]',
    }  # fmt: skip
    storage = open_storage("sqlite:///bus.db", tmp_path)
    storage.write(Batch(rows=[mission("m1", "07:00", **found), mission("goes on", "08:00")]))
    storage.close()
    with start(filled(tmp_path), lambda message: None) as service:
        (told,) = service.handle(asked(what="missions", limit=5), NOW)
        ((robot, result),) = topics.read(told, NOW).payload.missions
    assert robot == "tiago"
    assert result == MissionResult(
        id="m1", marker=582, state="found", reason="seen", place="Sofa", position=Point(x=1.0, y=2.0, z=0.5), by="ip1",
        elapsed_s=60.0, stamp="2026-01-31T07:01:00.000Z",
        story=[
            MissionEvent(at_s=0.0, state="go", text="to Sofa"), MissionEvent(at_s=59.5, state="found", text="there"),
        ],
    )  # fmt: skip


def test_an_answer_that_fits_into_no_message_is_told(tmp_path: Path) -> None:
    with start(filled(tmp_path), lambda message: None) as service:
        (told,) = service.handle(asked(item="Note"), NOW)
        assert json.loads(told.payload)["error"] == "too long an answer: ask for less"


def test_a_question_of_yesterday_is_refused(tmp_path: Path) -> None:
    with start(filled(tmp_path), lambda message: None) as service, pytest.raises(LateCommand):
        list(service.handle(asked(item="Note"), NOW + 60))


def test_a_database_that_is_away_is_told_and_tried_again_later(tmp_path: Path) -> None:
    opened: list[float] = []

    def opener():  # type: ignore[no-untyped-def]
        opened.append(1)
        if len(opened) == 1:
            raise Unavailable("2003")
        return open_storage("sqlite:///bus.db", tmp_path)

    filled(tmp_path)
    service = History(opener)
    errors = []
    for later in (0.0, 0.5, 2.0):
        (told,) = service.handle(asked(item="Note", limit=1)._replace(received=NOW + later), NOW + later)
        errors.append(json.loads(told.payload)["error"])
    service.close()
    assert errors == ["the database is away: 2003", "the database is away: 2003", None]
    assert len(opened) == 2
