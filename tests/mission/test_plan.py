"""The mission's state machine, event by event."""

from __future__ import annotations

from dataclasses import replace

import pytest

from services.mission.events import (
    Action,
    Arrived,
    Begin,
    Cancel,
    Event,
    Go,
    Halt,
    Late,
    NotReached,
    Resumed,
    Scan,
    ScanEnded,
    Seen,
    Sighted,
    StopScan,
)  # fmt: skip
from services.mission.plan import advance
from services.mission.state import ENDS, Around, Lead, Mission, Rules, Stand

SPOT = Lead("here", (Stand(away=False), Stand(yaw_deg=90.0)), "where it stands")
SOFA = Lead("ip1", (Stand(1, 1), Stand(2, 2)), "Sofa", (1.0, 2.0, 0.5), stamp=100.0)
TABLE = Lead("ip1", (Stand(5, 5),), "Table", (5.0, 5.0, 0.5), stamp=200.0)
DOOR = Lead("round", (Stand(point="Door"),), "Door")
HOUSE = Around(Rules(sure=2, blank=3), ("ip1",), SPOT)
ALONE = Around(Rules(sure=2, blank=3), (), SPOT)
UNSEEN = [Seen(False)] * 3


def play(
    around: Around, *events: Event, mission: Mission | None = None, now: float = 0.0
) -> tuple[Mission, list[Action]]:
    """Hands one event after the other to a mission, a second apart; all that it wanted done."""
    mission, done = mission or Mission("m", 582, 0.0), []
    for count, event in enumerate(events):
        mission, wanted = advance(mission, event, now + count, around)
        done += wanted
    return mission, done


def test_it_looks_first_from_where_it_stands_and_is_done_when_it_sees_the_marker() -> None:
    mission, done = play(HOUSE, Begin(), Seen(True, (1.0, 2.0, 3.0)), Seen(True))
    assert (mission.step, mission.position, done) == ("found", (1.0, 2.0, 3.0), [])


def test_one_view_is_not_enough() -> None:
    mission, _ = play(HOUSE, Begin(), Seen(True), Late())
    assert mission.step == "go"


def test_the_house_is_asked_when_it_has_turned_round_in_vain() -> None:
    mission, done = play(HOUSE, Begin(), *UNSEEN, Arrived(1), *UNSEEN)
    assert mission.step == "scan"
    assert done == [Go(1, SPOT.stands[1]), Scan("ip1", 1)]


def after_a_scan(*events: Event, lead: Lead = SOFA) -> tuple[Mission, list[Action]]:
    asked, _ = play(HOUSE, Begin(), *UNSEEN, Arrived(1), *UNSEEN)
    return play(HOUSE, Sighted(lead), ScanEnded("ip1", 1), *events, mission=asked, now=50.0)


def test_it_drives_to_where_the_house_saw_it_and_confirms_it() -> None:
    mission, done = after_a_scan(Arrived(2), Seen(True), Seen(True))
    assert (mission.step, mission.place) == ("found", "Sofa")
    assert done == [Go(2, SOFA.stands[0])]


def test_a_recent_sighting_saves_the_scan() -> None:
    mission, done = play(replace(HOUSE, known=lambda: (SOFA,)), Begin(), *UNSEEN, Arrived(1), *UNSEEN)
    assert (mission.step, mission.place, done[-1]) == ("go", "Sofa", Go(2, SOFA.stands[0]))


def test_a_stand_that_cannot_be_reached_is_tried_again_and_then_left_for_the_next() -> None:
    mission, done = after_a_scan(NotReached(2, "blocked"), NotReached(3, "blocked"), Arrived(4), Seen(True), Seen(True))
    assert [one.stand for one in done if isinstance(one, Go)] == [SOFA.stands[0], SOFA.stands[0], SOFA.stands[1]]
    assert mission.step == "found"


def test_a_marker_that_is_not_where_the_house_saw_it_is_looked_for_by_one_more_scan() -> None:
    mission, done = after_a_scan(Arrived(2), *UNSEEN, Arrived(3), *UNSEEN)
    assert (mission.step, done[-1]) == ("scan", Scan("ip1", 2))
    mission, done = play(HOUSE, ScanEnded("ip1", 2), mission=mission, now=100.0)
    assert (mission.step, mission.reason) == ("not_found", "marker 582 was seen nowhere")


def test_a_place_that_the_robot_cannot_get_to_fails_with_the_reason() -> None:
    events = [NotReached(goal, "the door is shut") for goal in range(2, 6)]
    mission, _ = after_a_scan(*events)
    assert mission.step == "failed"
    assert mission.reason == "ip1 saw it at Sofa, and the robot did not get there: the door is shut"


def test_it_turns_round_when_a_camera_sees_the_marker_elsewhere() -> None:
    mission, done = after_a_scan(Sighted(TABLE))
    assert (mission.step, mission.place) == ("go", "Table")
    assert done[-2:] == [Halt(2), Go(3, TABLE.stands[0])]


