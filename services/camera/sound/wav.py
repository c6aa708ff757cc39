"""WAV files: any in, 16-bit mono at 8 kHz out. Pure: bytes and arrays.

Python's own module reads neither the extensible header, which most programs write for 24 bits, nor numbers with a
point; and it has no sound rates.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from math import gcd

import numpy as np
from numpy.typing import NDArray

from services.camera.sound import g711

Sound = NDArray[np.float64]

PCM, FLOAT, A_LAW, MU_LAW, EXTENSIBLE = 1, 3, 6, 7, 0xFFFE
CROSSINGS = 24  # of the filter on each side: the longer, the steeper it is
PASSED = 0.92  # of what the lower rate can hold; the rest is the filter's slope
KAISER = 8.0  # what must not pass is 80 dB lower


@dataclass(frozen=True)
class Form:
    """What a file's header says."""

    kind: int
    channels: int
    rate: int
    bits: int

    @property
    def frame(self) -> int:
        """Bytes of one moment, all channels."""
        return self.channels * self.bits // 8


def write(samples: g711.Samples, rate: int = g711.RATE) -> bytes:
    """A file of 16-bit mono."""
    data = samples.astype("<i2").tobytes()
    form = struct.pack("<HHIIHH", PCM, 1, rate, 2 * rate, 2, 16)
    return b"RIFF" + struct.pack("<I", 36 + len(data)) + b"WAVEfmt " + struct.pack("<I", 16) + form + \
        b"data" + struct.pack("<I", len(data)) + data  # fmt: skip


def read(file: bytes) -> tuple[Sound, int]:
    """Its sound in mono, -1 to 1, and its rate. ValueError says what is wrong with it."""
    if file[:4] not in (b"RIFF", b"RIFX") or file[8:12] != b"WAVE" or file[:4] == b"RIFX":
        raise ValueError("it is no WAV file")
    form: Form | None = None
    for name, start, size in _chunks(file):
        if name == b"fmt ":
            form = _form(file[start : start + size])
        elif name == b"data":
            if form is None:
                raise ValueError("its data come before its format")
            return _mono(file[start : start + size], form), form.rate
    raise ValueError("it holds no sound")


def _chunks(file: bytes) -> list[tuple[bytes, int, int]]:
    """Name, beginning and size of each part; a size beyond the end of the file (an unfinished one) is cut."""
    found, at = [], 12
    while at + 8 <= len(file):
        name, size = file[at : at + 4], int.from_bytes(file[at + 4 : at + 8], "little")
        size = min(size, len(file) - at - 8)
        found.append((name, at + 8, size))
        at += 8 + size + size % 2
    return found


def _form(data: bytes) -> Form:
    if len(data) < 16:
        raise ValueError("its header is cut short")
    kind, channels, rate, _, _, bits = struct.unpack("<HHIIHH", data[:16])
    if kind == EXTENSIBLE and len(data) >= 26:
        kind = int.from_bytes(data[24:26], "little")
    known = {PCM: (8, 16, 24, 32), FLOAT: (32, 64), A_LAW: (8,), MU_LAW: (8,)}
    if bits not in known.get(kind, ()):
        raise ValueError(f"format {kind} with {bits} bits is not known")
    if not 1 <= channels <= 32 or not 1000 <= rate <= 400_000:
        raise ValueError(f"{channels} channels at {rate} Hz make no sense")
    return Form(kind, channels, rate, bits)


def _mono(data: bytes, form: Form) -> Sound:
    data = data[: len(data) - len(data) % form.frame]
    return np.asarray(_numbers(data, form).reshape(-1, form.channels).mean(axis=1), float)


def _numbers(data: bytes, form: Form) -> Sound:
    if form.kind == FLOAT:
        return np.asarray(np.nan_to_num(np.frombuffer(data, f"<f{form.bits // 8}")).clip(-1, 1), float)
    if form.kind in (A_LAW, MU_LAW):
        return g711.decode(data, g711.A_LAW if form.kind == A_LAW else g711.MU_LAW) / 32768
    if form.bits == 8:
        return (np.frombuffer(data, np.uint8).astype(float) - 128) / 128
    if form.bits == 24:
        wide = np.zeros((len(data) // 3, 4), np.uint8)
        wide[:, 1:] = np.frombuffer(data, np.uint8).reshape(-1, 3)
        return wide.view("<i4").ravel() / 2.0**31
    return np.frombuffer(data, f"<i{form.bits // 8}") / 2.0 ** (form.bits - 1)


def resampled(sound: Sound, rate: int, to: int = g711.RATE) -> Sound:
    """The sound at another rate; what the lower of the two rates cannot hold is filtered out first."""
    if rate == to or not len(sound):
        return sound
    up, down = to // gcd(rate, to), rate // gcd(rate, to)
    low = min(1.0, to / rate) * PASSED
    half = int(np.ceil(CROSSINGS / low))
    filters = _filters(up, half, low)
    places = np.arange(-(-len(sound) * up // down)) * down
    first, phase = places // up, places % up
    padded = np.concatenate([np.zeros(half - 1), sound, np.zeros(half + 1)])
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half)
    pieces = [slice(at, at + to) for at in range(0, len(places), to)]  # a second at a time: memory
    return np.concatenate([np.einsum("ij,ij->i", windows[first[one]], filters[phase[one]]) for one in pieces])


def _filters(up: int, half: int, low: float) -> Sound:
    """For each of `up` places between two samples, the weights of the 2 * `half` samples around it."""
    distance = np.arange(1 - half, half + 1)[None, :] - (np.arange(up) / up)[:, None]
    window = np.i0(KAISER * np.sqrt(np.clip(1 - (distance / half) ** 2, 0, None))) / np.i0(KAISER)
    weights = low * np.sinc(low * distance) * window
    return np.asarray(weights / weights.sum(axis=1, keepdims=True), float)


def to_samples(sound: Sound) -> g711.Samples:
    """-1 to 1 as 16-bit samples."""
    return np.asarray(np.rint(sound.clip(-1, 1) * 32767), np.int16)
