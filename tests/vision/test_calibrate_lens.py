"""The lens from views of a board: close to the truth, honest about it, and not misled by bad views."""

from __future__ import annotations

import numpy as np
import pytest

from services.vision.board import Board, Seen
from services.vision.calibrate_lens import doubt_px, fit
from services.vision.lens import Lens
from tests import bounds
from tests.vision.boards import views
from tests.vision.lens_trials import PLAIN, RATIONAL, SIZE, lens_trial

BOARD = Board()


@pytest.mark.parametrize("seed", range(3))
def test_the_lens_is_found_within_half_a_percent(seed: int) -> None:
    trial = lens_trial(np.random.default_rng(seed))
    assert trial.focal_off <= bounds.LENS
    assert trial.centre_off_px < 6.0
    assert trial.reprojection_px < 2.0


def test_what_it_says_about_its_doubt_is_true() -> None:
    rng = np.random.default_rng(5)
    off = [lens_trial(rng, count=20).focal_sigmas for _ in range(16)]
    assert 0.6 < float(np.sqrt(np.mean(np.square(off)))) < 1.5


def test_a_lens_that_bends_more_is_given_the_rational_model() -> None:
    rng = np.random.default_rng(2)
    found = fit(views(RATIONAL, BOARD, 30, rng, 0.05), SIZE)
    assert found.model == "rational_polynomial"
    assert found.rms_px < 0.09
    assert fit(views(PLAIN, BOARD, 30, rng), SIZE).model == "plumb_bob"


def test_a_view_that_disagrees_is_left_out_and_a_corner_that_jumped_too() -> None:
    rng = np.random.default_rng(3)
    seen = views(PLAIN, BOARD, 20, rng)
    shaken = seen[3].pixels + rng.normal(0, 3.0, seen[3].pixels.shape)
    seen[3] = Seen(seen[3].ids, seen[3].points, shaken)
    seen[5].pixels[2] += 4.0
    found = fit(seen, SIZE)
    assert set(found.left_out) == {3}
    assert len(found.seen[found.used.index(5)].ids) == len(seen[5].ids) - 1
    assert found.rms_px < 0.12


def test_few_views_leave_more_doubt_than_many() -> None:
    rng = np.random.default_rng(4)
    seen = views(PLAIN, BOARD, 30, rng)
    few, many = fit(seen[:6], SIZE), fit(seen, SIZE)
    assert few.focal_doubt > 1.5 * many.focal_doubt
    assert np.nanmax(doubt_px(few)) > np.nanmax(doubt_px(many))
    assert np.nanmax(doubt_px(many)) < 2.0


@pytest.mark.parametrize(
    ("seen", "why"),
    [
        pytest.param([], "at least", id="no views"),
        pytest.param(views(PLAIN, BOARD, 3, np.random.default_rng(1)), "at least", id="three views"),
        pytest.param(
            [
                Seen(one.ids, one.points * (1 + index, 1, 1), one.pixels)
                for index, one in enumerate(views(PLAIN, BOARD, 8, np.random.default_rng(1)))
            ],
            "do not",
            id="boards of different shapes",
        ),
    ],
)
def test_what_gives_no_lens_is_said(seen: list[Seen], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        fit(seen, SIZE)


def test_views_of_a_board_that_was_never_tilted_are_doubted() -> None:
    """Held parallel to the picture everywhere, the focal length and the distance trade off."""
    lens, ids = Lens(*SIZE, PLAIN.matrix, np.zeros(5)), np.arange(BOARD.inner[0] * BOARD.inner[1])
    rng, seen = np.random.default_rng(6), []
    for shift in rng.uniform(-0.2, 0.2, (10, 2)):
        points = BOARD.points(ids)
        pixels = lens.project(points - points.mean(axis=0) + (*shift, 0.6)) + rng.normal(0, 0.06, (len(ids), 2))
        seen.append(Seen(ids, points, pixels))
    assert fit(seen, SIZE, "plumb_bob").focal_doubt > 0.01
