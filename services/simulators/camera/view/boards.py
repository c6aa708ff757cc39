"""A held board (`simulators/board.py`), drawn into a finished picture: the print is averaged over every pixel."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from services.simulators.board import HeldBoard
from services.simulators.camera.view.optics import Float32
from services.simulators.camera.view.prints import INK, PAPER, Image, View, free, laid, plane, rows_and_columns
from services.simulators.camera.view.solids import Box

SQUARE_PX = (64, 32, 16, 8)  # of a square in its own picture: the one is taken that is about as fine as the looks
FINE = 2  # looks per pixel, each way


def draw(image: Image, board: HeldBoard, view: View, boxes: list[Box]) -> None:
    """Draws a board into the picture, where it faces the camera and nothing stands before it."""
    patch = rows_and_columns(board.pose, board.sheet(), view)
    if patch is None:
        return
    rays, near = view.rays[patch], [box for box in boxes if box.may_hide(view.pose.translation, board.sheet())]
    grey, cover = _averaged(board, view, rays)
    laid(image[patch], grey, cover * free(board.pose, view, rays, near))


@lru_cache(maxsize=4)
def _print(kind: str, columns: int, rows: int, square: float, marker: float, dictionary: str) -> list[Float32]:
    """Greys of the squares, in each of the sizes."""
    finest = SQUARE_PX[0]
    if kind == "charuco":
        book = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
        made = cv2.aruco.CharucoBoard((columns, rows), square, marker, book)
        ink = made.generateImage((columns * finest, rows * finest))
    else:
        ink = np.kron(np.indices((rows, columns)).sum(axis=0) % 2 * 255, np.ones((finest, finest)))
    greys = np.where(np.asarray(ink) > 127, PAPER, INK).astype(np.float32)
    sizes = [(columns * size, rows * size) for size in SQUARE_PX]
    return [np.asarray(cv2.resize(greys, size, interpolation=cv2.INTER_AREA), np.float32) for size in sizes]


def _averaged(board: HeldBoard, view: View, rays: Float32) -> tuple[Float32, Float32]:
    """Mean grey of the print, and the part covered by the sheet, of every pixel of a patch."""
    height, width = rays.shape[:2]
    dense = np.asarray(cv2.resize(rays, (width * FINE, height * FINE), interpolation=cv2.INTER_LINEAR), np.float32)
    x, y = np.moveaxis(plane(board.pose, view, dense) / board.square, -1, 0)
    step = float(np.median(np.hypot(np.diff(x[::FINE], axis=1), np.diff(y[::FINE], axis=1))))  # squares between looks
    level = min(range(len(SQUARE_PX)), key=lambda i: abs(SQUARE_PX[i] * step - 1))
    side = SQUARE_PX[level]
    prints = _print(board.kind, board.columns, board.rows, board.square, board.marker, board.dictionary)
    across, down = ((x + board.columns / 2) * side - 0.5, (board.rows / 2 - y) * side - 0.5)
    grey = cv2.remap(
        prints[level], across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=(PAPER,)
    )
    rim = board.margin / board.square
    on = (np.abs(x) < board.columns / 2 + rim) & (np.abs(y) < board.rows / 2 + rim)
    cover = cv2.resize(on.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
    mean = cv2.resize(np.where(on, grey, 0.0).astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
    return (mean / np.maximum(cover, 1e-6)).astype(np.float32), cover.astype(np.float32)
