"""The threads that talk to the camera: what overtakes what, and that nothing moves after the end."""

from __future__ import annotations

import itertools
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Sequence

import pytest

from services.bus import Message
from services.camera import lanes
from services.camera.device import (
    Away,
    BadLogin,
    Direction,
    GotoPreset,
    Reading,
    Refused,
    Reply,
    Request,
    Snapshot,
    Start,
    Status,
    Stop,
)
from services.camera.lanes import DRIVE, Lanes, stand_still
from services.errors import DeviceError

WAIT_S = 5.0


class Slow:
    """A camera whose requests wait for leave; it forgets the first `deaf` stops."""

    def __init__(self, *, deaf: int = 0) -> None:
        self.leave = threading.Event()
        self.got: list[Request] = []
        self.entered: queue.Queue[Request] = queue.Queue()
        self.deaf = deaf
        self.moving = False

    def send(self, request: Request) -> object:
        self.entered.put(request)
        assert self.leave.wait(WAIT_S)
        self.got.append(request)
        if isinstance(request, Stop) and self.deaf > 0:
            self.deaf -= 1
            raise Away("no answer")
        self.moving = (self.moving or isinstance(request, Start)) and not isinstance(request, Stop)
        return Reading(10.0, 20.0, 0.0, self.moving) if isinstance(request, Status) else None

    def close(self) -> None:
        pass


def device(*cameras: Slow) -> tuple[Lanes, queue.Queue[Message]]:
    inbox: queue.Queue[Message] = queue.Queue()
    each = iter(cameras)
    return Lanes(lambda: next(each), inbox.put), inbox


def reply(inbox: queue.Queue[Message]) -> Reply:
    value = inbox.get(timeout=WAIT_S).value
    assert isinstance(value, Reply)
    return value


def test_a_stop_overtakes_what_waits_and_starts_that_wait_are_dropped() -> None:
    control, pictures = Slow(), Slow()
    sender, inbox = device(control, pictures)
    sender.submit(Status(), 1)
    assert isinstance(control.entered.get(timeout=WAIT_S), Status)
    sender.submit(Status(), 2)
    sender.submit(Start(Direction.LEFT), 3)
    sender.submit(Stop(), 4)
    dropped = reply(inbox)
    assert (dropped.ticket, type(dropped.error)) == (3, Refused)
    control.leave.set()
    assert [reply(inbox).ticket for _ in range(3)] == [1, 4, 2]
    sender.close()
    assert not any(isinstance(request, Start) for request in control.got)


def test_a_picture_that_takes_long_does_not_delay_a_stop() -> None:
    control, pictures = Slow(), Slow()
    sender, inbox = device(control, pictures)
    control.leave.set()
    sender.submit(Snapshot(), 1)
    assert isinstance(pictures.entered.get(timeout=WAIT_S), Snapshot)
    sender.submit(Stop(), 2)
    assert reply(inbox).ticket == 2
    pictures.leave.set()
    sender.close()


def test_at_the_end_a_motion_is_stopped_until_that_is_confirmed() -> None:
    control, pictures = Slow(deaf=2), Slow()
    sender, inbox = device(control, pictures)
    control.leave.set()
    pictures.leave.set()
    sender.submit(Start(Direction.LEFT), 1)
    assert reply(inbox).error is None
    sender.close()
    assert not control.moving
    assert sum(isinstance(request, Stop) for request in control.got) == 3
    assert not sender.control.thread.is_alive()


def test_a_camera_at_rest_is_sent_nothing_at_the_end() -> None:
    control, pictures = Slow(), Slow()
    sender, _ = device(control, pictures)
    sender.close()
    assert control.got == []


def test_a_camera_that_is_lost_while_it_turns_is_owed_a_stop_until_one_has_arrived() -> None:
    control, pictures, owed = Slow(deaf=1), Slow(), queue.Queue[bool]()
    each = iter((control, pictures))
    inbox: queue.Queue[Message] = queue.Queue()
    sender = Lanes(lambda: next(each), inbox.put, owing=owed.put)
    control.leave.set()
    sender.submit(Start(Direction.LEFT), 1)
    assert reply(inbox).error is None
    assert owed.empty()
    sender.submit(Stop(), 2)
    assert isinstance(reply(inbox).error, Away)
    assert owed.get(timeout=WAIT_S) is True
    sender.submit(Stop(), 3)
    assert reply(inbox).error is None
    assert owed.get(timeout=WAIT_S) is False
    sender.close()


