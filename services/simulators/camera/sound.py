"""What the simulated microphone hears and the speaker was given, and G.711 A-law, in which both travel. No network.

The microphone hears one tone and a little noise. The noise is the same at the same moment for everybody who listens.
"""

from __future__ import annotations

import io
import wave
from dataclasses import dataclass, field
from threading import Lock

import numpy as np
from numpy.typing import NDArray

RATE = 8000  # samples a second; one byte each
CODEC = "G.711A"
LOUDNESS, NOISE = 8000.0, 150.0  # of 32767: the tone's amplitude, one sigma
KEPT = 8  # recordings of the speaker

Samples = NDArray[np.int16]


def encode(samples: Samples) -> bytes:
    """PCM to A-law (ITU-T G.711): sign, segment, four bits of the mantissa, every other bit inverted."""
    positive = samples >= 0
    size = np.where(positive, samples.astype(np.int32), -samples.astype(np.int32) - 1) >> 3
    segment = np.maximum(np.floor(np.log2(np.maximum(size, 1))).astype(np.int32) - 4, 0)
    mantissa = size >> np.maximum(segment, 1) & 15
    codes: NDArray[np.uint8] = ((segment << 4 | mantissa) ^ np.where(positive, 0xD5, 0x55)).astype(np.uint8)
    return codes.tobytes()


def decode(data: bytes) -> Samples:
    """A-law to PCM, the middle of each step."""
    codes = np.frombuffer(data, np.uint8).astype(np.int32) ^ 0x55
    segment, mantissa = codes >> 4 & 7, codes & 15
    size = np.where(segment == 0, (mantissa << 4) + 8, ((mantissa << 4) + 0x108) << np.maximum(segment - 1, 0))
    return np.where(codes & 0x80, size, -size).astype(np.int16)


class Microphone:
    """`hertz` may be changed while somebody listens."""

    def __init__(self, seed: int) -> None:
        self.hertz = 440.0
        rng = np.random.default_rng(seed)
        self._noise = rng.normal(0.0, NOISE, RATE)

    def hears(self, first: int, count: int) -> bytes:
        """A-law of `count` samples from the `first` since 1970."""
        at = first + np.arange(count)
        tone = LOUDNESS * np.sin(2.0 * np.pi * ((self.hertz / RATE * at) % 1.0))
        return encode((tone + self._noise[at % RATE]).round().astype(np.int16))


@dataclass
class Played:
    """What came from one sender, as it came: when the first and the last byte did, and the longest pause between."""

    content_type: str
    data: bytearray = field(default_factory=bytearray)
    began: float = 0.0
    ended: float = 0.0
    pause_s: float = 0.0

    def hear(self, data: bytes, now: float) -> None:
        """More of it."""
        if self.data:
            self.pause_s = max(self.pause_s, now - self.ended)
        else:
            self.began = now
        self.data += data
        self.ended = now

    @property
    def told(self) -> dict[str, object]:
        """For the side door: how long it sounds and how long it took to come."""
        came = {"bytes": len(self.data), "seconds": len(self.data) / RATE, "took_s": self.ended - self.began}
        return {"content_type": self.content_type, **came, "pause_s": self.pause_s}


class Speaker:
    """Keeps what it was given. For several threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self.played: list[Played] = []

    def begin(self, content_type: str) -> Played:
        """A new sender."""
        with self._lock:
            self.played = [*self.played[1 - KEPT :], Played(content_type)]
            return self.played[-1]


def wav(data: bytes) -> bytes:
    """A-law as a WAV file: one channel, 16 bit."""
    file = io.BytesIO()
    with wave.open(file, "wb") as writer:
        writer.setnchannels(1)
        writer.setsampwidth(2)
        writer.setframerate(RATE)
        writer.writeframes(decode(data).astype("<i2").tobytes())
    return file.getvalue()
