"""What is printed is what is looked for, at its true size."""

from __future__ import annotations

import re

import cv2
import numpy as np
import pytest

from services.vision.board import Board, find
from services.vision.detect import detect
from services.vision.sheets import RIM_MM, board_sheet, marker_sheet, pdf, png

DPI = 200


@pytest.mark.parametrize("board", [Board(), Board(columns=8, rows=5), Board("chessboard", 7, 10, 0.02)], ids=str)
def test_a_printed_board_is_found_whole_with_its_corners_where_they_belong(board: Board) -> None:
    picture = cv2.imdecode(np.frombuffer(png(board_sheet(board), DPI), np.uint8), cv2.IMREAD_GRAYSCALE)
    seen = find(picture.astype(np.uint8), board)
    assert seen is not None
    assert len(seen.ids) == board.inner[0] * board.inner[1]
    mm = (seen.pixels + 0.5) * 25.4 / DPI - RIM_MM
    wanted = seen.points[:, :2] * 1000
    other = wanted[::-1] if board.kind == "chessboard" else wanted
    assert min(np.abs(mm - wanted).max(), np.abs(mm - other).max()) < 0.1


def test_a_printed_marker_is_read_and_has_its_size() -> None:
    sheet = marker_sheet(582, "DICT_5X5_1000", 140.0)
    picture = cv2.imdecode(np.frombuffer(png(sheet, 100), np.uint8), cv2.IMREAD_GRAYSCALE).astype(np.uint8)
    (seen,) = detect(picture, "DICT_5X5_1000", [582])
    sides = np.linalg.norm(np.diff(np.vstack((seen.corners, seen.corners[:1])), axis=0), axis=1) * 25.4 / 100
    assert sides == pytest.approx([140.0] * 4, abs=0.3)
    assert seen.corners[0][1] < seen.corners[3][1]  # its top is up


def test_the_png_says_its_resolution() -> None:
    data = png(board_sheet(Board()), 600)
    at = data.index(b"pHYs")
    assert int.from_bytes(data[at + 4 : at + 8], "big") == round(600 / 0.0254)


def test_the_pdf_has_a_page_of_the_right_size_for_each_sheet() -> None:
    sheets = [marker_sheet(marker, "DICT_5X5_1000", 140.0) for marker in (17, 582)]
    data = pdf(sheets)
    boxes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", data)
    assert [float(width) * 25.4 / 72 for width, _ in boxes] == pytest.approx(
        [sheet.width for sheet in sheets], abs=0.01
    )
    assert b"17 of DICT_5X5_1000" in data
    start = int(data.rsplit(b"startxref\n", 1)[1].split()[0])
    assert data[start : start + 4] == b"xref"
    for number, entry in enumerate(re.findall(rb"(\d{10}) 00000 n", data), start=1):
        assert data[int(entry) :].startswith(b"%d 0 obj" % number)


@pytest.mark.parametrize(
    ("marker", "dictionary", "side"), [(1000, "DICT_5X5_1000", 140), (1, "DICT_NONE", 140), (1, "DICT_5X5_1000", 1)]
)
def test_what_cannot_be_printed_is_said(marker: int, dictionary: str, side: float) -> None:
    with pytest.raises(ValueError, match="expected"):
        marker_sheet(marker, dictionary, side)
