"""G.711 as cameras speak it: one byte for each of 8000 samples a second, A-law or mu-law. Tables, both ways. Pure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

RATE = 8000  # samples, and bytes, per second
Samples = NDArray[np.int16]


def _a_law(code: int) -> int:
    """One byte as a 16-bit sample (ITU-T G.711: even bits inverted, 3 bits of exponent, 4 of mantissa)."""
    flipped = code ^ 0x55
    exponent, value = (flipped & 0x70) >> 4, ((flipped & 0x0F) << 4) + 8
    value = value if exponent == 0 else (value + 0x100) << (exponent - 1)
    return value if flipped & 0x80 else -value


def _mu_law(code: int) -> int:
    """The same for mu-law (all bits inverted, a bias of 132)."""
    flipped = ~code & 0xFF
    value = ((((flipped & 0x0F) << 3) + 132) << ((flipped & 0x70) >> 4)) - 132
    return -value if flipped & 0x80 else value


A_LAW = np.array([_a_law(code) for code in range(256)], np.int16)
MU_LAW = np.array([_mu_law(code) for code in range(256)], np.int16)
_ORDER = np.argsort(A_LAW, kind="stable")
_MIDDLES = (A_LAW[_ORDER][1:].astype(np.int32) + A_LAW[_ORDER][:-1]) / 2


def decode(data: bytes, table: Samples = A_LAW) -> Samples:
    """Bytes to 16-bit samples."""
    return table[np.frombuffer(data, np.uint8)]


def encode(samples: Samples) -> bytes:
    """16-bit samples to A-law: to each the byte that comes nearest."""
    return _ORDER[np.searchsorted(_MIDDLES, samples)].astype(np.uint8).tobytes()
