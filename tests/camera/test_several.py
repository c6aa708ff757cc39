"""Several cameras at once, each a process of its own: what one of them does is nothing to the others."""

from __future__ import annotations

from pathlib import Path

import pytest

from services import peers
from tests.camera import trials
from tests.small_flat import small_flat

pytestmark = pytest.mark.mosquitto
CAMERAS = ("hall", "kitchen", "living", "attic")


def test_orders_on_three_cameras_take_as_long_while_the_fourth_hangs(tmp_path: Path) -> None:
    try:
        with small_flat(tmp_path, CAMERAS, simulator={"latency_s": 0.1}) as flat:
            ratio = trials.hang(flat, "attic")
    except peers.Missing as missing:
        pytest.skip(str(missing))
    assert ratio < 2.0  # one that waited for the fourth would take twenty times as long
