"""Sound by orders on real parts: a recording of the microphone, and what of a file arrives at the loudspeaker.

The tests make each once for every firmware below, the soak many times.
"""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from typing import Any

import httpx
import numpy as np

from services.camera.sound import g711, wav
from tests.small_flat import SmallFlat

FIRMWARES = {"ip1": "ip3m-941w-2019", "strict": "ip2m-841b-strict", "new": "2020s-dahua"}
SPEAKING: dict[str, Any] = {"cameras": tuple(FIRMWARES), "firmware": FIRMWARES}
HERTZ = (300.0, 3000.0)
SECONDS = 1.5
FILE_RATE = 44100
CLEAR = 20  # times the median of the spectrum: a tone
WAIT_S = 30.0


def folder(flat: SmallFlat) -> Path:
    """Where recordings are, and what can be played."""
    return flat.config.parent / "audio"


def strongest(sound: wav.Sound, rate: int) -> float:
    """The tone of a sound, hertz; AssertionError when there is none."""
    spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound))))
    assert spectrum.max() > CLEAR * np.median(spectrum)
    return float(np.argmax(spectrum) * rate / len(sound))


def record(flat: SmallFlat, rng: Random, camera: str) -> float:
    """The microphone gives a tone: how far that of the recording is from it, hertz. It is as long as was ordered."""
    hertz = rng.uniform(*HERTZ)
    flat.doors[camera].tell("tone", hertz=hertz)
    with flat.client(f"camera/{camera}/#") as bus:
        ended = bus.order(camera, "AudioRec", str(SECONDS), WAIT_S)
        assert ended.state == "done", ended
        told = json.loads(bus.until(lambda message: message.topic == f"camera/{camera}/audio").payload)
    file = folder(flat) / told["file"]
    assert (told["seconds"], told["bytes"]) == (SECONDS, file.stat().st_size)
    sound, rate = wav.read(file.read_bytes())
    assert (rate, len(sound)) == (g711.RATE, round(SECONDS * g711.RATE))
    return abs(strongest(sound, rate) - hertz)


def play(flat: SmallFlat, rng: Random, camera: str) -> float:
    """A rising tone is played: how like it is what the loudspeaker gave, in percent (correlation). It is as long."""
    at = np.arange(round(SECONDS * FILE_RATE)) / FILE_RATE
    sweep = 0.6 * np.sin(2 * np.pi * (rng.uniform(200, 400) * at + 400 * at**2))
    folder(flat).mkdir(exist_ok=True)
    (folder(flat) / "doorbell.wav").write_bytes(wav.write(wav.to_samples(sweep), FILE_RATE))
    door, count = flat.doors[camera], len(played(flat, camera))
    with flat.client(f"camera/{camera}/#") as bus:
        ended = bus.order(camera, "AudioPlay", "doorbell.wav", WAIT_S)
        assert ended.state == "done", ended
    (new,) = played(flat, camera)[count:]
    assert abs(new["seconds"] - SECONDS) < 0.01
    heard, rate = wav.read(httpx.get(f"{door.url}/played.wav", timeout=30).raise_for_status().content)
    wanted = wav.resampled(sweep, FILE_RATE)
    assert (rate, len(heard)) == (g711.RATE, len(wanted))
    return float(100 * np.corrcoef(heard, wanted)[0, 1])


def played(flat: SmallFlat, camera: str) -> list[dict[str, Any]]:
    """All that the loudspeaker has given."""
    found: list[dict[str, Any]] = httpx.get(f"{flat.doors[camera].url}/played", timeout=30).json()
    return found
