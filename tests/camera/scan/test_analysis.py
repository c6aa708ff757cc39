"""Looking at the frames of a scan: together where the camera stood still, and nothing is lost with a lost frame."""

from __future__ import annotations

import queue
from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from services.bus import Message
from services.camera.scan.analysis import Analysed, Inline, Pool, Task, analyse
from services.camera.video import pictures
from tests.vision.rendering import Print, facing, picture, pinhole, true_corners
from tests.vision.test_detect import CAMERA

LENS = pinhole(480, 360)
SHOWN = Print(582, "DICT_5X5_1000", 0.14, facing(np.random.default_rng(1), np.array([0.1, 0.05, 3.0]), 25))


def task(number: int, jpeg: bytes | None = None, *, of: int = 1, draw: bool = False, mirror: bool = True) -> Task:
    """A frame of one place, as a ceiling camera delivers it that is set to be upright."""
    image = picture(LENS, CAMERA, [SHOWN], np.random.default_rng(number), noise=6.0)
    sent = image if mirror else np.ascontiguousarray(image[:, ::-1])
    jpeg = pictures.encode(cv2.cvtColor(sent, cv2.COLOR_GRAY2BGR), 95) if jpeg is None else jpeg
    return Task("s", number, jpeg, True, mirror, "ceiling", "DICT_5X5_1000", (582,), draw=draw, still=3, of=of)


def test_frames_of_a_place_are_searched_together_and_each_has_its_own_corners() -> None:
    answers = analyse([task(number) for number in range(4)])
    truth = true_corners(LENS, CAMERA, SHOWN)
    assert [answer.number for answer in answers] == [0, 1, 2, 3]
    corners = np.array([answer.detections[0].corners for answer in answers])
    assert np.abs(corners - truth).max() < 0.5
    assert 0.005 < corners.std(axis=0).mean() < 0.2
    assert {answer.size for answer in answers} == {(480, 360)}


def test_a_broken_frame_fails_alone() -> None:
    whole = task(1).jpeg
    good, bad, other = analyse([task(0), task(1, whole[: len(whole) // 2]), task(2)])
    assert "expected a whole JPEG" in bad.error
    assert bad.detections == ()
    assert [len(one.detections) for one in (good, other)] == [1, 1]


def test_a_mirrored_picture_is_unmirrored_before_it_is_searched() -> None:
    (straight,), (mirrored,) = analyse([task(0)]), analyse([task(0, mirror=False)])
    np.testing.assert_allclose(straight.detections[0].corners, mirrored.detections[0].corners, atol=0.1)


def test_a_frame_is_drawn_on_when_asked() -> None:
    (answer,) = analyse([task(0, draw=True)])
    assert answer.jpeg is not None
    x, y = np.rint(answer.detections[0].corners[0]).astype(int)
    blue, green, red = pictures.decode(answer.jpeg)[y, x].astype(int)
    assert red > max(blue, green) + 80


def test_inline_looks_at_each_frame_at_once() -> None:
    posted: list[Message] = []
    Inline(posted.append).submit(task(5, of=8))
    assert [message.value.number for message in posted] == [5]


@pytest.fixture
def pool() -> Iterator[tuple[Pool, queue.Queue[Analysed]]]:
    answers: queue.Queue[Analysed] = queue.Queue()
    pool = Pool(lambda message: answers.put(message.value), 1)
    yield pool, answers
    pool.close()


def test_workers_answer_for_every_frame_even_when_one_of_the_place_never_comes(pool) -> None:
    looking, answers = pool
    for number in range(3):
        looking.submit(task(number, of=4))
    numbers = {answers.get(timeout=60).number for _ in range(3)}
    assert numbers == {0, 1, 2}
    for number in range(3, 5):
        looking.submit(task(number, of=2))
    assert {answers.get(timeout=60).number for _ in range(2)} == {3, 4}
    assert answers.empty()
