"""How long requests take, and how old what a status tells is."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from services.simulators.camera.device import Device
from services.simulators.camera.latency import Latency
from services.simulators.camera.messages import read
from services.simulators.camera.motors import Pose
from services.simulators.camera.profiles import Profile
from services.simulators.world import World

STATUS = read("/cgi-bin/ptz.cgi?action=getStatus")
RIGHT_AT_SPEED_4 = read("/cgi-bin/ptz.cgi?action=start&channel=1&code=Right&arg1=0&arg2=4&arg3=0")
STOP = read("/cgi-bin/ptz.cgi?action=stop&channel=1&code=Right&arg1=0&arg2=0&arg3=0")


def _drawn(seconds: float | None = None, **switches: float) -> list[float]:
    latency = Latency(replace(Profile(), **switches), seconds, Random(3))  # type: ignore[arg-type]
    return sorted(latency.control(0.0) for _ in range(5000))


def test_most_requests_take_a_third_of_a_second_and_a_few_two_or_three_times_as_long() -> None:
    drawn = _drawn()
    assert drawn[0] >= 0.2
    assert drawn[len(drawn) // 2] == pytest.approx(0.3, abs=0.01)
    assert drawn[int(0.97 * len(drawn))] <= 0.4
    slow = [seconds for seconds in drawn if seconds > 0.4]
    assert 0.015 < len(slow) / len(drawn) < 0.025
    assert 0.9 < slow[-1] <= 1.2


def test_the_tail_can_be_set() -> None:
    assert max(_drawn(latency_tail=0.0)) <= 0.4
    assert min(_drawn(latency_tail=1.0)) >= 0.4


def test_nothing_takes_time_where_the_latency_is_nought() -> None:
    assert max(_drawn(0.0)) == 0.0
    latency = Latency(replace(Profile(), status_lag_s=0.5), 0.0, Random(1))
    assert (latency.lag_s, latency.snapshot()) == (0.0, 0.0)


@pytest.mark.parametrize(("switch", "lag_s"), [(None, 0.3), (0.8, 0.8), (0.0, 0.0)])
def test_a_status_is_as_old_as_its_lag(world: World, switch: float | None, lag_s: float) -> None:
    device = Device(world.cameras["ip1"], replace(Profile(), status_lag_s=switch), 0.0)
    device.place(Pose(0.0, 20.0, 0.0), 0.0)
    device.answer(RIGHT_AT_SPEED_4, 10.0)
    device.answer(STOP, 15.0)  # 50 degrees at 10 degrees/s; 10/120 s to full speed
    moving = device.answer(STATUS, 13.0).body.decode()
    assert f"Postion[0]={round(10.0 * (3.0 - lag_s - 5.0 / 120.0), 1):.6f}" in moving
    just_stopped = device.answer(STATUS, 15.09).body.decode()
    assert ("MoveStatus=Moving" in just_stopped) is (lag_s > 0.0)
    at_rest = device.answer(STATUS, 15.1 + lag_s).body.decode()
    assert "MoveStatus=Idle" in at_rest
    assert "Postion[0]=50.000000" in at_rest
