"""The detector's figures on a few hundred pictures; `make soak PART=detector` has thousands, `make bench` the times."""

from __future__ import annotations

import statistics

import pytest

from tests import bounds
from tests.vision import trials

TARGETS = pytest.mark.parametrize("dictionary", ["DICT_5X5_1000", "DICT_ARUCO_ORIGINAL"])


@TARGETS
@pytest.mark.parametrize("side_px", [15, bounds.SMALLEST_PX])
def test_small_targets_are_found_in_one_frame(dictionary: str, side_px: int) -> None:
    found = [trials.small(seed, side_px, dictionary) for seed in range(30)]
    assert statistics.mean(found) >= bounds.RECALL


@TARGETS
def test_dark_targets_are_found_in_the_frames_of_a_place(dictionary: str) -> None:
    found = [trials.dark(seed, dictionary) for seed in range(20)]
    assert statistics.mean(found) >= bounds.DARK_RECALL


def test_corners_are_exact() -> None:
    assert statistics.mean(trials.corner_error(seed) for seed in range(25)) <= bounds.CORNER_PX


def test_nothing_is_invented_amid_what_looks_like_markers() -> None:
    assert [one for seed in range(80) for one in trials.false_ones(seed)] == []


@pytest.mark.parametrize(
    ("seed", "what"),
    [
        (29614477, "a white box in a dark bar: a part of another marker"),
        (78820619, "shades within a frame, like a code out of focus"),
        (9721815, "stripes within a frame"),
        (34874345, "one light stripe within a narrow frame"),
        (28498753, "a light spot within a narrow frame, smeared by motion"),
    ],
)
def test_what_was_once_taken_for_a_marker_is_none(seed: int, what: str) -> None:
    assert trials.false_ones(seed) == [], what


def test_hard_photographs_are_read_where_opencv_gives_up() -> None:
    ours, theirs, false = trials.recall(range(500, 540), hard=True)
    assert false == 0
    assert ours >= 0.8
    assert ours >= theirs + 0.3


def test_markers_half_in_a_shadow_are_read() -> None:
    ours, theirs, false = trials.recall(range(900, 925), hard=True, kind="shadow")
    assert false == 0
    assert ours >= 0.85
    assert ours >= theirs + 0.4


def test_half_a_marker_that_lies_in_the_light_is_not_read_as_another() -> None:
    """Seen half as wide as it is tall, it is like 819; the whole is 156, in half a shadow."""
    assert trials.recall([10_100], hard=True)[::2] == (1.0, 0)


def test_photographs_that_are_not_hard_are_all_read() -> None:
    ours, _, false = trials.recall(range(600, 615), hard=False)
    assert (ours, false) == (1.0, 0)