@pytest.mark.parametrize(
    "same", [replace(SOFA, stamp=300.0, position=(1.1, 2.0, 0.5)), replace(SOFA, stamp=50.0, position=(9.0, 9.0, 0.0))]
)
def test_the_same_place_or_old_news_change_nothing(same: Lead) -> None:
    mission, done = after_a_scan(Sighted(same))
    assert (mission.goal, done[-1]) == (2, Go(2, SOFA.stands[0]))


def test_it_stops_when_it_sees_it_on_the_way_and_goes_on_when_that_was_an_error() -> None:
    mission, done = after_a_scan(Seen(True), *UNSEEN)
    assert (mission.step, mission.goal) == ("go", 3)
    assert done == [Go(2, SOFA.stands[0]), Halt(2), Go(3, SOFA.stands[0])]
    for _ in range(3):
        mission, done = play(HOUSE, Seen(True), *UNSEEN, mission=mission, now=60.0)
    assert (mission.step, done) == ("go", [])


def test_a_drive_that_takes_too_long_is_stopped() -> None:
    mission, done = after_a_scan(Late())
    assert done[-2:] == [Halt(2), Go(3, SOFA.stands[0])]
    assert mission.obstacle == "not there after 120 s"


def test_a_scan_that_a_human_stops_is_told_and_the_robot_goes_round_itself() -> None:
    around = replace(HOUSE, round=lambda: (DOOR,))
    asked, _ = play(around, Begin(), *UNSEEN, Arrived(1), *UNSEEN)
    mission, done = play(around, ScanEnded("ip1", 1, "cancelled by a human"), mission=asked, now=50.0)
    assert (mission.step, done) == ("go", [Go(2, DOOR.stands[0])])
    assert "ip1: cancelled by a human" in [one.text for one in mission.story]


def test_a_scan_without_an_end_is_stopped() -> None:
    asked, _ = play(HOUSE, Begin(), *UNSEEN, Arrived(1), *UNSEEN)
    mission, done = play(HOUSE, Late(), mission=asked, now=500.0)
    assert (mission.step, done) == ("not_found", [StopScan("ip1", 1)])


def test_without_a_camera_that_can_be_used_it_says_so() -> None:
    mission, done = play(ALONE, Begin(), *UNSEEN, Arrived(1), *UNSEEN)
    assert mission.step == "not_found"
    assert mission.reason == "marker 582 was seen nowhere; no camera of the house can be used"
    assert done == [Go(1, SPOT.stands[1])]


def test_a_robot_whose_camera_says_nothing_has_not_looked() -> None:
    mission, _ = play(ALONE, Begin(), Late(), Arrived(1), Late())
    assert (mission.step, mission.reason) == ("failed", "the robot's camera says nothing")


@pytest.mark.parametrize(
    ("events", "wanted"),
    [
        ((), []),
        ((Begin(),), []),
        ((Begin(), *UNSEEN), [Halt(1)]),
        ((Begin(), *UNSEEN, Arrived(1), *UNSEEN), [StopScan("ip1", 1)]),
    ],
)
def test_a_cancel_ends_it_in_every_step_and_leaves_nothing_moving(
    events: tuple[Event, ...], wanted: list[Action]
) -> None:
    before, _ = play(HOUSE, *events)
    mission, done = play(HOUSE, Cancel(), mission=before, now=70.0)
    assert (mission.step, done) == ("cancelled", wanted)
    assert play(HOUSE, Seen(True), Seen(True), Arrived(1), mission=mission, now=80.0) == (mission, [])


@pytest.mark.parametrize(
    ("events", "wanted"),
    [
        ((Begin(), *UNSEEN), [Go(2, SPOT.stands[1])]),
        ((Begin(), *UNSEEN, Arrived(1), *UNSEEN), [StopScan("ip1", 1), Scan("ip1", 1)]),
        ((Begin(),), []),
    ],
)
def test_after_a_restart_the_step_is_made_once_more(events: tuple[Event, ...], wanted: list[Action]) -> None:
    before, _ = play(HOUSE, *events)
    mission, done = play(HOUSE, Resumed(), mission=before, now=70.0)
    assert (mission.step, done) == (before.step, wanted)
    assert mission.since == 70.0


def test_answers_to_older_goals_and_scans_change_nothing() -> None:
    mission, _ = after_a_scan()
    assert play(HOUSE, Arrived(1), NotReached(1, "late"), ScanEnded("ip1", 1), mission=mission, now=60.0) == (
        mission,
        [],
    )


@pytest.mark.parametrize("step", ENDS)
def test_what_has_ended_stays_ended(step: str) -> None:
    over = replace(Mission("m", 582, 0.0), step=step)  # type: ignore[arg-type]
    for event in (Begin(), Seen(True), Sighted(SOFA), Arrived(0), ScanEnded("ip1", 0), Late(), Cancel(), Resumed()):
        assert advance(over, event, 1.0, HOUSE) == (over, [])
