"""Who walks in while the camera turns is told after it, the turn itself never: simulated firmware, virtual time."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from services.camera.alarm.listener import Heard
from services.camera.alarm.motion import MotionWatch
from services.camera.brands.dahua import errands
from services.camera.brands.dahua.events import read_event
from services.camera.device import Away, Errand, Refused, Reply, Request
from services.camera.errands import GetMotionHold
from services.camera.plan import Plan, Stage
from services.errors import DeviceError
from services.simulators.camera.device import Device
from services.simulators.camera.messages import read
from services.simulators.camera.motors import Pose
from services.simulators.camera.profiles import Profile
from services.simulators.world import World, load
from tests.camera.bench import SHIPPED

STEP_S = 0.1
TOLD_S = 12.0  # after a turn, with the anti-dither that cameras come with
TABLE = "MotionDetect[0].EventHandler.Dejitter"


@pytest.fixture(scope="module")
def world() -> World:
    return load(SHIPPED / "world.yaml")


class Hall:
    """One camera, what hears its motion, and a clock that jumps. `refuses`: what fails of what is asked.

    Without `answers` the camera takes its time for them.
    """

    def __init__(self, world: World, *, dither_s: int = 5, beats: bool = True) -> None:
        self.now = 1000.0
        self.device = Device(world.cameras["ip1"], Profile(), self.now)
        self.device.tables.write([(TABLE, str(dither_s))])
        self.refuses: Callable[[str], DeviceError | None] = lambda target: None
        self.loses_stops = False
        self.answers = True
        self.targets: list[str] = []
        self.said: list[tuple[float, int]] = []
        self.waiting: list[tuple[Request, int]] = []
        self.stage = Stage(lambda request, ticket: self.waiting.append((request, ticket)))
        self.watch = MotionWatch(self.begin, ("VideoMotion",), 15.0, on=True)
        heard = self.device.events.subscribe(frozenset({"VideoMotion"}))
        assert heard is not None
        self.heard = heard
        self.watch.take(Heard(self.now, attached=True))
        if not beats:
            self.watch.take(Heard(self.now, lost="nothing came", silent=True))
            self.watch.take(Heard(self.now, attached=True))
        self.run(30.0)

    def begin(self, plan: Plan[None], now: float) -> None:
        self.stage.begin(plan, now, lambda run, now: None)

    def turn(self, pan: float, then_s: float = 0.0) -> None:
        """Turns there to its end, which `ended` tells, and stands for a while."""
        self.go(pan)
        while self.turning:
            self.step()
        self.ended = self.now
        self.run(then_s)

    def go(self, pan: float) -> None:
        """Begins to turn there; the service knows, since the order is its own."""
        self.device.ptz.motors.go(Pose(pan, 20.0, 0.0), self.now)
        self._tick()

    def walk(self, seconds: float) -> None:
        """Somebody walks about before the lens from now on, for so long."""
        self.device.detector.stir(self.now + seconds)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.step()

    def step(self) -> None:
        self.now += STEP_S
        self.device.watch(self.now)
        while text := self.heard.next(0.0):
            event = read_event(text.encode(), whole=False)
            assert event is not None
            if event.action == "Start" or not self.loses_stops:
                self.watch.take(Heard(self.now, (event,)))
        self._tick()
        while self.waiting and self.answers:
            request, ticket = self.waiting.pop()
            assert isinstance(request, Errand)
            result, error = self._answer(request)
            self.stage.reply(Reply(request, ticket, result, error, self.now, self.now), self.now)
            self._tick()

    @property
    def turning(self) -> bool:
        """Whether the motors run, or are told to just now."""
        return self.now <= self.device.ptz.motors.rests_at

    def _tick(self) -> None:
        said = self.watch.tick(self.now, turning=self.turning)
        if said is not None and (not self.said or self.said[-1][1] != said.value):
            self.said.append((self.now, said.value))

    def _answer(self, errand: Errand) -> tuple[object, DeviceError | None]:
        dialogue = errands.dialogue(errand)
        try:
            target = next(dialogue)
            while True:
                self.targets.append(target)
                error = self.refuses(target)
                body = self.device.answer(read(target), self.now).body.decode()
                if error is None and body.startswith("Error"):
                    error = Refused(body)
                target = dialogue.throw(error) if error is not None else dialogue.send(body)
        except StopIteration as stop:
            return stop.value, None
        except DeviceError as error:
            return None, error

    @property
    def values(self) -> list[int]:
        return [value for _, value in self.said]


def places(hall: Hall, *, then_s: float) -> None:
    """A scan's way: five places, and a while at each."""
    for pan in (40.0, 120.0, 200.0, 280.0, 340.0):
        hall.turn(pan, then_s)


@pytest.mark.parametrize("then_s", [0.0, 3.0])
def test_somebody_who_walks_in_while_the_camera_turns_and_goes_on_moving_is_told(world: World, then_s: float) -> None:
    hall = Hall(world)
    hall.turn(300.0)
    hall.walk(200.0)
    places(hall, then_s=then_s)
    assert hall.values == [0]
    hall.run(60.0)
    assert hall.values == [0, 1]
    assert hall.said[1][0] - hall.ended < TOLD_S


def test_who_walked_in_is_told_until_15_s_after_the_camera_says_that_it_is_over(world: World) -> None:
    hall = Hall(world)
    hall.turn(120.0)
    hall.walk(40.0)
    hall.run(40.0 + 5.0 + 14.0)
    assert hall.values == [0, 1]
    hall.run(2.0)
    assert hall.values == [0, 1, 0]


