"""Sound by orders on the bus: what is recorded, and what arrives at the loudspeaker."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest

from services import peers
from tests.camera import sound_trials
from tests.small_flat import SmallFlat, small_flat

pytestmark = pytest.mark.mosquitto


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SmallFlat]:
    try:
        with small_flat(tmp_path_factory.mktemp("flat"), **sound_trials.SPEAKING) as running:
            yield running
    except peers.Missing as missing:
        pytest.skip(str(missing))


@pytest.mark.parametrize("camera", sound_trials.FIRMWARES)
def test_a_recording_holds_the_microphones_tone(flat: SmallFlat, camera: str) -> None:
    assert sound_trials.record(flat, Random(camera), camera) < 2.0


@pytest.mark.parametrize("camera", sound_trials.FIRMWARES)
def test_what_is_played_arrives_at_the_loudspeaker(flat: SmallFlat, camera: str) -> None:
    assert sound_trials.play(flat, Random(camera), camera) > 99.9
