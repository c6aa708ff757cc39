"""What a person is told while showing a board: what is missing, what was no use, and when it is enough."""

from __future__ import annotations

import numpy as np
import pytest

from services.vision.board import Board, Seen
from services.vision.coverage import MOST, Album, facing
from services.vision.frames import Transform
from tests.vision.boards import held, on_it, views
from tests.vision.lens_trials import PLAIN, SIZE

BOARD = Board()
HERE = Transform(np.eye(3), np.zeros(3))


def shown(spot: tuple[float, float] = (0.5, 0.5), turned: tuple[float, float, float] = (0, 0, 0)) -> Seen:
    ids = np.arange(BOARD.inner[0] * BOARD.inner[1])
    pose = held(HERE, PLAIN, BOARD, spot, 0.6, turned).pose
    return Seen(ids, BOARD.points(ids), PLAIN.project(pose.apply(on_it(BOARD, BOARD.points(ids)))), 0.9)


def test_it_asks_for_the_corners_of_the_picture_first_and_ends_when_all_was_shown() -> None:
    album = Album(SIZE)
    assert "top far left" in album.missing
    asked = set()
    for one in views(PLAIN, BOARD, 80, np.random.default_rng(1)):
        album.add(one)
        asked.add(album.missing)
        if not album.missing:
            break
    assert not album.missing
    assert album.progress == 1.0
    assert album.regions.all()
    assert any("far right" in hint for hint in asked)


def test_a_region_that_was_never_shown_is_named_to_the_end() -> None:
    album = Album(SIZE)
    for one in views(PLAIN, BOARD, 80, np.random.default_rng(1)):
        if one.pixels[:, 0].max() < 0.75 * SIZE[0]:
            album.add(one)
    assert album.missing.endswith("far right of the picture")
    assert album.progress < 1.0


def test_after_many_views_it_is_enough_although_a_region_is_missing() -> None:
    album, rng = Album(SIZE), np.random.default_rng(2)
    for one in views(PLAIN, BOARD, 150, rng):
        if one.pixels[:, 0].max() < 0.75 * SIZE[0]:
            album.add(one)
    assert len(album.views) == MOST
    assert not album.missing
    assert not album.regions.all()


def test_the_same_again_is_not_taken_twice_unless_it_is_moved_or_tilted() -> None:
    album = Album(SIZE)
    assert album.add(shown()) == ""
    assert "as before" in album.add(shown((0.51, 0.5)))
    assert album.add(shown((0.7, 0.5))) == ""
    assert album.add(shown(turned=(0, 25, 0))) == ""
    assert len(album.views) == 3


def test_a_sharper_picture_of_the_same_takes_its_place() -> None:
    album, blurred = Album(SIZE), shown()
    album.add(Seen(blurred.ids, blurred.points, blurred.pixels, 1.5))
    album.add(shown())
    assert [one.seen.blur_px for one in album.views] == [0.9]


def test_a_blurred_board_is_told() -> None:
    album, seen = Album(SIZE), shown()
    assert "hold it still" in album.add(Seen(seen.ids, seen.points, seen.pixels, 2.5))
    assert not album.views


@pytest.mark.parametrize(
    ("turned", "axis", "sign"), [((0, 25, 0), 0, -1), ((0, -25, 0), 0, 1), ((25, 0, 0), 1, 1), ((-25, 0, 0), 1, -1)]
)
def test_where_its_face_is_turned_is_seen(turned: tuple[float, float, float], axis: int, sign: int) -> None:
    """Turned about the picture's y (down) by the right-hand rule, a face that looked at the lens looks to the left."""
    ways = facing(shown(turned=turned), SIZE)
    assert sign * ways[axis] == pytest.approx(25, abs=8)
    assert abs(ways[1 - axis]) < 8
