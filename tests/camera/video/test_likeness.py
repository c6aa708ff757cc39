"""Two pictures of one pose are alike through noise and changing light; a turn of a pixel is a turn."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from services.camera.video.likeness import Thumb, likeness, thumb
from services.camera.video.pictures import Image

RNG = np.random.default_rng(1)
SIZE = (648, 1152)


def room() -> Image:
    """Furniture, about: rectangles of all sizes and greys."""
    image = np.full((SIZE[0] + 80, SIZE[1] + 80, 3), 190, np.uint8)
    for _ in range(150):
        x, y = int(RNG.integers(0, SIZE[1])), int(RNG.integers(0, SIZE[0]))
        w, h = (int(one) for one in RNG.integers(10, 150, 2))
        colour = tuple(int(one) for one in RNG.integers(20, 230, 3))
        cv2.rectangle(image, (x, y), (x + w, y + h), colour, -1)
    return cv2.GaussianBlur(image, (5, 5), 1.0).astype(np.uint8)


ROOM = room()


def seen(right: float = 0.0, down: float = 0.0, light: float = 1.0, noise: float = 3.0) -> Thumb:
    move = np.array([[1.0, 0.0, -40 - right], [0.0, 1.0, -40 - down]])
    view = cv2.warpAffine(ROOM, move, (SIZE[1], SIZE[0]))
    noisy = view * light + RNG.normal(0, noise, view.shape)
    return thumb(np.clip(noisy, 0, 255).astype(np.uint8))


def test_noise_and_light_are_no_motion() -> None:
    assert likeness(seen(), seen()) == "same"
    assert likeness(seen(light=0.5), seen(light=0.8)) == "same"
    assert likeness(seen(noise=12), seen(noise=12)) == "same"


@pytest.mark.parametrize(("right", "down"), [(2.0, 0.0), (0.0, 2.0), (-10.0, 5.0), (38.0, -38.0)])
def test_a_turn_is_seen(right: float, down: float) -> None:
    assert likeness(seen(), seen(right, down)) == "moved"


def test_another_view_is_no_likeness() -> None:
    other = thumb(np.ascontiguousarray(ROOM[:648, :1152][::-1, ::-1]))
    assert likeness(seen(), other) == "moved"


def test_where_nothing_can_be_seen_nothing_is_said() -> None:
    dark = [thumb(np.clip(RNG.normal(12, 2, (*SIZE, 3)), 0, 255).astype(np.uint8)) for _ in range(2)]
    assert likeness(*dark) == "unclear"


def test_pictures_of_another_size_are_not_compared() -> None:
    assert likeness(seen(), thumb(np.zeros((480, 640, 3), np.uint8))) == "moved"
