"""Missions with everything simulated, in virtual time: what may go wrong, and how each ends."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from services.mission.service import Missions
from services.payloads.robot import MissionResult
from services.simulators.robot.service import SimulatedRobot
from services.topics import MISSION_RESULT, MISSION_STATE, read
from services.virtual import VirtualApartment
from tests.trials import virtual_flat

TARGET = 582


class Story:
    """A flat, and one mission in it after the other."""

    def __init__(self, flat: VirtualApartment) -> None:
        self.flat = flat
        self.results: list[MissionResult] = []
        self.states: list[str] = []

    @property
    def robot(self) -> SimulatedRobot:
        return self._service(SimulatedRobot)

    @property
    def missions(self) -> Missions:
        return self._service(Missions)

    def _service(self, kind: type) -> Any:
        return next(one.service for one in self.flat.runners if isinstance(one.service, kind))

    def find(self, marker: int = TARGET, order_id: str = "m") -> None:
        self.flat.client.say("mission/tiago/order", json.dumps({"find": marker, "id": order_id}))

    def until(self, condition: Callable[[], bool], seconds: float = 900.0) -> bool:
        def looked() -> bool:
            for message in self.flat.client.pump():
                if message.topic == MISSION_RESULT.name(robot="tiago"):
                    self.results.append(read(message, self.flat.now).payload)
                elif message.topic == MISSION_STATE.name(robot="tiago"):
                    self.states.append(read(message, self.flat.now).payload.state)
            return condition()

        return self.flat.until(looked, seconds)

    def end(self, count: int = 1) -> MissionResult:
        assert self.until(lambda: len(self.results) >= count), self.states
        return self.results[count - 1]

    def is_(self, state: str) -> bool:
        return bool(self.states) and self.states[-1] == state

    def still(self) -> None:
        """Nothing moves any more, neither now nor later."""
        self.until(lambda: False, 2.0)
        assert not self.robot.body.moving
        was = (self.robot.body.x, self.robot.body.y, self.robot.body.yaw_deg)
        self.until(lambda: False, 5.0)
        assert was == (self.robot.body.x, self.robot.body.y, self.robot.body.yaw_deg)


@pytest.fixture
def story(tmp_path: Path) -> Iterator[Story]:
    def one_frame_a_place(config: Path) -> None:
        config.write_text(config.read_text().replace("targets: [582]", "targets: [582]\n    frames: 1"))

    with virtual_flat(tmp_path, one_frame_a_place) as flat:
        yield Story(flat)


def move(story: Story, *, marker: int, to: tuple[float, float, float]) -> None:
    """Somebody carries a marker away: the robot sees the world as it is then. The camera's picture stays."""
    world = story.robot.world
    moved = tuple(one.model_copy(update={"position": to}) if one.id == marker else one for one in world.markers)
    story.robot.world = world.model_copy(update={"markers": moved})


def test_the_house_sees_it_and_the_robot_confirms_it(story: Story) -> None:
    story.find()
    result = story.end()
    assert (result.state, result.place, result.by) == ("found", "Living room", "tiago")
    assert [step.state for step in result.story if step.state == "scan"] == ["scan"]
    assert result.position is not None
    truth = story.robot.world.marker(TARGET).position
    assert abs(result.position.x - truth[0]) + abs(result.position.y - truth[1]) < 0.2
    story.still()


def test_a_second_mission_believes_the_sighting_and_needs_no_scan(story: Story) -> None:
    story.find()
    story.end()
    story.find(order_id="again")
    result = story.end(2)
    assert result.state == "found"
    assert "scan" not in [step.state for step in result.story]


def test_a_marker_that_is_nowhere(story: Story) -> None:
    story.find(999)
    result = story.end()
    assert (result.state, result.reason) == ("not_found", "marker 999 was seen nowhere")
    story.still()


def test_a_marker_that_is_carried_away_during_the_drive(story: Story) -> None:
    story.find()
    story.until(lambda: story.is_("scan"))
    story.until(lambda: story.is_("go"))
    move(story, marker=TARGET, to=(7.0, 1.5, 0.9))  # into the bathroom, where no camera looks
    result = story.end()
    assert result.state in ("not_found", "found")
    assert [step.state for step in result.story].count("scan") >= 2
    story.still()


def test_navigation_that_fails_once_is_tried_again(story: Story) -> None:
    story.robot.fails = 1
    story.find()
    assert story.end().state == "found"


def test_navigation_that_fails_for_ever_ends_with_the_reason(story: Story) -> None:
    story.robot.fails = 10_000
    story.find()
    result = story.end()
    assert result.state == "failed"
    assert result.reason == "ip1 saw it at Living room, and the robot did not get there: something stands in the way"


def test_without_the_camera_the_robot_goes_round_itself(story: Story) -> None:
    story.missions.desks["tiago"].cameras.clear()
    story.find()
    result = story.end()
    assert result.state == "found"
    assert "scan" not in [step.state for step in result.story]


@pytest.mark.parametrize("state", ["look", "go", "scan"])
def test_a_cancel_ends_it_in_every_step(story: Story, state: str) -> None:
    story.find()
    assert story.until(lambda: story.is_(state))
    story.flat.client.say("mission/tiago/order", '{"cancel": true}')
    assert (story.end().state, story.end().reason) == ("cancelled", "cancelled by order")
    story.still()
    assert story.is_("idle")


def test_two_orders_at_once_come_one_after_the_other(story: Story) -> None:
    story.find(order_id="one")
    story.find(order_id="two")
    story.find(order_id="two")  # the same again
    assert (story.end().id, story.end(2).id) == ("one", "two")
    assert not story.until(lambda: len(story.results) > 2, 60.0)


def test_an_order_that_waits_can_be_taken_back(story: Story) -> None:
    story.find(order_id="one")
    story.find(order_id="two")
    story.flat.client.say("mission/tiago/order", '{"cancel": true, "id": "two"}')
    assert (story.end().id, story.end().state) == ("two", "cancelled")
    assert (story.end(2).id, story.end(2).state) == ("one", "found")


@pytest.mark.parametrize("state", ["look", "go", "scan"])
def test_a_service_that_begins_anew_goes_on_where_it_was(story: Story, state: str) -> None:
    story.find()
    assert story.until(lambda: story.is_(state))
    story.flat.restart("mission")
    assert story.end().state == "found"


def test_where_a_marker_was_seen_is_answered_at_once(story: Story) -> None:
    story.find()
    story.end()
    story.flat.client.say("mission/tiago/where", json.dumps({"marker": TARGET, "id": "q"}))
    said: list[Any] = []

    def answered() -> bool:
        said.extend(m for m in story.flat.client.pump() if m.topic == "mission/tiago/where/reply/q")
        return bool(said)

    assert story.flat.until(answered, 2.0)
    sightings = read(said[0], story.flat.now).payload.sightings
    assert [one.by for one in sightings] == ["tiago", "ip1"]
    assert sightings[1].sigma_m < 0.05
    assert sightings[1].age_s < 60


def test_a_robot_that_is_not_configured_is_refused(story: Story) -> None:
    story.flat.client.say("mission/nobody/order", '{"find": 582}')
    story.until(lambda: False, 1.0)
    runner = next(one for one in story.flat.runners if isinstance(one.service, Missions))
    assert runner.counters["bad"] == 1
