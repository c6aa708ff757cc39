"""Random flats in virtual time: nothing missed that is to be seen, nothing invented. The soak tries many more."""

from __future__ import annotations

import random

import pytest

from tests.camera.scan.scenes import scan_a_scene


@pytest.mark.parametrize("seed", [3, 4, 6])  # three markers, two of them to be seen; none; three, one to be seen
def test_nothing_is_missed_and_nothing_invented(seed: int) -> None:
    assert scan_a_scene(random.Random(seed), places=3, frames=2, full_size=False) > 0
