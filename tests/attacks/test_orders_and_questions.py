"""What an intruder with an account tries by orders, keys and questions, and what happens instead.

Not here: rubbish on every topic (`tests/trials.py`), files to play (`tests/camera/test_sound_on_the_wire.py`), retained
commands (`tests/test_topics.py`, `tests/camera/test_service.py`), the dashboard.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from services import topics
from services.apartment.home import Home
from services.bus import Message
from services.errors import BadMessage
from services.history import Config, start
from services.storage import Batch, CameraOrder, Diagnostic, Item, Sample, Scan, Sighting, open_storage
from services.topics import HISTORY_GET, HOME_STATE, TABLE
from tests.camera.flat import Flat
from tests.databases import Database

T = 1_769_839_200.0
US = 1_000_000
QUOTES = ["'; DROP TABLE sample; --", '" OR 1=1; --', "\\'; DELETE FROM item; --", "x\\", "%s %(a)s {} ?", "\\0\x1a`;#"]
PATHS = ["../../outside", "/etc/cron.d/outside", "..", "C:\\outside", "~/.ssh/outside", "places: {outside: [1, 2]}"]


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("name", PATHS)
def test_a_place_named_like_a_path_is_a_name_and_nothing_else(tmp_path: Path, name: str) -> None:
    inside = tmp_path / "a" / "b" / "places"
    inside.mkdir(parents=True)
    flat = Flat(tmp_path / "a" / "b", places=Path("places")).online()
    flat.order("SaveAs", name)
    flat.until(flat.ended)
    assert flat.states()[-1] == "done"
    written = {f"a/b/places/preset_{what}.yaml" for what in ("position", "coords")}
    assert files(tmp_path) == written
    assert list(yaml.safe_load((inside / "preset_position.yaml").read_text())) == [name]
    flat.order("Remove", "../places/preset_position.yaml", order_id="2")
    assert flat.states("2") == ["refused"]
    flat.order("Remove", name, order_id="3")
    flat.until(lambda: flat.ended("3"))
    assert files(tmp_path) == written


@pytest.mark.parametrize(
    "wanted",
    ["camera/ip1/order/Reboot", "home/Front_Door/command", "home/Smoke/state", "service/bridge/status",
     "robot/tiago/goto", "a/+/b", "#", "$SYS/broker/x", "/bridge/link", "a\0b", "x" * 5000],
)  # fmt: skip
def test_an_answer_is_not_sent_where_the_asker_may_not_write_himself(tmp_path: Path, wanted: str) -> None:
    """The service's own rights are wider than his: with them the answer would be a command."""
    flat = Flat(tmp_path, places=Path()).online()
    flat.send("camera/ip1/order/ScanImgPub", b"ON", reply_to=wanted)
    assert {message.topic for message in flat.said if "order_result" in message.topic}
    assert wanted not in {message.topic for message in flat.said}


@pytest.mark.parametrize(
    "payload", [b'{"a":' + b"[" * 100_000, b'{"value":' * 20_000, b'{"id":"q","a":' + b"[" * 50_000]
)
@pytest.mark.parametrize("row", [pytest.param(row, id=row.pattern) for row in TABLE if row.payload not in (str, bytes)])
def test_json_without_a_bottom_is_a_bad_message(row: topics.Topic, payload: bytes) -> None:
    special = {"marker": "1", "component": "a"}
    topic = row.name(**{name: special.get(name, "a") for name in row.names})
    with pytest.raises(BadMessage):
        topics.read(Message(topic, payload, received=T), T)


@pytest.mark.parametrize("number", ["1e301", "-1e308", "1e999"])
def test_a_goal_beyond_all_numbers_is_refused_and_the_camera_goes_on(tmp_path: Path, number: str) -> None:
    """It would come back in the answer, where such a number is no number."""
    flat = Flat(tmp_path, places=Path()).online()
    with pytest.raises(BadMessage, match="pan"):
        topics.read(Message("camera/ip1/position/set", f'{{"pan": {number}}}'.encode(), received=T), T)
    with pytest.raises(BadMessage, match="x: "):
        topics.read(Message("robot/tiago/goto", f'{{"x": {number}, "y": 1}}'.encode(), received=T), T)
    flat.send("camera/ip1/position/set", b'{"pan": 1e300, "id": "1"}')
    assert flat.states("1") == ["refused"]


