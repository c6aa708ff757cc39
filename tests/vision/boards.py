"""Boards before a camera: held as a person would, and the corners that a good picture of them gives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from services.simulators.board import HeldBoard
from services.vision.board import Board, Seen
from services.vision.frames import Transform
from services.vision.lens import Lens

Array = NDArray[np.float64]
TO_THE_VIEWER = np.diag([1.0, -1.0, -1.0])  # a board's frame (y up, z out of the print) in the camera's, when frontal
EDGE_PX = 5.0  # a corner nearer to the picture's edge is not found
# Where a person holds it, in widths and heights of the picture, the last ones not to be seen whole.
SPOTS = tuple((x, y) for y in (0.5, 0.14, 0.86) for x in (0.5, 0.08, 0.92, 0.3, 0.7))


def held(
    camera: Transform, lens: Lens, board: Board, spot: tuple[float, float], distance: float, turned: Sequence[float]
) -> HeldBoard:
    """The board with its centre on a spot of the picture, `turned` (degrees, camera axes) out of frontal."""
    ray = lens.rays(np.array([[spot[0] * lens.width, spot[1] * lens.height]]))[0]
    rotation = camera.rotation @ _turn(turned) @ TO_THE_VIEWER
    position = camera.apply(distance * np.array([*ray, 1.0]))
    vector = np.degrees(np.asarray(cv2.Rodrigues(rotation)[0], float).ravel())
    return HeldBoard(
        kind=board.kind,
        columns=board.columns,
        rows=board.rows,
        square=board.square_m,
        marker=board.marker_m,
        dictionary=board.dictionary,
        position=(float(position[0]), float(position[1]), float(position[2])),
        turned_deg=(float(vector[0]), float(vector[1]), float(vector[2])),
    )


def on_it(board: Board, points: Array) -> Array:
    """Points as `Board.points` numbers them (from the top left corner, y down) in the held board's frame."""
    middle = np.array([board.columns, board.rows, 0]) * board.square_m / 2
    return np.asarray((points - middle) * (1.0, -1.0, 1.0), float)


def gestures(rng: np.random.Generator) -> Iterator[tuple[tuple[float, float], float, list[float]]]:
    """How a person holds it, on and on: where, how far away (m), and turned how."""
    while True:
        for x, y in SPOTS:
            axis = rng.normal(size=3) * (1, 1, 0.4)
            turned = axis / np.linalg.norm(axis) * rng.uniform(12, 38)
            spot = (x + rng.normal(0, 0.03), y + rng.normal(0, 0.04))
            yield spot, float(rng.uniform(0.4, 0.8)), [float(part) for part in turned]


def views(lens: Lens, board: Board, count: int, rng: np.random.Generator, noise: float = 0.06) -> list[Seen]:
    """What pictures of a board held so would give, without making the pictures."""
    ids = np.arange(board.inner[0] * board.inner[1])
    here, seen = Transform(np.eye(3), np.zeros(3)), []
    for spot, distance, turned in gestures(rng):
        pose = held(here, lens, board, spot, distance, turned).pose
        points = pose.apply(on_it(board, board.points(ids)))
        pixels = lens.project(points)
        with np.errstate(invalid="ignore"):
            inside = ((pixels > EDGE_PX) & (pixels < np.array([lens.width, lens.height]) - EDGE_PX)).all(axis=1)
            inside &= np.abs(lens.rays(pixels) - points[:, :2] / points[:, 2:]).max(axis=1) < 1e-6  # not folded back in
        if inside.sum() >= 10:
            shaken = pixels[inside] + rng.normal(0, noise, (inside.sum(), 2))
            seen.append(Seen(ids[inside], board.points(ids[inside]), shaken, 0.9))
        if len(seen) == count:
            return seen
    return seen


def _turn(degrees: Sequence[float]) -> Array:
    return np.asarray(cv2.Rodrigues(np.radians(degrees))[0], float)
