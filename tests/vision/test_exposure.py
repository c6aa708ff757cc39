"""Whether a marker's light or dark is cut off, and what that does to its edges."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from services.vision.detect import detect
from services.vision.exposure import cut_off
from services.vision.frames import Transform
from tests.vision.rendering import Print, facing, picture, pinhole, true_corners

LENS = pinhole()
HERE = Transform(np.eye(3), np.zeros(3))
HARD, SOFT = 2.0, 0.8  # gains around the middle grey


def shown(seed: int, gain: float, shift: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A picture of one marker through such a curve, and its true corners."""
    rng = np.random.default_rng(seed)
    marker = Print(582, "DICT_5X5_1000", 0.14, HERE @ facing(rng, np.array([0.1, 0.05, 2.5]), 20.0))
    image = picture(LENS, HERE, [marker], rng)
    curve = np.clip((np.arange(256) - 128) * gain + 128 + shift, 0, 255).astype(np.uint8)
    return cv2.LUT(image, curve), true_corners(LENS, HERE, marker)


@pytest.mark.parametrize("seed", range(5))
def test_soft_pictures_of_a_marker_are_whole_hard_ones_are_cut_off(seed: int) -> None:
    assert not cut_off(*shown(seed, SOFT))
    assert cut_off(*shown(seed, HARD))
    assert cut_off(*shown(seed, 1.0, shift=100.0))
    assert cut_off(*shown(seed, 1.0, shift=-100.0))


def test_light_elsewhere_in_the_picture_does_not_count() -> None:
    image, corners = shown(1, SOFT)
    image[:, : int(corners[:, 0].min()) - 20] = 255
    assert not cut_off(image, corners)


def test_a_marker_half_outside_is_looked_at_as_far_as_it_is_there() -> None:
    image, corners = shown(1, SOFT)
    assert not cut_off(
        np.ascontiguousarray(image[int(corners[:, 1].mean()) - 20 :]), corners - (0, corners[:, 1].mean() - 20)
    )


def test_where_it_is_cut_off_the_edges_are_beside() -> None:
    def longer(seed: int, shift: float) -> float:
        image, true = shown(seed, HARD, shift)
        (found,) = detect(image, "DICT_5X5_1000", {582})
        return float(np.linalg.norm(found.corners - np.roll(found.corners, 1, axis=0), axis=1).mean()) - float(
            np.linalg.norm(true - np.roll(true, 1, axis=0), axis=1).mean()
        )

    dark, light = (np.mean([longer(seed, shift) for seed in range(5)]) for shift in (-40.0, 40.0))
    assert dark > 0.03 > -0.03 > light
