"""Motions by hand, where the firmware has timed moves and where it has none."""

from __future__ import annotations

from pathlib import Path

from services.camera.device import Start, TurnFor
from tests.camera.flat import Flat
from tests.camera.motors import Motors


def test_a_motion_by_hand_is_a_timed_move_where_the_firmware_has_them(tmp_path: Path) -> None:
    flat = Flat(tmp_path, motors=Motors(timed=True)).online()
    flat.order("Move", "Left 3 1.5")
    flat.until(flat.ended)
    assert flat.last()["state"] == "done"
    (timed,) = (request for request in flat.motors.sent if isinstance(request, TurnFor))
    assert timed.right < 0
    assert 1.5 < timed.seconds <= 3.0
    assert not flat.motors.moving
    assert not flat.started()


def test_without_timed_moves_that_is_found_out_once(tmp_path: Path) -> None:
    flat = Flat(tmp_path, motors=Motors()).online()
    for number in range(2):
        flat.order("Move", "Left 3 0.5", order_id=str(number))
        flat.until(lambda number=number: flat.ended(str(number)))  # type: ignore[misc]
    assert sum(isinstance(request, TurnFor) for request in flat.motors.sent) == 1
    assert sum(isinstance(request, Start) for request in flat.motors.sent) == 2


def test_a_timed_move_is_prolonged_by_another(tmp_path: Path) -> None:
    flat = Flat(tmp_path, motors=Motors(timed=True)).online()
    flat.order("Move", "Left 3 1", order_id="a")
    flat.run(1.2)
    flat.order("Move", "Left 3 1", order_id="b")
    flat.until(lambda: flat.ended("a") and flat.ended("b"))
    assert sum(isinstance(request, TurnFor) for request in flat.motors.sent) == 2
    assert abs(flat.reading.pan - 90) > 8.5
    assert not flat.motors.moving


def test_a_timed_move_ends_by_itself_when_nobody_can_stop_it() -> None:
    motors = Motors(timed=True)
    motors.answer(TurnFor(-20, 0, 0, 2.0))
    motors.pass_time(1.0)
    assert motors.moving
    motors.pass_time(1.5)
    assert not motors.moving