@pytest.mark.parametrize("dither_s", [5, 10, 60, 600])
@pytest.mark.parametrize("then_s", [0.0, 4.0, 9.0, 12.0])
@pytest.mark.parametrize("beats", [True, False], ids=["heartbeat", "mute"])
def test_a_scan_of_an_empty_flat_is_no_motion_however_long_the_camera_holds_it(
    world: World, dither_s: int, then_s: float, beats: bool
) -> None:
    hall = Hall(world, dither_s=dither_s, beats=beats)
    places(hall, then_s=then_s)
    hall.run(dither_s + 60.0)
    assert hall.values == [0]


@pytest.mark.parametrize("dither_s", [10, 60])
def test_with_a_longer_anti_dither_who_walked_in_is_told_as_much_later(world: World, dither_s: int) -> None:
    hall = Hall(world, dither_s=dither_s)
    hall.turn(120.0)
    hall.walk(200.0)
    hall.run(150.0)
    assert hall.values == [0, 1]
    assert dither_s < hall.said[1][0] - hall.ended < dither_s + TOLD_S - 5.0


def test_after_a_turn_of_an_empty_flat_the_camera_is_asked_nothing(world: World) -> None:
    hall = Hall(world)
    before = len(hall.targets)
    places(hall, then_s=3.0)
    hall.run(60.0)
    assert hall.targets[before:] == []


def test_while_it_is_not_clear_the_camera_is_hardly_asked(world: World) -> None:
    hall = Hall(world, dither_s=600)
    before = len(hall.targets)
    hall.turn(120.0, 700.0)
    assert len(hall.targets) - before <= 2


def test_a_camera_that_does_not_tell_how_long_it_holds_motion_is_believed_to_hold_it_longest(world: World) -> None:
    hall = Hall(world, dither_s=60)
    hall.refuses = lambda target: Refused("no right") if "getConfig" in target else None
    hall.turn(120.0, 100.0)
    assert hall.values == [0]
    hall.turn(200.0)
    hall.walk(900.0)
    hall.run(590.0)
    assert hall.values == [0]
    hall.run(30.0)
    assert hall.values == [0, 1]


@pytest.mark.parametrize("which", ["getEventIndexes", "getConfig"])
def test_one_answer_that_is_lost_does_not_hide_who_walked_in(world: World, which: str) -> None:
    hall = Hall(world)
    lost = [Away("no answer")]
    hall.refuses = lambda target: lost.pop() if lost and which in target else None
    hall.turn(120.0)
    hall.walk(100.0)
    hall.run(TOLD_S + 6.0)
    assert lost == []
    assert hall.values == [0, 1]


def test_a_camera_that_does_not_tell_its_state_is_asked_once_after_a_turn(world: World) -> None:
    hall = Hall(world)
    before = len(hall.targets)
    hall.loses_stops = True
    hall.refuses = lambda target: Refused("Bad Request")
    hall.turn(120.0, 60.0)
    assert hall.values == [0]
    assert len(hall.targets) - before == 1


def test_a_stop_that_was_lost_after_a_turn_is_asked_for(world: World) -> None:
    hall = Hall(world)
    hall.loses_stops = True
    hall.turn(120.0, 60.0)
    assert hall.values == [0]
    assert len([target for target in hall.targets if "getEventIndexes" in target]) == 2  # the other when it attached


def test_a_stream_that_comes_back_just_after_a_turn_does_not_tell_the_turn(world: World) -> None:
    hall = Hall(world)
    hall.turn(120.0, 3.0)
    hall.watch.take(Heard(hall.now, lost="the connection broke"))
    hall.watch.take(Heard(hall.now, attached=True))
    hall.run(60.0)
    assert hall.values == [0]


def test_a_stream_that_comes_back_within_a_turn_does_not_hide_who_walked_in(world: World) -> None:
    hall = Hall(world)
    hall.walk(200.0)
    hall.turn(20.0)
    hall.watch = MotionWatch(hall.begin, ("VideoMotion",), 15.0, on=True)
    hall.go(300.0)
    hall.run(0.5)
    hall.watch.take(Heard(hall.now, attached=True))
    hall.said.clear()
    hall.turn(200.0, TOLD_S)
    assert hall.values == [0, 1]


def test_how_long_the_camera_holds_motion_is_in_the_table_of_the_motion_detection() -> None:
    dialogue = errands.dialogue(GetMotionHold("VideoMotion"))
    assert next(dialogue) == "/cgi-bin/configManager.cgi?action=getConfig&name=MotionDetect"
    with pytest.raises(StopIteration) as stop:
        dialogue.send("table.MotionDetect[0].Enable=true\r\ntable.MotionDetect[0].EventHandler.Dejitter=7\r\n")
    assert stop.value.value == 7.0
    for code, body in (("CrossLineDetection", ""), ("VideoMotion", "OK\r\n"), ("VideoMotion", f"table.{TABLE}=x\r\n")):
        dialogue = errands.dialogue(GetMotionHold(code))
        with pytest.raises(Refused):
            next(dialogue), dialogue.send(body)


def test_a_question_that_an_order_overtakes_is_not_followed_by_another_while_the_camera_turns(world: World) -> None:
    hall = Hall(world, beats=False)
    hall.answers = False
    while not hall.waiting:
        hall.step()
    hall.go(300.0)
    hall.run(1.0)
    hall.targets.clear()
    hall.answers = True
    while hall.turning:
        hall.step()
    assert len(hall.targets) == 1
    hall.run(30.0)
    assert len(hall.targets) > 2
    assert hall.values == [0]
