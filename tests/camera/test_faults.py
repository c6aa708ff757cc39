"""What a user sees while something is wrong with a camera, and that all is well when it is over: no restart needed."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from services import peers
from tests.camera import trials
from tests.small_flat import SmallFlat, small_flat

pytestmark = pytest.mark.mosquitto


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SmallFlat]:
    try:
        with small_flat(tmp_path_factory.mktemp("flat"), **trials.FAULTY) as running:
            yield running
    except peers.Missing as missing:
        pytest.skip(str(missing))


@pytest.mark.parametrize("fault", trials.FAULTS, ids=str)
def test_a_fault_shows_within_fifteen_seconds_and_leaves_nothing_behind(flat: SmallFlat, fault: trials.Fault) -> None:
    assert trials.fault(flat, fault) < trials.NOTICED_S


def test_an_idle_camera_is_asked_less_than_twice_a_second(flat: SmallFlat) -> None:
    assert trials.idle(flat) <= 2.0


def test_after_a_change_of_the_password_at_most_three_logins_fail(flat: SmallFlat) -> None:
    assert 1 <= trials.change_password(flat) <= 3