def test_who_waits_for_a_camera_that_is_lost_while_it_turns_learns_it_and_the_stop_goes_first() -> None:
    control, pictures = Slow(deaf=1), Slow()
    sender, inbox = device(control, pictures)
    control.leave.set()
    sender.submit(Start(Direction.LEFT), 1)
    assert reply(inbox).error is None
    control.leave.clear()
    sender.submit(Stop(), 2)  # its answer is lost; whoever asked for the next two has not heard of that
    while not isinstance(control.entered.get(timeout=WAIT_S), Stop):
        pass
    sender.submit(Status(), 3)
    sender.submit(Status(), 4)
    control.leave.set()
    told = [reply(inbox) for _ in range(3)]
    assert {one.ticket: type(one.error) for one in told} == {2: Away, 3: Away, 4: Away}
    sender.submit(Stop(), 5)
    assert reply(inbox).ticket == 5
    sender.close()
    assert [type(request) for request in control.got] == [Start, Stop, Stop]


def test_what_the_firmware_drives_by_itself_is_ended_by_a_start_that_can_be_stopped() -> None:
    camera = Slow()
    camera.leave.set()
    assert stand_still(camera, lambda: 0.0, 1.0, direction=DRIVE)
    assert camera.got[:2] == [Start(Direction.LEFT), Stop(direction=Direction.LEFT)]


def test_that_start_is_not_made_again_where_the_stop_has_to_be() -> None:
    camera = Slow(deaf=2)
    camera.leave.set()
    assert stand_still(camera, lambda: 0.0, 1.0, direction=DRIVE)
    assert [type(one) for one in camera.got if not isinstance(one, Status)] == [Start, Stop, Stop, Stop]


def test_the_watchdog_hears_of_a_drive_and_of_its_end() -> None:
    told: list[object] = []
    control, pictures = Slow(), Slow()
    inbox: queue.Queue[Message] = queue.Queue()
    each, at = iter((control, pictures)), itertools.count()
    sender = Lanes(lambda: next(each), inbox.put, lambda: float(next(at)), turning=told.append)
    control.leave.set()
    for ticket, request in enumerate((GotoPreset(3), Status(), Status(), Status())):
        sender.submit(request, ticket)
        reply(inbox)
    assert told == [DRIVE, None]
    sender.close()
    assert not any(isinstance(request, Stop) for request in control.got)


def test_while_a_lost_camera_is_owed_a_stop_the_pause_between_two_tries_is_nobody_elses() -> None:
    control, pictures = Slow(deaf=1), Slow()
    sender, inbox = device(control, pictures)
    control.leave.set()
    pictures.leave.set()
    sender.submit(Start(Direction.LEFT), 1)
    assert reply(inbox).error is None
    sender.submit(Stop(), 2)
    assert isinstance(reply(inbox).error, Away)
    assert [type(control.entered.get(timeout=WAIT_S)) for _ in range(2)] == [Start, Stop]
    sender.submit(Status(), 3)
    with pytest.raises(queue.Empty):
        control.entered.get(timeout=0.3)
    sender.submit(Stop(), 4)
    assert [reply(inbox).ticket for _ in range(2)] == [4, 3]
    sender.close()


RESTS, STUCK = Reading(10.0, 20.0, 0.0, False), Reading(10.0, 20.0, 0.0, True)  # as some firmware tells for ever
LOST, NO, NOBODY = Away("no answer"), Refused("nothing runs"), BadLogin("who are you")
Said = Sequence[tuple[Request, Reading | DeviceError | None]]


class Scripted:
    """A camera that answers as it is told, by a clock that goes `gap` seconds with each; it rests in the end."""

    def __init__(self, answers: Sequence[Reading | DeviceError | None], gap: float) -> None:
        self.answers, self.gap, self.now = list(answers), gap, 0.0
        self.got: list[Request] = []

    def send(self, request: Request) -> object:
        self.got.append(request)
        self.now += self.gap
        answer = self.answers.pop(0) if self.answers else RESTS if isinstance(request, Status) else None
        if isinstance(answer, DeviceError):
            raise answer
        return answer

    def close(self) -> None:
        pass


def looks(*answers: Reading | DeviceError) -> Said:
    return [(Status(), answer) for answer in answers]


def creeping(moving: bool | None, speed: float, gap: float) -> Said:
    return looks(*(Reading(10.0 + number * speed * gap, 20.0, 0.0, moving) for number in range(9)))


GOES, TURNS = (GotoPreset(3), None), (Start(Direction.LEFT), None)


