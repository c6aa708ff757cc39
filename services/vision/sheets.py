"""Boards and markers to be printed at their true size: as PDF, or as PNG that says its resolution. Bytes out, no files.

Everything is black squares in millimetres from the top left corner of the sheet; a line of 100 mm below tells with a
ruler whether the printer kept the scale. How a board is found in a picture is in `board`.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from services.vision.board import Board

RIM_MM = 12.0  # of white around: printers do not print to the edge, and detectors want some
FOOT_MM = 16.0  # for the ruler and the words
RULER_MM, THICK_MM, TEXT_MM = 100.0, 0.4, 3.2
POINTS = 72 / 25.4  # of PDF in a millimetre
Rectangle = tuple[float, float, float, float]  # left, top, width, height


@dataclass(frozen=True)
class Sheet:
    """One page: `black` rectangles, and `words` at the foot."""

    width: float
    height: float
    black: tuple[Rectangle, ...]
    words: str

    @property
    def all_black(self) -> tuple[Rectangle, ...]:
        """With the ruler: a line and its ends."""
        y = self.height - FOOT_MM + 4
        ends = [(RIM_MM + x - THICK_MM / 2, y - 2, THICK_MM, 4.0) for x in (0.0, RULER_MM)]
        return (*self.black, (RIM_MM, y - THICK_MM / 2, RULER_MM, THICK_MM), *ends)


def board_sheet(board: Board) -> Sheet:
    """A board on one page."""
    side, marker = 1000 * board.square_m, 1000 * board.marker_m
    width, height = board.columns * side, board.rows * side
    white = _white_squares(board)
    black = [
        (RIM_MM + column * side, RIM_MM + row * side, side, side)
        for row in range(board.rows)
        for column in range(board.columns)
        if (row, column) not in white
    ]
    words = f"{board.kind} {board.columns}x{board.rows}, squares {side:g} mm"
    if board.kind == "charuco":
        inset, book = (side - marker) / 2, _book(board.dictionary)
        for index, (row, column) in enumerate(white):
            corner = (RIM_MM + column * side + inset, RIM_MM + row * side + inset)
            black += _marker(book, index, corner, marker)
        words += f", markers {marker:g} mm, {board.dictionary}"
    page = (max(width, RULER_MM) + 2 * RIM_MM, height + RIM_MM + FOOT_MM)
    return Sheet(*page, tuple(black), f"{words}. Print at 100 %: the line is 100 mm long.")


def marker_sheet(marker: int, dictionary: str, side_mm: float) -> Sheet:
    """One marker on a page, with a white rim of a module or more. ValueError when there is no such marker."""
    book = _book(dictionary)
    if not 0 <= marker < len(book.bytesList):
        raise ValueError(f"expected a marker of {dictionary} from 0 to {len(book.bytesList) - 1}, got {marker}")
    if not 10 <= side_mm <= 2000:
        raise ValueError(f"expected a side of 10 to 2000 mm, got {side_mm:g}")
    rim = max(RIM_MM, side_mm / (int(book.markerSize) + 2))
    width = max(side_mm + 2 * rim, RULER_MM + 2 * RIM_MM)
    black = _marker(book, marker, ((width - side_mm) / 2, rim), side_mm)
    words = f"{marker} of {dictionary}, side {side_mm:g} mm, top is up. Print at 100 %: the line is 100 mm long."
    return Sheet(width, side_mm + 2 * rim + FOOT_MM, tuple(black), words)


def _book(dictionary: str) -> Any:
    known = getattr(cv2.aruco, dictionary, None) if dictionary.startswith("DICT_") else None
    if known is None:
        raise ValueError(f"expected a dictionary such as DICT_5X5_1000, got {dictionary[:40]!r}")
    return cv2.aruco.getPredefinedDictionary(known)


def _white_squares(board: Board) -> list[tuple[int, int]]:
    """The white squares as (row, column), in the order of the markers in them; the top left one is black."""
    every = ((row, column) for row in range(board.rows) for column in range(board.columns))
    return [(row, column) for row, column in every if (row + column) % 2 == 1]


def _marker(book: Any, marker: int, corner: tuple[float, float], side: float) -> Iterator[Rectangle]:
    """The black modules of a marker, those side by side as one."""
    modules = int(book.markerSize) + 2
    bits = np.asarray(cv2.aruco.generateImageMarker(book, marker, modules), np.uint8)
    step = side / modules
    for row in range(modules):
        edges = np.flatnonzero(np.diff(np.concatenate(([0], (bits[row] == 0).astype(int), [0]))))
        for start, end in edges.reshape(-1, 2).tolist():
            yield corner[0] + start * step, corner[1] + row * step, (end - start) * step, step


def pdf(sheets: Sequence[Sheet]) -> bytes:
    """A page for each sheet, of its size."""
    kids = " ".join(f"{4 + 2 * index} 0 R" for index in range(len(sheets)))
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        f"<< /Type /Pages /Count {len(sheets)} /Kids [{kids}] >>".encode(),
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    for index, sheet in enumerate(sheets):
        box = f"[0 0 {POINTS * sheet.width:.4f} {POINTS * sheet.height:.4f}]"
        fonts = "/Resources << /Font << /F1 3 0 R >> >>"
        page = f"<< /Type /Page /Parent 2 0 R /MediaBox {box} {fonts} /Contents {5 + 2 * index} 0 R >>"
        content = _content(sheet)
        objects += [page.encode(), b"<< /Length %d >>\nstream\n%s\nendstream" % (len(content), content)]
    return _file(objects)


def _content(sheet: Sheet) -> bytes:
    lines = ["0 g"]
    for left, top, width, height in sheet.all_black:
        numbers = (left, sheet.height - top - height, width, height)
        lines.append(" ".join(f"{POINTS * number:.4f}" for number in numbers) + " re f")
    size, x, y = POINTS * TEXT_MM, POINTS * RIM_MM, POINTS * (FOOT_MM - 4 - 3 - TEXT_MM)
    lines.append(f"BT /F1 {size:.2f} Tf {x:.2f} {y:.2f} Td ({sheet.words}) Tj ET")
    return "\n".join(lines).encode("ascii")


def _file(objects: Sequence[bytes]) -> bytes:
    out, places = b"%PDF-1.4\n", []
    for number, content in enumerate(objects, start=1):
        places.append(len(out))
        out += b"%d 0 obj\n%s\nendobj\n" % (number, content)
    table = b"".join(b"%010d 00000 n \n" % place for place in places)
    head = b"xref\n0 %d\n0000000000 65535 f \n" % (len(objects) + 1)
    end = b"trailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (len(objects) + 1, len(out))
    return out + head + table + end


def png(sheet: Sheet, dpi: int = 600) -> bytes:
    """The sheet as a picture; its words are in the PDF only."""
    scale = dpi / 25.4
    image = np.full((round(sheet.height * scale), round(sheet.width * scale)), 255, np.uint8)
    for left, top, width, height in sheet.all_black:
        x0, y0, x1, y1 = (round(edge * scale) for edge in (left, top, left + width, top + height))
        image[y0:y1, x0:x1] = 0
    _, data = cv2.imencode(".png", image)
    plain = data.tobytes()
    per_metre = round(dpi / 0.0254)
    chunk = b"pHYs" + struct.pack(">IIB", per_metre, per_metre, 1)
    resolution = struct.pack(">I", 9) + chunk + struct.pack(">I", zlib.crc32(chunk))
    head = 8 + 25  # the signature and the header come first
    return plain[:head] + resolution + plain[head:]