@pytest.mark.parametrize("row", [pytest.param(row, id=row.pattern) for row in TABLE])
def test_what_is_too_large_is_refused_before_it_is_looked_at(row: topics.Topic) -> None:
    special = {"marker": "1", "attribute": "$name", "trait": "$name"}
    topic = row.name(**{name: special.get(name, "a") for name in row.names})
    limit = topics.BLOB_LIMIT if row.payload is bytes else topics.TEXT_LIMIT
    with pytest.raises(BadMessage, match="at most"):
        topics.read(Message(topic, b"[" * (limit + 1), received=T), T)


@pytest.mark.parametrize(
    "key", ["../Lamp", "a/b", "+", "#", "$SYS", "", "Lamp\0", "Lamp\n", "Lamp ", "x" * 70_000, "é", "Lamp/command"]
)
def test_a_key_never_becomes_another_topic(key: str) -> None:
    if key == "x" * 70_000:
        assert HOME_STATE.regex.fullmatch(f"home/{key}/state"), "the broker refuses it; ours is one item, never two"
        return
    with pytest.raises(BadMessage, match="is not a topic like"):
        HOME_STATE.name(item=key)


@pytest.mark.parametrize("text", QUOTES)
def test_what_looks_like_sql_is_stored_as_it_is(database: Database, text: str) -> None:
    """In every text of every table, through the storage that the service uses."""
    storage = open_storage(database.address)
    storage.add_items([Item("Note", "String"), Item("Lamp", "Switch", unit=text[:32])])
    at = round(T * US)
    storage.write(
        Batch(
            samples=[Sample("Note", at, None, text)],
            rows=[
                Sighting(text, text, 582, text, text, at, why=text, mode="bw"),
                Scan(text, text, "done", text, text, at, at, 8, 8),
                CameraOrder(text, text, text[:20], text, "done", text, at),
                Diagnostic(text, at, 0, text, text),
            ],
        )
    )
    storage.note(text, text[:20], 7)
    try:
        assert storage.last("Note") == Sample("Note", at, None, text)
        assert [(one.scan, one.place, one.why) for one in storage.sightings(582, 5)] == [(text, text, text)]
        assert storage.last_diagnostics()[text].message == text
        assert storage.noted(text, text[:20]) == 7
        assert storage.last(text) is None
        assert storage.samples(text) == []
    finally:
        storage.close()


@pytest.mark.parametrize("text", [*QUOTES, "Note' OR '1'='1", "_" * 10_000, "%", "Note\0"])
def test_a_question_with_sql_in_it_is_answered_with_an_error(tmp_path: Path, text: str) -> None:
    storage = open_storage("sqlite:///bus.db", tmp_path)
    storage.add_items([Item("Note", "String")])
    storage.write(Batch([Sample("Note", round(T * US), None, "kept")]))
    storage.close()
    config = Config(url="sqlite:///bus.db", folder=tmp_path, home=Home(items={}))
    questions = [{"item": text, "what": what} for what in ("samples", "last", "changes", "durations")]
    questions += [{"item": "Note", "since": text}, {"item": "Note", "until": text}]
    with start(config, lambda message: None) as service:
        for question in questions:
            told = _asked(service, question)
            assert told["error"], question
        for question in ({"limit": 10**30}, {"every": 1e308}, {"every": 1e-300}, {"what": "changes", "limit": 2**63}):
            assert _asked(service, {"item": "Note", **question})["item"] == "Note"
        assert _asked(service, {"item": "Note"})["samples"][0][1] == "kept"


def _asked(service: object, question: dict[str, object]) -> dict[str, object]:
    payload = json.dumps({"id": "q1", **question}).encode()
    (told, *_) = service.handle(Message(HISTORY_GET.name(), payload, received=T), T)  # type: ignore[attr-defined]
    answer: dict[str, object] = json.loads(told.payload)
    return answer
