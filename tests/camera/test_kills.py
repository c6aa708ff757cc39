"""What happens to a motion when somebody dies in the middle of it: real processes, kill -9, a network that is cut."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import pytest

from services import peers
from services.camera.ptz.stand import GRACE_S
from tests.camera import trials
from tests.small_flat import SmallFlat, small_flat

pytestmark = pytest.mark.mosquitto


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SmallFlat]:
    try:
        with small_flat(tmp_path_factory.mktemp("flat"), networked=True, **trials.EVERY_MOTION) as running:
            yield running
    except peers.Missing as missing:
        pytest.skip(str(missing))


def test_the_motor_stands_still_soon_after_the_service_was_killed(flat: SmallFlat) -> None:
    assert trials.kill_service(flat) < trials.STOPPED_S


def test_so_it_does_where_the_watchdog_was_killed_before(flat: SmallFlat) -> None:
    assert trials.kill_watchdog(flat) < trials.STOPPED_S


def test_a_service_that_is_told_to_end_stops_the_motor_and_tells_that_the_order_has_ended(flat: SmallFlat) -> None:
    assert trials.end_service(flat) < trials.STOPPED_S


def test_the_motor_stands_still_soon_after_the_supervisor_was_killed_and_nobody_is_left(flat: SmallFlat) -> None:
    assert trials.kill_supervisor(flat) < trials.STOPPED_S


@pytest.mark.parametrize("kill", [trials.kill_service, trials.kill_supervisor])
def test_so_it_does_on_the_way_to_a_place_be_it_regulated_or_driven_by_the_firmware(
    flat: SmallFlat, kill: Callable[[SmallFlat, Mapping[str, trials.Motion]], float]
) -> None:
    assert kill(flat, trials.GOALS) < trials.STOPPED_S


def test_the_motor_stands_still_soon_after_the_broker_was_killed(flat: SmallFlat) -> None:
    assert trials.kill_broker(flat) < trials.STOPPED_S


def test_after_the_network_was_cut_a_stop_is_the_first_that_reaches_the_camera(flat: SmallFlat) -> None:
    assert trials.cut_network(flat) < trials.REACHED_S


def test_the_same_when_it_was_cut_for_longer(flat: SmallFlat) -> None:
    assert trials.cut_network(flat, seconds=4.0) < trials.REACHED_S


def test_a_move_that_the_firmware_times_ends_by_itself_while_the_network_is_cut(flat: SmallFlat) -> None:
    assert trials.cut_timed_move(flat) < trials.TIMED_S + GRACE_S


@pytest.mark.rtsp
def test_a_stream_that_was_on_does_not_log_in_before_the_stop_although_it_could(flat: SmallFlat) -> None:
    with trials.watched(flat):  # an attempt from before the camera was missed ends within 5 s
        assert trials.cut_network(flat, seconds=5.5, video_s=4.0) < trials.REACHED_S
