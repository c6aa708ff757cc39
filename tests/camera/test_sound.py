"""Sound: the tables of G.711, WAV files of every kind, and rates."""

from __future__ import annotations

import io
import struct
import wave
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.camera.sound import g711, wav


def tone(hz: float, rate: int, seconds: float = 1.0) -> wav.Sound:
    return 0.5 * np.sin(2 * np.pi * hz * np.arange(int(rate * seconds)) / rate)


def riff(kind: int, bits: int, rate: int, channels: int, data: bytes, *, extensible: bool = False) -> bytes:
    frame = channels * bits // 8
    form = struct.pack("<HHIIHH", 0xFFFE if extensible else kind, channels, rate, rate * frame, frame, bits)
    if extensible:
        form += struct.pack("<HHIH", 22, bits, 0, kind) + b"\0\0\0\0\x10\0\x80\0\0\xaa\0\x38\x9b\x71"
    chunks = b"fmt " + struct.pack("<I", len(form)) + form + b"LIST" + struct.pack("<I", 3) + b"abc\0"
    chunks += b"data" + struct.pack("<I", len(data)) + data
    return b"RIFF" + struct.pack("<I", 4 + len(chunks)) + b"WAVE" + chunks


@pytest.mark.parametrize(("code", "value"), [(0xD5, 8), (0x55, -8), (0xAA, 32256), (0x2A, -32256), (0x80, 5504)])
def test_the_a_law_table_is_that_of_the_standard(code: int, value: int) -> None:
    assert g711.A_LAW[code] == value


@pytest.mark.parametrize(("code", "value"), [(0xFF, 0), (0x80, 32124), (0x00, -32124)])
def test_the_mu_law_table_is_that_of_the_standard(code: int, value: int) -> None:
    assert g711.MU_LAW[code] == value


def test_every_a_law_byte_survives_the_way_there_and_back() -> None:
    every = bytes(range(256))
    assert g711.encode(g711.decode(every)) == every


@given(st.integers(-32768, 32767))
def test_a_sample_is_kept_to_a_few_percent(sample: int) -> None:
    (kept,) = g711.decode(g711.encode(np.array([sample], np.int16)))
    assert abs(int(kept) - sample) <= max(16, 0.04 * abs(sample))


def encoded(sound: wav.Sound, kind: int, bits: int) -> bytes:
    if kind == wav.FLOAT:
        return sound.astype(f"<f{bits // 8}").tobytes()
    if kind in (wav.A_LAW, wav.MU_LAW):
        table = g711.A_LAW if kind == wav.A_LAW else g711.MU_LAW
        samples = sound[:, None] * 32768
        return np.abs(table[None, :] - samples).argmin(axis=1).astype(np.uint8).tobytes()
    if bits == 8:
        return np.rint(sound * 127 + 128).astype(np.uint8).tobytes()
    whole = np.rint(sound * (2 ** (bits - 1) - 1)).astype("<i4")
    return whole.view(np.uint8).reshape(-1, 4)[:, : bits // 8].tobytes()


@pytest.mark.parametrize(
    ("kind", "bits"),
    [(1, 8), (1, 16), (1, 24), (1, 32), (3, 32), (3, 64), (6, 8), (7, 8)],
)
@pytest.mark.parametrize("extensible", [False, True])
@pytest.mark.parametrize("channels", [1, 2])
def test_every_kind_of_wav_is_read(kind: int, bits: int, extensible: bool, channels: int) -> None:
    sound = tone(440, 8000, 0.1)
    file = riff(kind, bits, 8000, channels, encoded(np.repeat(sound, channels), kind, bits), extensible=extensible)
    read, rate = wav.read(file)
    assert rate == 8000
    assert np.abs(read - sound).max() < (0.03 if bits == 8 else 0.001)


@pytest.mark.parametrize(
    ("file", "why"),
    [
        (b"", "no WAV"),
        (b"ID3 an mp3", "no WAV"),
        (riff(85, 16, 8000, 1, b""), "format 85"),
        (riff(1, 12, 8000, 1, b""), "12 bits"),
        (riff(1, 16, 8000, 0, b""), "0 channels"),
        (riff(1, 16, 0, 1, b""), "at 0 Hz"),
        (riff(1, 16, 8000, 1, b"")[:20], "cut short"),
        (riff(1, 16, 8000, 1, b"")[:12], "no sound"),
    ],
)
def test_what_is_no_wav_is_refused_with_the_reason(file: bytes, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        wav.read(file)


@given(st.binary(max_size=200))
def test_no_file_breaks_the_reader(rubbish: bytes) -> None:
    for file in (rubbish, b"RIFF\0\0\0\0WAVE" + rubbish, riff(1, 16, 8000, 1, rubbish)[: 20 + len(rubbish)]):
        with suppress(ValueError):
            sound, _ = wav.read(file)
            assert np.isfinite(sound).all()


def test_an_unfinished_file_gives_what_is_there() -> None:
    whole = riff(1, 16, 8000, 1, encoded(tone(440, 8000), 1, 16))
    sound, _ = wav.read(whole[: len(whole) // 2])
    assert 3900 < len(sound) < 4000


def test_what_we_write_is_read_by_python_itself() -> None:
    samples = wav.to_samples(tone(440, 8000))
    with wave.open(io.BytesIO(wav.write(samples))) as file:
        assert (file.getnchannels(), file.getsampwidth(), file.getframerate(), file.getnframes()) == (1, 2, 8000, 8000)
        assert file.readframes(8000) == samples.tobytes()


@pytest.mark.parametrize("rate", [11025, 16000, 22050, 32000, 44100, 48000, 96000, 6000, 44101])
@pytest.mark.parametrize("hz", [100, 1000, 2400])
def test_a_tone_keeps_its_height_strength_and_length_at_another_rate(rate: int, hz: float) -> None:
    there = wav.resampled(tone(hz, rate), rate)
    assert abs(len(there) - 8000) <= 1
    middle = slice(500, 7500)
    assert np.abs(there[middle] - tone(hz, 8000, 1.1)[middle]).max() < 0.005


@pytest.mark.parametrize("hz", [4400, 6000, 10000, 20000])
def test_what_8_khz_cannot_hold_does_not_come_back_as_another_tone(hz: float) -> None:
    there = wav.resampled(tone(hz, 48000), 48000)
    assert np.abs(there[500:7500]).max() < 0.002
