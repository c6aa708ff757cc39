"""The threads that talk to the camera: what overtakes what, and that nothing moves after the end."""

from __future__ import annotations

import queue
import threading

import pytest

from services.bus import Message
from services.camera.device import (
    Away,
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
    each = iter((control, pictures))
    sender = Lanes(lambda: next(each), inbox.put, turning=told.append)
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
