"""The service by `handle`: every question gets its answer, and a database that is away is told."""

from __future__ import annotations

import json
import re
from itertools import islice
from pathlib import Path

import pytest

from services import topics
from services.apartment.home import Home
from services.bus import Message
from services.errors import BadMessage, Unavailable
from services.history import Config, start
from services.history.service import History
from services.payloads import Point
from services.payloads.robot import MissionEvent, MissionResult
from services.storage import Batch, Item, Mission, Sample, open_storage
from services.topics import HISTORY_GET
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


WRONG = {
    "no limit": (
        asked(item="Note", limit=0),
        "limit: Input should be greater than or equal to 1",
        "q1",
        "Note",
    ),
    "an unknown key": (asked(item="Note", many=1), "many: Extra inputs are not permitted, got '1'", "q1", "Note"),
    "retained": (asked(item="Note")._replace(retain=True), "refused, a retained command", "q1", "Note"),
    "of yesterday": (asked(item="Note")._replace(received=NOW - 60), "refused, 60.0 s old", "q1", "Note"),
    "of no item": (asked(item=["Note"]), "item: Input should be a valid string", "q1", None),
    "an id that is no level": (asked(id="a/+"), "id: String should match pattern", "", None),
    "no JSON": (Message("history/get", b"Note", received=NOW), "payload: Invalid JSON", "", None),
    "no object": (Message("history/get", b"[1]", received=NOW), "payload: Input should be an object", "", None),
    "no UTF-8": (Message("history/get", b'{"id": "q1\xff"}', received=NOW), "expected UTF-8", "", None),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_no_question_is_dropped_and_answered_where_that_is_possible(tmp_path: Path, what: str) -> None:
    question, error, name, item = WRONG[what]
    on = ([f"history/reply/{name}"] if name else []) + ["reply/me"]
    with start(filled(tmp_path), lambda message: None) as service:
        answers = service.handle(question._replace(reply_to="reply/me", correlation=b"7"), NOW)
        told = list(islice(answers, len(on)))
        with pytest.raises(BadMessage, match=re.escape(error)):
            next(answers)
    assert [one.topic for one in told] == on
    for one in told:
        answer = json.loads(one.payload)
        assert error in answer.pop("error")
        assert (answer["id"], answer["item"], answer["samples"]) == (name, item, [])


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