@pytest.mark.parametrize(
    ("gap", "said", "ended"),
    [
        pytest.param(0.5, [GOES, *looks(RESTS, RESTS)], True, id="a drive that rests"),
        pytest.param(0.1, [GOES, *looks(RESTS, RESTS, RESTS)], False, id="readings too soon after each other"),
        pytest.param(0.1, [GOES, *creeping(False, 2.0, 0.1)], False, id="a slow drive, looked at often"),
        pytest.param(0.5, [GOES, *looks(*5 * [STUCK])], True, id="moving for ever"),
        pytest.param(0.5, [GOES, *looks(*4 * [STUCK])], False, id="moving for a while"),
        pytest.param(0.1, [GOES, *looks(*9 * [STUCK])], False, id="moving for a while, looked at often"),
        pytest.param(0.5, [GOES, *looks(LOST, *5 * [STUCK])], True, id="lost, then moving for ever"),
        pytest.param(0.5, [TURNS, *looks(*9 * [RESTS])], False, id="a start that nobody has stopped"),
        pytest.param(0.5, [TURNS, (Stop(), LOST), (Stop(), NO), *looks(*5 * [RESTS])], True, id="a stop is refused"),
        pytest.param(0.5, [TURNS, (Stop(), NO), *creeping(False, 2.0, 0.5)], False, id="and it turns on"),
        pytest.param(0.5, [TURNS, (Stop(), NO), TURNS, *looks(*9 * [RESTS])], False, id="and another start follows"),
        pytest.param(0.5, [TURNS, (Stop(), NOBODY), *looks(*9 * [RESTS])], False, id="a login is refused"),
    ],
)
def test_readings_end_what_nobody_stops_once_they_prove_that_it_rests(
    monkeypatch: pytest.MonkeyPatch, gap: float, said: Said, *, ended: bool
) -> None:
    monkeypatch.setattr(lanes, "STOP_ALONE_S", 0.0)  # its clock goes with its answers only
    camera, told, inbox = Scripted([answer for _, answer in said], gap), list[object](), queue.Queue[Message]()
    owed: list[bool] = []
    sender = Lanes(lambda: camera, inbox.put, lambda: camera.now, turning=told.append, owing=owed.append)
    for ticket, (request, _) in enumerate(said):
        sender.submit(request, ticket)
        reply(inbox)
    assert (told[-1] is None) == ended
    assert not (ended and any(owed[-1:])), "and nobody waits for a stop that nobody sends"
    asked = len(camera.got)
    sender.close()
    assert any(isinstance(request, Stop) for request in camera.got[asked:]) != ended


class Refusing(Slow):
    """It says no to every stop, and turns on if it turns."""

    def __init__(self, *, turns: bool) -> None:
        super().__init__()
        self.turns, self.pan = turns, 0.0
        self.leave.set()

    def send(self, request: Request) -> object:
        super().send(request)
        if isinstance(request, Stop):
            raise Refused("nothing runs")
        self.pan += self.turns
        return Reading(self.pan, 20.0, 0.0)


@pytest.mark.parametrize("turns", [False, True])
def test_a_camera_that_refuses_every_stop_stands_where_its_readings_say_so(*, turns: bool) -> None:
    camera, at = Refusing(turns=turns), itertools.count()
    assert stand_still(camera, lambda: float(next(at)), 30.0, direction=Direction.UP) == (not turns)
    stops = [request for request in camera.got if isinstance(request, Stop)]
    assert stops[:2] == [Stop(direction=Direction.UP), Stop(every=True, direction=Direction.UP)]
    assert (len(stops) > 2) == turns


def test_a_clock_that_is_set_forward_does_not_end_the_stopping() -> None:
    camera, inbox = Slow(deaf=2), queue.Queue[Message]()
    camera.leave.set()
    set_forward = lambda: time.time() + 3600 * sum(isinstance(one, Stop) for one in camera.got)  # noqa: E731
    sender = Lanes(lambda: camera, inbox.put, set_forward)
    sender.submit(Start(Direction.LEFT), 1)
    assert reply(inbox).error is None
    sender.close()
    assert not camera.moving


WATCHDOG = """
import time
seen = []
time.time = lambda: 1e9 + 3600 * len(seen)
from services.camera.device import Away, Reading, Stop
from services.camera.watchdog import watch
class Deaf:
    def send(self, request):
        if isinstance(request, Stop):
            seen.append(request)
            if len(seen) < 3:
                raise Away("no answer")
        return Reading(1.0, 2.0, 3.0)
    def close(self):
        print(len(seen))
watch(["LEFT"], Deaf)
"""


def test_nor_does_it_end_the_watchdogs() -> None:
    done = subprocess.run([sys.executable, "-c", WATCHDOG], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "3\n"
