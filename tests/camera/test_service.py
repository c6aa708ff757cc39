"""The camera service in virtual time: the life of orders, who wins, and the scan from order to result."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from services import payloads
from services.bus import Message
from services.camera.capabilities import Capabilities, GetCapabilities
from services.camera.device import (
    Away,
    BadLogin,
    Direction,
    MoveOver,
    MoveTo,
    SetPicture,
    Snapshot,
    Start,
    Status,
    Stop,
)
from services.camera.scan.modes import Before
from services.errors import BadMessage
from services.topics import read
from tests.camera.flat import Flat
from tests.camera.motors import Motors

POSITIONS = "Kitchen: [41.1, 34.5, 0]\nSofa: [350.0, 40.0, 0]\nDoor: [200.0, 20.0, 0]\n"
PRESETS = "Kitchen: 3\nSofa: 1\n"
LIFE = ["accepted", "running", "done"]


@pytest.fixture
def just_started(tmp_path: Path) -> Flat:
    (tmp_path / "preset_position.yaml").write_text(POSITIONS)
    (tmp_path / "preset_coords.yaml").write_text(PRESETS)
    return Flat(tmp_path, places=Path())


@pytest.fixture
def flat(just_started: Flat) -> Flat:
    return just_started.online()


def test_goto_is_accepted_runs_and_is_done_when_the_camera_rests_there(flat: Flat) -> None:
    flat.order("Goto", "Kitchen")
    flat.until(flat.ended)
    assert flat.states() == LIFE
    assert abs(flat.reading.pan - 41.1) <= 0.5
    assert abs(flat.reading.tilt - 34.5) <= 0.5
    assert flat.motors.running is None
    assert flat.last()["position"]["place"] == "Kitchen"
    assert flat.last()["position"]["moving"] is False


@pytest.mark.parametrize("takes", [True, False])
def test_forms_that_the_camera_says_it_does_not_take_are_not_tried(just_started: Flat, takes: bool) -> None:
    flat = just_started
    flat.camera.answers[GetCapabilities] = lambda asked: Capabilities(absolute=takes, relative=takes)
    flat.until(lambda: flat.service.abilities.present is not None)
    flat.order("Goto", "Door")
    flat.until(flat.ended)
    flat.order("Goto", "Sofa", order_id="2")  # a move tries but one or two of what it does not know
    flat.until(lambda: flat.ended("2"))
    tried = {request.form for request in flat.motors.sent if isinstance(request, MoveTo | MoveOver)}
    assert tried == {"PositionABS", "Position", *(("moveAbsolutely", "moveRelatively") if takes else ())}


@pytest.fixture(params=["honest", "idle", "stuck", "nothing"])
def saying(request: pytest.FixtureRequest, tmp_path: Path) -> Flat:
    """What its firmware says of its motion is true, or one thing for ever, or nothing."""
    (tmp_path / "preset_position.yaml").write_text(POSITIONS)
    return Flat(
        tmp_path, motors=Motors(says=request.param, absolute="full", acceleration=90.0, lag=0.3), places=Path()
    ).online()


def test_a_camera_that_stands_still_is_known_to_whatever_it_says(saying: Flat) -> None:
    flat = saying
    flat.run(5)
    assert flat.payloads("position")[-1]["moving"] is False
    for number, (key, order) in enumerate([("SaveAs", "Here"), ("Move", "Left 3 0.5"), ("Goto", "Here"), ("Zoom", 4)]):
        flat.order(key, order, order_id=str(number))
        flat.until(lambda number=number: flat.ended(str(number)))  # type: ignore[misc]
        assert flat.states(str(number)) == LIFE
        assert flat.last(str(number))["position"]["moving"] is False


def test_a_stop_in_the_middle_of_a_motion_is_done_when_the_camera_is_known_to_rest(saying: Flat) -> None:
    flat = saying
    flat.order("Move", "Left 4 20", order_id="far")
    flat.until(flat.started)
    flat.run(2)
    flat.order("Move", "Stop")
    flat.until(flat.ended)
    assert flat.last()["state"] == "done"
    assert flat.last()["position"]["moving"] is False


def looks_before(flat: Flat, number: int) -> int:
    """An order, carried out; how often the camera was looked at before it was told to turn."""
    before = len(flat.motors.sent)
    flat.order("Goto", ("Door", "Sofa", "Kitchen")[number % 3], order_id=str(number))
    flat.until(lambda: any(isinstance(one, MoveTo) for one in flat.motors.sent[before:]))
    looks = sum(isinstance(one, Status) for one in flat.motors.sent[before:])
    flat.until(lambda: flat.ended(str(number)))
    return looks


def test_an_order_some_seconds_after_another_one_needs_no_reading_to_begin_with(saying: Flat) -> None:
    for number in range(60):
        assert looks_before(saying, number) <= 1 or number < 2  # the one that was on its way
        assert saying.payloads("position")[-1]["moving"] is False
        saying.run(1.5 + 0.05 * number)  # before the first look after it, and after that


def test_a_camera_that_has_just_arrived_is_left_in_peace_for_two_seconds(saying: Flat) -> None:
    saying.run(5)
    for number, place in enumerate(("Door", "Sofa", "Kitchen")):
        saying.order("Goto", place, order_id=str(number))
        saying.until(lambda number=number: saying.ended(str(number)))  # type: ignore[misc]
        before = len(saying.motors.sent)
        saying.run(1.5)
        assert not [one for one in saying.motors.sent[before:] if isinstance(one, Status)]
        saying.run(1.5)
        assert [one for one in saying.motors.sent[before:] if isinstance(one, Status)]


def test_a_camera_that_somebody_else_turns_is_followed_every_second(flat: Flat) -> None:
    flat.run(30)
    flat.motors.answer(Start(Direction.LEFT, 1))  # by the maker's app
    flat.run(5)
    before = len(flat.motors.sent)
    flat.run(10)
    assert sum(isinstance(one, Status) for one in flat.motors.sent[before:]) >= 6  # each takes a while itself
    assert flat.payloads("position")[-1]["moving"] is True


def test_an_order_after_a_long_rest_needs_no_reading_to_begin_with(saying: Flat) -> None:
    for number in range(12):
        saying.run(20.0 + 0.2 * number)  # looks are two seconds apart there
        assert looks_before(saying, number) <= 1


def test_keys_and_place_names_are_matched_without_regard_to_case(flat: Flat) -> None:
    flat.order("gOtO", "kitchen")
    flat.until(flat.ended)
    assert flat.last()["key"] == "Goto"
    assert flat.states() == LIFE


@pytest.mark.parametrize(
    ("topic", "payload", "fields", "key", "order_id", "told"),
    [
        ("order/Goto", b'{"value": "Kitchen", "id": "late"}', {"retain": True}, "Goto", "late", "a retained command"),
        ("order/goto", b"Kitchen", {"received": 1.0}, "Goto", None, "s old"),
        ("order/Scan", b'{"value": ', {}, "Scan", None, "Invalid JSON"),
        ("order/Goto", b"\xff\xfe", {}, "Goto", None, "UTF-8"),
        ("position/set", b'{"pan": 10, "id": "p"}', {"retain": True}, "Position", "p", "a retained command"),
        ("position/set", b"{}", {}, "Position", None, "at least one"),
        ("position/set", b'{"pan": "far", "id": "x"}', {}, "Position", "x", "tilt -10 to 108"),
        ("position/set", b'{"pan": NaN, "id": 7}', {}, "Position", "7", "pan 0 to 360"),
        ("order/Goto", b'{"value": 1e999, "id": "inf", "by": "mission"}', {}, "Goto", "inf", "finite"),
        ("order/Goto", b'{"value": "Kitchen", "by": "cat", "id": "c"}', {}, "Goto", "c", "by"),
        ("order/Goto", b'{"id": {"id": 1}, "value": 1}', {}, "Goto", None, "id"),
        ("order/Goto", b'{"a":' * 9999, {}, "Goto", None, "Invalid JSON"),
        ("order/Zoom", b'{"value": NaN, "id": "z"}', {}, "Zoom", "z", "zoom 0 to 8"),
        ("order/Zoom_In", b'{"value": 1, "id": "k"}', {}, "Zoom_In", "k", "no topic like 'camera/ip1/order/Zoom_In'"),
        ("order/Goto2", b"Kitchen", {}, "Goto2", None, "no topic"),
        ("order/", b"Kitchen", {}, "", None, "no topic"),
        ("order/Move", b"Sideways", {}, "Move", None, "expected Stop"),
    ],
)
def test_an_order_that_is_late_or_makes_no_sense_is_refused_with_an_answer(
    flat: Flat, topic: str, payload: bytes, fields: dict[str, Any], key: str, order_id: str | None, told: str
) -> None:
    message = Message(f"camera/ip1/{topic}", payload, received=flat.now)._replace(**fields)
    with pytest.raises(BadMessage):
        list(flat.service.handle(message, flat.now))
    answers = [
        read(one, flat.now).payload for one in flat.service.tick(flat.now) if one.topic.endswith("/order_result")
    ]
    assert [(answer.state, answer.key) for answer in answers] == [("refused", key)]
    assert told in (answers[0].error or "")
    assert order_id in (None, answers[0].id)
    assert flat.motors.running is None


def test_the_answer_also_goes_where_the_one_who_asked_wants_it(flat: Flat) -> None:
    flat.send("camera/ip1/order/ScanImgPub", b"ON", reply_to="answers/me", correlation=b"7")
    answers = [message for message in flat.said if message.topic == "answers/me"]
    assert [json.loads(message.payload)["state"] for message in answers] == LIFE
    assert {message.correlation for message in answers} == {b"7"}


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("Goto", "Garden", "no place 'Garden'; there are: Kitchen, Sofa, Door"),
        ("Dance", "now", "no order 'Dance'"),
        ("RTSP", "ON", "not available"),
        ("AudioPlay", "../secret.wav", "a file in the audio folder"),
        ("AudioPlay", "é" * 128, "a file in the audio folder"),
        ("AudioRec", "-1", "seconds from 0 to 600"),
        ("VideoMode", "sepia", "expected color, bw, auto, scan"),
        ("Move", "Sideways", "expected Stop"),
        ("Move", "Left 9", "speed from 1 to 8"),
        ("Move", "Left 3 0", "seconds from 0"),
        ("Scan", "maybe", "expected True or False"),
        ("Scan", {"places": ["Garden"]}, "no place 'Garden'"),
        ("SetTarget", "five", "marker ids"),
        ("Zoom", "9", "zoom 9 is out of range 0 to 8"),
    ],
)
def test_an_order_that_cannot_be_done_is_refused_with_the_reason(
    flat: Flat, key: str, value: object, told: str
) -> None:
    flat.order(key, value)
    assert flat.states() == ["refused"]
    assert told in flat.last()["error"]
    assert not flat.started()
    assert flat.service.counters["orders_refused"] == 1


def test_an_order_that_nobody_can_read_is_dropped_like_any_other_bad_message(flat: Flat) -> None:
    flat.order("Dance", "now")
    flat.order("Move", "Sideways")
    assert [text.partition(":")[0] for text in flat.dropped] == ["camera/ip1/order/Dance", "camera/ip1/order/Move"]
    flat.order("Goto", "Garden")  # this one was understood
    assert len(flat.dropped) == 2


def test_position_set_moves_and_leaves_what_is_left_out(flat: Flat) -> None:
    flat.send("camera/ip1/position/set", b'{"pan": 60, "id": "1"}')
    flat.until(flat.ended)
    assert flat.last()["key"] == "Position"
    assert flat.last()["value"] == {"pan": 60.0}
    assert abs(flat.reading.pan - 60) <= 0.5
    assert flat.reading.tilt == 20.0


def test_a_goal_in_the_dead_arc_is_clamped_and_says_so(flat: Flat) -> None:
    flat.send("camera/ip1/position/set", b'{"pan": 181, "id": "1"}')
    flat.until(flat.ended)
    assert flat.last()["state"] == "done"
    assert flat.last()["clamped"] is True


def test_a_position_out_of_range_is_refused_naming_the_range(flat: Flat) -> None:
    flat.send("camera/ip1/position/set", b'{"tilt": 120, "id": "1"}')
    assert flat.last()["state"] == "refused"
    assert "-10 to 108" in flat.last()["error"]


@pytest.mark.parametrize("word", ["LeftUp", "UpLeft", "left-up", "up_left"])
def test_a_diagonal_may_be_named_either_way_round(flat: Flat, word: str) -> None:
    flat.order("Move", f"{word} 3 0.5")
    flat.until(flat.ended)
    assert flat.states() == LIFE
    (start,) = (request for request in flat.motors.sent if isinstance(request, Start))
    assert start.direction is Direction.LEFT_UP


def test_a_move_ends_by_itself(flat: Flat) -> None:
    flat.order("Move", "Left 3 0.5")
    flat.until(flat.ended)
    assert flat.states() == LIFE
    assert flat.motors.running is None
    assert 4 < abs(flat.reading.pan - 90) < 12


def test_the_same_move_again_prolongs_it(flat: Flat) -> None:
    flat.order("Move", "Left 3 1", order_id="a")
    flat.until(flat.started)
    flat.run(0.6)
    flat.order("Move", "Left 3 1", order_id="b")
    flat.until(lambda: flat.ended("a") and flat.ended("b"))
    assert (flat.states("a"), flat.states("b")) == (LIFE, LIFE)
    assert sum(isinstance(request, Start) for request in flat.motors.sent) == 1
    assert abs(flat.reading.pan - 90) > 8.5


def test_the_same_move_while_it_is_being_stopped_begins_again(flat: Flat) -> None:
    flat.order("Move", "Left 3 0.5", order_id="a")
    flat.until(flat.started)
    flat.until(lambda: flat.motors.running is None)
    between = flat.reading.pan
    assert not flat.ended("a")
    flat.order("Move", "Left 3 0.5", order_id="b")
    flat.until(lambda: flat.ended("a") and flat.ended("b"))
    assert (flat.states("a"), flat.states("b")) == (LIFE, LIFE)
    assert sum(isinstance(request, Start) for request in flat.motors.sent) == 2
    assert abs(flat.reading.pan - between) > 3
    assert flat.motors.running is None


def test_an_order_that_waits_for_a_stop_for_too_long_is_refused(flat: Flat) -> None:
    flat.order("Goto", "Door", order_id="a")
    flat.until(lambda: flat.motors.running is not None)
    flat.camera.away = Away("timeout")
    flat.order("Goto", "Kitchen", order_id="b")
    flat.until(lambda: flat.ended("b"))
    assert flat.states("b") == ["accepted", "refused"]
    assert "has not confirmed the stop" in flat.last("b")["error"]
    flat.camera.away = None
    flat.motors.sent.clear()
    flat.run(20)
    assert not flat.started()
    assert flat.motors.running is None


def test_stop_ends_a_move_within_a_request(flat: Flat) -> None:
    flat.order("Goto", "Door", order_id="a")
    flat.run(3)
    assert flat.motors.running is not None
    flat.order("Move", "Stop", order_id="b")
    before = flat.now
    flat.until(lambda: flat.motors.running is None)
    assert flat.now - before < 1.0
    flat.until(lambda: flat.ended("b"))
    assert flat.states("a")[-1] == "cancelled"
    assert flat.states("b") == LIFE


@pytest.mark.parametrize(
    ("first", "second", "winner"),
    [
        ("human", "human", "b"),
        ("mission", "human", "b"),
        ("mission", "mission", "b"),
        ("human", "mission", "a"),
    ],
)
def test_the_newest_order_of_the_highest_rank_wins_and_the_loser_is_cancelled(
    flat: Flat, first: str, second: str, winner: str
) -> None:
    flat.order("Goto", "Door", order_id="a", by=first)
    flat.run(2)
    flat.order("Goto", "Kitchen", order_id="b", by=second)
    flat.until(lambda: flat.ended("a") and flat.ended("b"))
    loser = "a" if winner == "b" else "b"
    assert flat.states(winner) == LIFE
    assert flat.states(loser)[-1] == "cancelled"
    assert "goes first" in flat.last(loser)["error"]


def test_everybody_wins_over_a_scan(flat: Flat) -> None:
    flat.order("Scan", "ON", order_id="a")
    flat.run(2)
    flat.order("Goto", "Kitchen", order_id="b", by="mission")
    flat.until(lambda: flat.ended("b"))
    assert flat.states("a")[-1] == "cancelled"
    assert flat.payloads("scan/state")[-1]["state"] == "cancelled"


def test_a_scan_finds_the_marker_and_publishes_its_place(flat: Flat) -> None:
    flat.markers[582] = (345.0, 38.0)
    flat.order("Scan", "ON")
    flat.until(flat.ended)
    assert flat.states() == LIFE
    result = payloads.ScanResult.model_validate(flat.payloads("scan/result")[0])
    assert (result.marker, result.place, result.camera) == (582, "Sofa", "ip1")
    assert result.frames == 4
    assert flat.payloads("marker/582") == flat.payloads("scan/result")
    states = flat.payloads("scan/state")
    assert [states[0]["state"], states[-1]["state"]] == ["idle", "done"]
    assert states[-1]["found"] == [582]
    assert [one["progress"] for one in states] == sorted(one["progress"] for one in states)


def test_a_scan_that_finds_nothing_visits_every_place_in_both_picture_modes_and_is_done(flat: Flat) -> None:
    flat.order("Scan", {"targets": [17], "places": ["Sofa", "Kitchen"]})
    flat.until(flat.ended)
    assert flat.states() == LIFE
    assert flat.payloads("scan/result") == []
    assert flat.payloads("scan/state")[-1]["frames_taken"] == 16
    assert [place for place in dict.fromkeys(one["place"] for one in flat.payloads("scan/state")) if place] == [
        "Sofa",
        "Kitchen",
    ]


def test_a_scan_that_is_switched_off_stops_the_motors_and_ends_cancelled(flat: Flat) -> None:
    flat.order("Scan", "ON", order_id="a")
    flat.until(lambda: flat.motors.running is not None)
    flat.order("Scan", "OFF", order_id="b")
    flat.until(lambda: flat.ended("a") and flat.ended("b"))
    assert flat.motors.running is None
    assert (flat.states("a")[-1], flat.states("b")[-1]) == ("cancelled", "done")
    assert flat.payloads("scan/state")[-1]["state"] == "cancelled"


def test_a_scan_that_waits_for_a_stop_is_called_off_by_its_end(flat: Flat) -> None:
    flat.order("Goto", "Door", order_id="a")
    flat.until(lambda: flat.motors.running is not None)
    flat.order("Scan", "ON", order_id="b")
    assert flat.states("b") == ["accepted"]
    flat.order("Scan", "OFF", order_id="c")
    flat.until(lambda: flat.ended("b") and flat.ended("c"))
    flat.run(10)
    assert (flat.states("b")[-1], flat.states("c")[-1]) == ("cancelled", "done")
    assert {one["state"] for one in flat.payloads("scan/state")} == {"idle"}


def test_what_a_scan_has_found_is_told_although_a_place_was_not_to_be_seen(flat: Flat) -> None:
    flat.markers[582] = (345.0, 38.0)
    flat.order("Scan", {"targets": [582, 17], "places": ["Sofa", "Kitchen"]})
    flat.until(lambda: flat.payloads("scan/state")[-1]["found"] == [582])
    flat.camera.blind = True
    flat.until(flat.ended)
    assert flat.last()["state"] == "failed"
    assert [one["marker"] for one in flat.payloads("scan/result")] == [582]


def test_a_service_that_ends_ends_every_order_and_what_turns(flat: Flat) -> None:
    flat.order("Scan", "ON", order_id="a")
    flat.order("Reboot", "True", order_id="b")
    flat.until(lambda: flat.motors.running is not None)
    flat.said += flat.service.leave(flat.now)
    assert [flat.states(one)[-1] for one in "ab"] == ["cancelled", "cancelled"]
    assert flat.payloads("scan/state")[-1]["state"] == "cancelled"
    flat.until(lambda: flat.motors.running is None, 2.0)


def test_a_reading_a_little_beyond_its_range_is_in_no_orders_way(flat: Flat) -> None:
    flat.motors.axes[1].at = flat.motors.axes[1].low = -10.2
    flat.run(3)
    flat.order("Zoom", "2")
    flat.until(flat.ended)
    assert flat.states() == LIFE


def test_places_are_told_before_the_order_that_changed_them_is_done(flat: Flat) -> None:
    flat.order("SaveAs", "Window")
    flat.until(flat.ended)
    topics = [one.topic for one in flat.said if one.topic.endswith(("/places", "/order_result"))]
    assert topics[-2:] == ["camera/ip1/places", "camera/ip1/order_result"]


def test_targets_are_set_added_and_removed(flat: Flat) -> None:
    flat.order("SetTarget", "582,17")
    flat.order("AddTarget", 100)
    flat.order("RemoveTarget", "17")
    assert flat.service.scanner.targets == (582, 100)


def test_save_as_keeps_where_the_camera_looks_and_remove_forgets_it(flat: Flat, tmp_path: Path) -> None:
    flat.order("SaveAs", "Fenêtre: 2", order_id="a")
    flat.until(lambda: flat.ended("a"))
    assert flat.states("a") == LIFE
    flat.run(2)
    assert flat.payloads("places")[-1]["Fenêtre: 2"] == {"pan": 90.0, "tilt": 20.0, "zoom": 0.0, "preset": 2}
    flat.order("Remove", "Fenêtre: 2", order_id="b")
    flat.until(lambda: flat.ended("b"))
    flat.run(2)
    assert "Fenêtre: 2" not in flat.payloads("places")[-1]


def test_mirror_is_read_back_and_the_next_move_learns_the_new_direction(flat: Flat) -> None:
    flat.order("Goto", "Kitchen", order_id="a")
    flat.until(lambda: flat.ended("a"))
    flat.order("Mirror", "OFF", order_id="b")
    flat.until(lambda: flat.ended("b"))
    assert flat.states("b") == LIFE
    flat.order("Goto", "Sofa", order_id="c")
    flat.until(lambda: flat.ended("c"))
    assert flat.states("c") == LIFE


def test_a_camera_that_goes_away_fails_the_move_and_is_stopped_first_when_it_is_back(flat: Flat) -> None:
    flat.order("Goto", "Door", order_id="a")
    flat.run(3)
    flat.camera.away = Away("no answer from the camera")
    flat.until(lambda: flat.ended("a"))
    assert flat.states("a")[-1] == "failed"
    flat.run(5)
    assert flat.payloads("status")[-1]["state"] == "degraded"
    flat.motors.sent.clear()
    flat.camera.away = None
    flat.until(lambda: bool(flat.motors.sent))
    assert isinstance(flat.motors.sent[0], Stop)
    flat.until(lambda: flat.payloads("status")[-1]["state"] == "online")
    assert flat.motors.running is None


def test_orders_are_refused_while_the_camera_is_away_and_it_is_asked_ever_less_often(flat: Flat) -> None:
    flat.camera.away = Away("no answer from the camera")
    flat.run(120)
    flat.order("Goto", "Kitchen")
    assert flat.states() == ["refused"]
    assert "the camera is offline: no answer" in flat.last()["error"]
    before = flat.service.counters["requests"]
    flat.run(100)
    assert 5 <= flat.service.counters["requests"] - before <= 12


def snapshots(flat: Flat) -> int:
    """How many the camera has been asked for and has not given yet."""
    waiting = [request for request, _ in flat.camera.waiting] + [flying[2] for flying in flat.camera.flying]
    return sum(isinstance(request, Snapshot) for request in waiting)


def test_snapshots_are_not_asked_for_while_the_camera_is_away_nor_when_it_is_back(flat: Flat) -> None:
    flat.camera.away = Away("no answer from the camera")
    flat.run(30)
    for _ in range(60):
        flat.send("camera/ip1/snapshot/get", b"now")
    assert len(flat.dropped) == 60
    assert all("snapshot/get: refused, the camera is offline: no answer" in text for text in flat.dropped)
    assert snapshots(flat) == 0
    flat.camera.away = None
    flat.online()
    assert snapshots(flat) == 0


def test_one_snapshot_at_a_time_is_asked_for(flat: Flat) -> None:
    for _ in range(60):
        flat.send("camera/ip1/snapshot/get", b"now")
    assert snapshots(flat) == 1
    flat.until(lambda: snapshots(flat) == 0)
    flat.send("camera/ip1/snapshot/get", b"now")
    assert snapshots(flat) == 1


def test_an_order_before_the_camera_was_met_waits_for_that(just_started: Flat) -> None:
    just_started.order("Goto", "Sofa", order_id="before")
    just_started.order("Goto", "Kitchen")
    assert just_started.states() == []
    just_started.until(just_started.started)
    assert just_started.service.bulletin.identity.serial
    just_started.until(just_started.ended)
    assert just_started.states() == LIFE
    assert just_started.states("before")[-1] == "cancelled"
    assert abs(just_started.reading.pan - 41.1) <= 0.5


def test_an_order_to_a_camera_that_is_not_there_is_refused_as_soon_as_that_is_known(just_started: Flat) -> None:
    just_started.camera.away = Away("no answer from the camera")
    just_started.order("Goto", "Kitchen")
    just_started.until(just_started.ended, 2.0)
    assert just_started.states() == ["refused"]
    assert "the camera is offline: no answer" in just_started.last()["error"]


def test_an_order_waits_five_seconds_for_the_camera_and_is_then_as_late_as_any_other(just_started: Flat) -> None:
    just_started.motors.latency = 30.0
    just_started.order("SetTarget", "17", order_id="own")
    just_started.order("Goto", "Kitchen")
    assert just_started.states("own") == LIFE
    just_started.until(just_started.ended, 6.5)
    assert just_started.states() == ["refused"]
    assert "s old (limit 5)" in just_started.last()["error"]
    just_started.run(200)
    assert not just_started.started()


def test_a_stop_before_the_camera_was_met_goes_first_and_calls_off_what_waits(just_started: Flat) -> None:
    just_started.order("Goto", "Kitchen")
    just_started.order("Move", "Stop", order_id="stop")
    assert just_started.states() == ["cancelled"]
    just_started.until(lambda: just_started.ended("stop"))
    assert just_started.states("stop") == LIFE
    just_started.run(10)
    assert not just_started.started()


def test_a_wrong_password_is_tried_once_and_then_left_alone(flat: Flat) -> None:
    flat.camera.away = BadLogin("the camera does not accept this user and password")
    flat.run(3)
    assert flat.payloads("status")[-1]["state"] == "bad_login"
    before = flat.service.counters["requests"]
    flat.run(100)
    assert flat.service.counters["requests"] == before


def test_an_idle_camera_is_asked_at_most_twice_a_second(flat: Flat) -> None:
    flat.motors.sent.clear()
    flat.run(60)
    errands = [request for request in flat.motors.sent if not isinstance(request, Status)]
    assert len(errands) <= 8
    assert len(flat.motors.sent) <= 60
    assert len([one for one in flat.said if one.topic == "diagnostics/camera/ip1"]) >= 60


def test_a_camera_that_turns_when_the_service_starts_is_stopped(tmp_path: Path) -> None:
    motors = Motors()
    motors.answer(Start(Direction.LEFT, 2))
    flat = Flat(tmp_path, motors=motors, places=Path()).online()
    assert motors.running is None
    assert any(isinstance(request, Stop) for request in flat.motors.sent)


@pytest.mark.parametrize(
    "message",
    [
        Message("camera/ip1/order/Goto", b"\xff", received=1000.0),
        Message("camera/ip1/order/Goto", b'{"value": 1, "by": "cat"}', received=1000.0),
        Message("camera/ip1/position/set", b"{}", received=1000.0),
        Message("camera/ip1/order/Goto", b"Kitchen", received=1000.0, retain=True),
        Message("camera/ip1/order/Goto", b"Kitchen", received=900.0),
    ],
)
def test_what_is_not_an_order_is_told_to_the_runner(tmp_path: Path, message: Message) -> None:
    flat = Flat(tmp_path, places=Path())
    with pytest.raises(BadMessage):
        list(flat.service.handle(message, 1000.0))


def test_two_who_would_restore_the_picture_do_not_wait_for_each_other(flat: Flat) -> None:
    modes = flat.service.scanner.modes
    modes.noted, modes.changed = Before(("color",) * 3), True
    steps = flat.service.scanner.restored(), flat.service.scanner.restored()
    assert isinstance(next(steps[0]), SetPicture)  # the camera has not answered it yet
    with pytest.raises(StopIteration):
        next(steps[1])
