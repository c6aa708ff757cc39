"""The motion alarm's meaning: 1 for a while after motion, -1 in trouble, masked while the camera itself turns."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from services.bus import Message
from services.camera.alarm.listener import HEARD, Heard
from services.camera.alarm.motion import MotionWatch
from services.camera.device import Away, Event, Refused, Reply, Request
from services.camera.errands import GetMotion, SetPrivacy
from services.camera.plan import Plan, Run, Stage
from services.camera.scan.modes import Before
from services.errors import DeviceError
from tests.camera.flat import Flat

START, STOP, BEAT = Event("VideoMotion", "Start"), Event("VideoMotion", "Stop"), Event("", "Heartbeat")


class Room:
    """A MotionWatch, a camera that answers whether motion is going on (or an error), and a clock that jumps."""

    def __init__(self, *, on: bool = True) -> None:
        self.now = 1000.0
        self.goes_on: bool | DeviceError = False
        self.asked: list[float] = []
        self.said: list[tuple[float, int]] = []
        self.turning = False
        self.waiting: list[tuple[Request, int]] = []
        self.stage = Stage(lambda request, ticket: self.waiting.append((request, ticket)))
        self.watch = MotionWatch(self.begin, ("VideoMotion",), 15.0, on=on)

    def begin(self, plan: Plan[None], now: float) -> None:
        self.stage.begin(plan, now, lambda run, now: None)

    def hear(self, *events: Event, attached: bool = False, lost: str | None = None, silent: bool = False) -> None:
        self.watch.take(Heard(self.now, events, attached, lost, silent))
        self.step()

    def run(self, seconds: float, events: Sequence[Event] = ()) -> None:
        """Time passes in steps of half a second; `events` come every 4 s."""
        for number in range(round(2 * seconds)):
            self.now += 0.5
            if events and number % 8 == 7:
                self.watch.take(Heard(self.now, tuple(events)))
            self.step()

    def step(self) -> None:
        said = self.watch.tick(self.now, turning=self.turning)
        if said is not None and (not self.said or self.said[-1][1] != said.value):
            self.said.append((self.now, said.value))
        while self.waiting:
            request, ticket = self.waiting.pop()
            assert isinstance(request, GetMotion)
            self.asked.append(self.now)
            error = self.goes_on if isinstance(self.goes_on, DeviceError) else None
            self.stage.reply(Reply(request, ticket, self.goes_on if error is None else None, error, 0, self.now),
                             self.now)  # fmt: skip
            self.step()

    @property
    def values(self) -> list[int]:
        return [value for _, value in self.said]

    def attached(self) -> Room:
        self.hear(attached=True)
        self.run(1)
        return self


def test_motion_is_1_until_15_s_after_its_end() -> None:
    room = Room().attached()
    room.hear(START)
    began = room.now
    room.run(3)
    room.hear(STOP)
    room.run(30)
    assert room.said[1:] == [(began, 1), (began + 18.0, 0)]


def test_since_tells_when_the_value_began() -> None:
    room = Room().attached()
    room.hear(START)
    said = room.watch.tick(room.now, turning=False)
    assert said is not None
    assert json.loads(said.model_dump_json()) == {"value": 1, "since": "1970-01-01T00:16:41.000Z", "seen": True}


def test_a_lost_stop_ends_by_asking_the_camera() -> None:
    room = Room().attached()
    room.hear(START)
    room.run(20, [BEAT])
    assert room.values == [0, 1, 0]


def test_somebody_who_stays_keeps_it_at_1() -> None:
    room = Room().attached()
    room.goes_on = True
    room.hear(START)
    room.run(120, [BEAT])
    assert room.values == [0, 1]
    assert len(room.asked) < 12
    room.goes_on = False
    room.run(31)
    assert room.values == [0, 1, 0]


def test_what_the_camera_sees_while_it_turns_is_no_motion_and_for_2_s_after() -> None:
    room = Room().attached()
    room.turning = True
    room.run(1)
    room.hear(START)
    room.turning = False
    room.run(1)
    room.hear(STOP)
    room.hear(START)
    room.run(5)
    assert (room.values, room.watch.masked) == ([0], 2)
    room.hear(START)
    assert room.values == [0, 1]


class Alarm:
    """A camera's service whose alarm is attached."""

    def __init__(self, folder: Path) -> None:
        self.flat = Flat(folder).online()
        self.flat.service.motion.on = True
        assert self.hear(attached=True) == [0]
        self.flat.run(2.0)

    def hear(self, **heard: Any) -> list[int]:
        """What was said so far."""
        self.flat.inbox.append(Message(HEARD, value=Heard(self.flat.now, **heard)))
        self.flat._turn()
        return [one["value"] for one in self.flat.payloads("motion")][1:]  # the first is of an alarm that was off

    def is_masked(self) -> bool:
        """Whether what it sees now is nothing, and is something 3 s later."""
        before, after = self.hear(events=(START,)), self.hear(events=(STOP,))
        self.flat.run(3.0)
        return (before, after, self.hear(events=(START,))) == ([0], [0], [0, 1])


def test_a_picture_that_is_put_back_after_a_scan_is_no_motion(tmp_path: Path) -> None:
    alarm = Alarm(tmp_path)
    flat, modes = alarm.flat, alarm.flat.service.scanner.modes
    modes.noted, modes.changed = Before(("bw",) * 3), True
    flat.service.stage.begin(flat.service.scanner.restored(), flat.now, lambda run, now: None)
    flat._turn()
    flat.until(lambda: flat.camera.picture.mode == "bw")
    assert alarm.is_masked()


