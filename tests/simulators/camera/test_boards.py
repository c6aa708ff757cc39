"""A held board is seen where geometry puts it, as exactly as a calibration needs; and it can be moved and put away."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from services.simulators.camera.view.optics import project, window
from services.simulators.camera.view.scene import Scene
from services.simulators.world import World
from services.vision.board import Board, find
from services.vision.lens import Lens
from tests.vision.boards import held, on_it

HELD = [
    ("charuco", (0.5, 0.5), 0.6, (0, 0, 0)),
    ("charuco", (0.2, 0.75), 0.9, (-20, -20, 0)),
    ("chessboard", (0.75, 0.6), 0.6, (25, 10, 5)),
]


@pytest.fixture(scope="module")
def scene(world: World) -> Scene:
    return Scene(world, world.cameras["ip1"].lens, seed=1)


@pytest.mark.parametrize(("kind", "spot", "distance", "turned"), HELD)
def test_its_corners_are_found_where_they_are(
    scene: Scene, world: World, kind: str, spot: tuple[float, float], distance: float, turned: tuple[float, ...]
) -> None:
    camera, board = world.cameras["ip1"], Board(kind=kind)
    lens = camera.lens
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
    pose = camera.pose(30.0, 40.0)
    here = held(pose, Lens(lens.width, lens.height, matrix, np.array(lens.distortion)), board, spot, distance, turned)
    scene.hold("board", here)
    image = scene.draw(pose, window(lens, 1.0, lens.width, lens.height))
    seen = find(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), board)
    assert seen is not None
    assert len(seen.ids) >= 36
    true = project(pose.inverse().apply(here.pose.apply(on_it(board, seen.points))), lens)
    other = true[::-1] if kind == "chessboard" else true  # which of its ends is the first cannot be seen
    off = min(np.abs(seen.pixels - true).max(), np.abs(seen.pixels - other).max())
    assert off < 0.2
    assert seen.blur_px < 1.2


def test_it_is_gone_when_it_was_put_away_and_not_seen_from_behind(scene: Scene, world: World) -> None:
    camera, board = world.cameras["ip1"], Board()
    lens = camera.lens
    pose, view = camera.pose(30.0, 40.0), window(lens, 1.0, lens.width, lens.height)
    scene.hold("board", None)
    without = scene.draw(pose, view)
    plain = Lens(
        lens.width, lens.height, np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]]), np.zeros(5)
    )
    scene.hold("board", held(pose, plain, board, (0.5, 0.5), 0.6, (0, 180, 0)))
    assert (scene.draw(pose, view) == without).all()
    scene.hold("board", held(pose, plain, board, (0.5, 0.5), 0.6, (0, 0, 0)))
    assert (scene.draw(pose, view) != without).any()
    scene.hold("board", None)
    assert (scene.draw(pose, view) == without).all()
