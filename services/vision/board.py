"""A printed board of squares, to be shown to a camera: what is on it, and where its inner corners are in a picture.

A ChArUco board has a marker in each white square, so a part of it is enough; a chessboard must be seen whole. What
follows from several pictures is in `calibrate_lens`, how to print one in `sheets`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import hypot
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ids = NDArray[np.intp]
Picture = NDArray[np.uint8]
BoardKind = Literal["charuco", "chessboard"]

FEWEST_CORNERS = 8  # of a ChArUco board in a picture; fewer hardly say anything about the lens
WINDOW = 0.85  # half of the window in which a corner is refined, as a part of what is clear around it
WINDOW_PX = (2, 12)  # and its least and most in pixels
QUIET = 0.15  # squares of a corner's neighbourhood left out on each side when its sharpness is measured
GAUSS = 2.507  # a step blurred by sigma has a steepest slope of contrast / (GAUSS * sigma)


@dataclass(frozen=True)
class Board:
    """`columns` x `rows` squares with sides in metres; `marker_m` and `dictionary` only matter on a ChArUco board."""

    kind: BoardKind = "charuco"
    columns: int = 9
    rows: int = 6
    square_m: float = 0.030
    marker_m: float = 0.021
    dictionary: str = "DICT_4X4_50"

    def __post_init__(self) -> None:
        """ValueError for a board that cannot be."""
        if not (3 <= self.columns <= 40 and 3 <= self.rows <= 40):
            raise ValueError(f"expected 3 to 40 squares each way, got {self.columns}x{self.rows}")
        if not 0.002 <= self.square_m <= 1:
            raise ValueError(f"expected squares of 2 to 1000 mm, got {1000 * self.square_m:g}")
        if self.kind == "charuco":
            self._check_markers()

    def _check_markers(self) -> None:
        if not 0.3 * self.square_m <= self.marker_m <= 0.95 * self.square_m:
            raise ValueError(f"expected markers of 30 to 95 % of a square, got {1000 * self.marker_m:g} mm")
        known = getattr(cv2.aruco, self.dictionary, None) if self.dictionary.startswith("DICT_") else None
        if known is None:
            raise ValueError(f"expected a dictionary such as DICT_4X4_50, got {self.dictionary[:40]!r}")
        held = len(cv2.aruco.getPredefinedDictionary(known).bytesList)
        if held < self.columns * self.rows // 2:
            raise ValueError(f"expected a dictionary of {self.columns * self.rows // 2} markers, got {self.dictionary}")

    @property
    def inner(self) -> tuple[int, int]:
        """The inner corners across and down."""
        return self.columns - 1, self.rows - 1

    @property
    def words(self) -> str:
        """What it is, for people."""
        return f"{self.kind} {self.columns}x{self.rows}, squares of {1000 * self.square_m:g} mm"

    def points(self, ids: Ids) -> Array:
        """The inner corners with these numbers, (n, 3) in metres, in the board's plane: x along a row, y down."""
        row, column = np.divmod(ids, self.inner[0])
        return np.column_stack((column + 1, row + 1, np.zeros(len(ids)))) * self.square_m


@dataclass(frozen=True, eq=False)
class Seen:
    """A board in a picture: numbers of its inner corners, where they are on it and in the picture.

    `points` (n, 3) in metres, `pixels` (n, 2). `blur_px`: how wide its edges are, as the sigma of a Gaussian.
    """

    ids: Ids
    points: Array
    pixels: Array
    blur_px: float = 0.0

    def only(self, kept: NDArray[np.bool_]) -> Seen:
        """Without the other corners."""
        return Seen(self.ids[kept], self.points[kept], self.pixels[kept], self.blur_px)


def find(grey: Picture, board: Board) -> Seen | None:
    """The board in a grey picture, corners to a few hundredths of a pixel; None where it is not seen well enough."""
    ids, pixels = _charuco(grey, board) if board.kind == "charuco" else _chessboard(grey, board)
    if len(ids) < FEWEST_CORNERS or _in_one_line(board.points(ids)):
        return None
    side = _side_px(board, ids, pixels)
    pixels = _refined(grey, board, pixels, side)
    return Seen(ids, board.points(ids), pixels, _blur(grey, pixels, side))


def _refined(grey: Picture, board: Board, pixels: Array, side: float) -> Array:
    """The corners where the gradients around them meet; the window must not reach into a marker."""
    clear = side * (1 - board.marker_m / board.square_m) / 2 if board.kind == "charuco" else side / 2
    window = int(np.clip(WINDOW * clear, *WINDOW_PX))
    ends = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 40, 0.001)
    start = pixels.astype(np.float32).reshape(-1, 1, 2)
    return np.asarray(cv2.cornerSubPix(grey, start, (window, window), (-1, -1), ends), float).reshape(-1, 2)


@lru_cache(maxsize=4)
def _detector(board: Board) -> Any:
    book = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    made = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m, board.marker_m, book)
    parts, look = cv2.aruco.CharucoParameters(), cv2.aruco.DetectorParameters()
    look.minMarkerPerimeterRate = 0.02
    return cv2.aruco.CharucoDetector(made, parts, look)


def _charuco(grey: Picture, board: Board) -> tuple[Ids, Array]:
    corners, ids, _, _ = _detector(board).detectBoard(grey)
    if ids is None or corners is None:
        return np.zeros(0, np.intp), np.zeros((0, 2))
    return np.asarray(ids, np.intp).ravel(), np.asarray(corners, float).reshape(-1, 2)


def _chessboard(grey: Picture, board: Board) -> tuple[Ids, Array]:
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners = cv2.findChessboardCornersSB(grey, board.inner, flags=flags)
    if not found:
        return np.zeros(0, np.intp), np.zeros((0, 2))
    return np.arange(board.inner[0] * board.inner[1]), np.asarray(corners, float).reshape(-1, 2)


def _in_one_line(points: Array) -> bool:
    spread = np.linalg.svd(points[:, :2] - points[:, :2].mean(axis=0), compute_uv=False)
    return bool(spread[1] < 0.1 * spread[0])


def _side_px(board: Board, ids: Ids, pixels: Array) -> float:
    """The side of a square in the picture, the smaller way."""
    plane, _ = cv2.findHomography(board.points(ids)[:, :2], pixels)
    if plane is None:
        return float(WINDOW_PX[0])
    middle = board.points(ids)[:, :2].mean(axis=0)
    near = middle + board.square_m * np.array([[0, 0], [1, 0], [0, 1]])
    at = cv2.perspectiveTransform(near[None], plane)[0]
    return float(min(hypot(*(at[1] - at[0])), hypot(*(at[2] - at[0]))))


def _blur(grey: Picture, pixels: Array, side: float) -> float:
    """How wide the edges around the corners are: the median of contrast by steepest slope."""
    half = max(3, round(side * (0.5 - QUIET)))
    widths = []
    for x, y in np.rint(pixels).astype(int):
        patch = grey[max(y - half, 0) : y + half + 1, max(x - half, 0) : x + half + 1].astype(np.float32)
        if min(patch.shape) < 5:
            continue
        low, high = np.percentile(patch, (10, 90))
        across, down = (np.abs(np.gradient(patch, axis=axis)).max() for axis in (1, 0))
        widths.append((high - low) / (GAUSS * max(float(min(across, down)), 1e-3)))
    return float(np.median(widths)) if widths else float("inf")