@pytest.mark.parametrize(
    ("key", "value"), [("Flip", "False"), ("Mirror", "False"), ("VideoMode", "bw"), ("Privacy", "True")]
)
def test_a_picture_that_an_order_changes_is_no_motion(tmp_path: Path, key: str, value: str) -> None:
    alarm = Alarm(tmp_path)
    alarm.flat.camera.answers[SetPrivacy] = lambda asked: asked.on
    alarm.flat.order(key, value)
    alarm.flat.until(alarm.flat.ended)
    assert alarm.is_masked()


def test_nor_is_it_while_the_order_is_carried_out_and_what_changes_no_picture_masks_nothing(tmp_path: Path) -> None:
    alarm = Alarm(tmp_path)
    alarm.flat.order("VideoMode", "bw", order_id="a")
    assert alarm.hear(events=(START,)) == [0]
    assert alarm.hear(events=(STOP,)) == [0]
    alarm.flat.until(lambda: alarm.flat.ended("a"))
    alarm.flat.run(3.0)
    alarm.flat.order("SetTarget", "7", order_id="b")
    assert alarm.hear(events=(START,)) == [0, 1]


def test_motion_from_before_a_turn_still_counts() -> None:
    room = Room().attached()
    room.hear(START)
    room.turning = True
    room.run(5)
    assert room.values == [0, 1]


def test_after_a_reconnect_the_camera_is_asked_whether_motion_is_going_on() -> None:
    room = Room().attached()
    room.hear(lost="the connection broke")
    room.goes_on = True
    room.run(1)
    room.hear(attached=True)
    assert room.values == [0, 1]


def test_a_reconnect_while_the_camera_turns_is_asked_about_when_the_picture_has_settled() -> None:
    room = Room().attached()
    asked = list(room.asked)
    room.goes_on, room.turning = True, True
    room.run(1)
    room.hear(lost="the connection broke")
    room.hear(attached=True)
    room.run(5)
    assert room.asked == asked
    room.turning = False
    stood = room.now
    room.goes_on = False
    room.run(5)
    assert room.asked == [*asked, stood + 2.0]
    assert room.values == [0]


def test_a_stop_that_was_lost_is_asked_about_when_the_camera_stands() -> None:
    room = Room().attached()
    room.hear(START)
    room.turning = True
    asked = list(room.asked)
    room.run(20, [BEAT])
    assert (room.asked, room.values) == (asked, [0, 1])
    room.turning = False
    room.run(3, [BEAT])
    assert (len(room.asked), room.values) == (len(asked) + 1, [0, 1, 0])


def test_a_service_that_starts_in_the_middle_of_a_turn_says_at_once_what_it_takes_for_true() -> None:
    room = Room()
    room.turning = True
    room.run(1)
    room.goes_on = True  # the turn itself, in all likelihood
    room.hear(attached=True)
    assert (len(room.asked), room.values) == (1, [0])
    room.run(20, [BEAT])
    assert (len(room.asked), room.values) == (1, [0])
    room.turning, room.goes_on = False, False
    room.run(12, [BEAT])  # longer than the camera would hold its own turn
    assert (len(room.asked), room.values) == (2, [0])


def test_a_short_break_is_no_trouble_and_a_longer_one_is() -> None:
    room = Room().attached()
    room.hear(lost="the connection broke")
    room.run(2)
    room.hear(attached=True)
    room.hear(lost="the connection broke")
    assert room.values == [0]
    room.run(4)
    assert room.values == [0, -1]
    assert room.watch.fact == "lost: the connection broke"
    room.hear(attached=True)
    assert room.values == [0, -1, 0]


def test_a_stream_that_fell_silent_is_in_trouble_until_it_gives_a_sign_of_life() -> None:
    room = Room().attached()
    room.hear(BEAT)
    room.hear(lost="nothing came", silent=True)
    assert room.values == [0, -1]
    room.hear(attached=True)
    room.run(5)
    assert room.values == [0, -1]
    room.hear(BEAT)
    assert room.values == [0, -1, 0]


def test_firmware_without_heartbeat_is_asked_instead() -> None:
    room = Room().attached()
    room.hear(lost="nothing came", silent=True)
    room.goes_on = True
    room.run(6)
    assert room.values == [0, 1]
    room.hear(attached=True)
    room.goes_on = False
    room.run(30)
    assert room.values == [0, 1, 0]
    assert 5 <= len(room.asked) <= 10
    room.goes_on = Away("no answer")
    room.run(6)
    assert room.values[-1] == -1


def test_the_diagnostics_tell_whether_silence_would_prove_anything() -> None:
    room = Room().attached()
    room.hear(START)
    assert room.watch.fact == "attached, no heartbeat yet"
    room.hear(BEAT)
    assert room.watch.fact == "attached"


def test_nothing_is_said_before_anything_is_known_but_not_for_long() -> None:
    room = Room()
    room.run(5)
    assert room.values == []
    room.run(6)
    assert room.values == [-1]


def test_a_camera_that_does_not_tell_its_state_is_believed_by_its_events() -> None:
    room = Room()
    room.goes_on = Refused("Bad Request")
    room.attached()
    room.hear(START)
    room.run(20)
    assert room.values == [0, 1, 0]


def test_an_alarm_that_is_switched_off_says_so_and_asks_nothing() -> None:
    room = Room(on=False)
    room.run(20)
    assert (room.values, room.asked, room.watch.fact, room.watch.trouble) == ([-1], [], "off", False)
    assert room.watch.tick(50.0, turning=False) == room.watch.tick(60.0, turning=False)


def test_a_plan_that_ended_is_forgotten() -> None:
    room = Room().attached()
    assert room.stage._runs == list[Run]()
