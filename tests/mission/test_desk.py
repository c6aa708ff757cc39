"""Orders at a robot's desk: which are taken, which wait and for how long, and that each is answered."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from services import topics
from services.bus import Message
from services.errors import BadMessage
from services.mission.desk import UNHEARD_S
from services.mission.service import Missions
from services.mission.settings import Config
from services.payloads.robot import MissionResult, MissionState
from tests.bridge.test_service import CONFIG

T = 1_769_839_200.0
ROBOTS = {"tiago": {"places": "tiago/robot_places.yaml"}}


class Service:
    """The mission service, and what it said."""

    def __init__(self, state: Path | None = None, at: float = T, **config: Any) -> None:
        given = {"robots": ROBOTS, "folder": CONFIG, "cameras": ("ip1",), "state": state, **config}
        self.missions = Missions(Config.model_validate(given))
        self.now = at
        self.results: list[MissionResult] = []
        self.state: MissionState | None = None
        self.bad: list[str] = []

    def says(self, topic: str, payload: Any, **flags: Any) -> None:
        """The bus says it, and the service has its turn."""
        data = payload if isinstance(payload, bytes) else json.dumps(payload).encode()
        try:
            for said in self.missions.handle(Message(topic, data, received=self.now, **flags), self.now):
                self._heard(said)
        except BadMessage as error:
            self.bad.append(str(error))
        self.later(0.0)

    def order(self, payload: Any, robot: str = "tiago", **flags: Any) -> None:
        self.says(f"mission/{robot}/order", payload, **flags)

    def stands(self) -> None:
        """The robot says where it is."""
        self.says("robot/tiago/pose", {"x": 2.0, "y": 2.0, "yaw_deg": 0.0, "stamp": "2026-01-31T07:05:00Z"})

    def later(self, seconds: float) -> None:
        self.now += seconds
        for said in self.missions.tick(self.now):
            self._heard(said)

    def ends(self) -> list[tuple[str, str, str]]:
        """Ids, ends and reasons since the last time."""
        told, self.results = [(one.id, one.state, one.reason) for one in self.results], []
        return told

    def _heard(self, message: Message) -> None:
        payload = topics.read(message._replace(received=self.now), self.now).payload
        if isinstance(payload, MissionResult):
            self.results.append(payload)
        elif isinstance(payload, MissionState):
            self.state = payload


def test_an_order_waits_a_minute_for_a_robot_of_which_nobody_hears() -> None:
    service = Service()
    service.order({"find": 582, "id": "m"})
    service.later(UNHEARD_S - 1)
    assert service.ends() == []
    service.order({"find": 17, "id": "n"})
    service.later(1.0)
    assert service.ends() == [("m", "cancelled", "tiago has not said where it is for 60 s")]
    assert service.state is not None
    assert service.state.waiting == ["n"]
    service.stands()
    assert service.state.id == "n"


def test_orders_that_wait_for_a_mission_have_their_turn_however_long_it_takes() -> None:
    service = Service()
    service.stands()
    for name in ("one", "two", "three"):
        service.order({"find": 582, "id": name})
    service.later(10 * UNHEARD_S)
    service.order({"cancel": True, "id": "one"})
    assert service.state is not None
    assert (service.state.id, service.state.waiting) == ("two", ["three"])


@pytest.mark.parametrize(("seconds", "begins"), [(899.0, True), (86_400.0, False)])
def test_an_order_that_waited_while_the_service_was_off_for_long_is_not_carried_out(
    tmp_path: Path, seconds: float, begins: bool
) -> None:
    before = Service(tmp_path)
    before.order({"find": 582, "id": "m"})
    after = Service(tmp_path, T + seconds)
    after.stands()
    assert after.state is not None
    assert after.state.id == ("m" if begins else None)
    assert after.ends() == ([] if begins else [("m", "cancelled", "nobody was at it for 900 s")])
    again = Service(tmp_path, T + seconds + 1)
    again.stands()
    assert (again.state is not None and again.state.id) == ("m" if begins else None)


def test_what_waited_behind_a_mission_that_was_left_for_long_ends_with_it(tmp_path: Path) -> None:
    before = Service(tmp_path)
    before.stands()
    for name in ("one", "two"):
        before.order({"find": 582, "id": name})
    after = Service(tmp_path, T + 86_400.0)
    after.order({"find": 17, "id": "new"})
    after.stands()
    assert {(name, end) for name, end, _ in after.ends()} == {("one", "cancelled"), ("two", "cancelled")}
    assert after.state is not None
    assert after.state.id == "new"


@pytest.mark.parametrize(
    ("payload", "told", "reason"),
    [
        ({"find": "582", "id": "m"}, ("m", 0), "find: Input should be a valid integer"),
        ({"find": 99999, "id": "m"}, ("m", 0), "find: Input should be less than or equal to 9999"),
        ({"find": 582, "id": 7}, ("7", 582), "id: Input should be a valid string"),
        ({"find": 582, "id": "x" * 65}, ("x" * 64, 582), "id: String should have at most 64 characters"),
        ({"find": 582, "id": "m", "soon": True}, ("m", 582), "soon: Extra inputs are not permitted"),
        ({"id": "m"}, ("m", 0), 'expected either "find" with a marker or "cancel": true'),
        (b"582", ("", 0), "Input should be an object"),
        (b"\xff", ("", 0), "expected UTF-8"),
    ],
    ids=str,
)
def test_an_order_that_makes_no_sense_is_refused_with_its_own_id(
    payload: Any, told: tuple[str, int], reason: str
) -> None:
    service = Service()
    service.order(payload)
    (result,) = service.results
    assert ((result.id, result.marker), result.state) == (told, "refused")
    assert reason in result.reason
    assert service.bad == [result.reason]


@pytest.mark.parametrize(
    ("flags", "robot", "reason"),
    [
        ({"retain": True}, "tiago", "mission/tiago/order: refused, a retained command"),
        ({}, "nobody", "mission/nobody/order: expected one of tiago"),
    ],
)
def test_an_order_that_is_retained_or_for_nobody_is_refused_with_its_own_id(
    flags: Any, robot: str, reason: str
) -> None:
    service = Service()
    service.order({"find": 582, "id": "m"}, robot, **flags)
    assert service.ends() == [("m", "refused", reason)]
    assert service.bad == [reason]


@pytest.mark.parametrize("again", [{"find": 17, "id": "m"}, {"find": "582", "id": "m"}])
def test_an_id_that_is_taken_is_not_answered_for_another_order_and_told_in_the_log(again: Any) -> None:
    service = Service()
    service.order({"find": 582, "id": "m"})
    service.order(again)
    assert service.ends() == []
    (told,) = service.bad
    assert told.startswith("mission/tiago/order: ")
    service.order({"cancel": True})
    assert service.ends() == [("m", "cancelled", "cancelled by order")]


@pytest.mark.parametrize("cancel", [{"cancel": True, "id": "m", "now": 1}, {"cancel": True, "find": 3, "id": "m"}])
def test_a_cancel_that_makes_no_sense_does_not_end_the_mission_that_it_names(cancel: Any) -> None:
    service = Service()
    service.order(cancel)
    service.order({"cancel": True, "id": "m"}, retain=True)
    service.order({"cancel": True, "id": "m"}, "nobody")
    assert service.ends() == []
    assert len(service.bad) == 3
