"""A robot's map as a picture that lies under the plan: what is occupied is dark, the rest lets the page show through.

Pure: PNG (ISO/IEC 15948) with grey and opacity needs no more than zlib.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

from services.apartment.floor import OCCUPIED, Grid

GREY = 110


def picture(grid: Grid) -> bytes:
    """The PNG, top row first; a cell that is not quite occupied is so much fainter."""
    rows, columns = grid.cells.shape
    pixels = np.zeros((rows, columns, 2), np.uint8)
    pixels[..., 0] = GREY
    pixels[..., 1] = np.clip(grid.cells[::-1], 0, OCCUPIED) * 255.0 / OCCUPIED
    lines = b"".join(b"\0" + row.tobytes() for row in pixels)
    head = struct.pack(">IIBBBBB", columns, rows, 8, 4, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", head) + _chunk(b"IDAT", zlib.compress(lines, 9)) + _chunk(b"IEND", b"")
    )


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
