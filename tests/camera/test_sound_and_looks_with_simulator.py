"""Sound, privacy, video modes and the clock by orders, on the simulated camera: the effect there, and the answers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from services.camera.sound import g711, wav
from services.simulators import camera as simulated
from tests.camera.bench import Bench, bench, simulator

WAIT_S = 20.0


@pytest.fixture(params=["ip3m-941w-2019", "ip2m-841b-strict", "2020s-dahua"])
def camera(request: pytest.FixtureRequest) -> Iterator[simulated.Simulated]:
    with simulator(latency_s=0.02, profile=request.param) as running:
        yield running


@pytest.fixture
def here(tmp_path: Path, camera: simulated.Simulated) -> Iterator[Bench]:
    with bench(tmp_path, camera) as running:
        yield running


def done(here: Bench, key: str, value: str, number: int = 1) -> dict[str, Any]:
    here.order(key, value, str(number))
    return here.end_of(str(number), WAIT_S)


def table(here: Bench, key: str) -> str:
    return here.camera.server.device.tables.text(key)


def test_a_recording_holds_the_microphones_tone(here: Bench, tmp_path: Path) -> None:
    here.tell("tone", hertz=1234.0)
    assert done(here, "AudioRec", "1.5")["state"] == "done"
    (told,) = here.payloads("audio")
    file = tmp_path / "audio" / told["file"]
    assert (told["seconds"], told["bytes"]) == (1.5, file.stat().st_size)
    sound, rate = wav.read(file.read_bytes())
    assert (rate, len(sound)) == (8000, 12000)
    spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound))))
    assert abs(np.argmax(spectrum) * rate / len(sound) - 1234.0) < 2.0
    assert spectrum.max() > 20 * np.median(spectrum)


def test_what_is_played_arrives_at_the_loudspeaker(here: Bench, tmp_path: Path) -> None:
    at = np.arange(int(1.5 * 44100)) / 44100
    sweep = 0.6 * np.sin(2 * np.pi * (300 * at + 400 * at**2))
    (tmp_path / "audio").mkdir()
    (tmp_path / "audio" / "doorbell.wav").write_bytes(wav.write(wav.to_samples(sweep), 44100))
    assert done(here, "AudioPlay", "doorbell.wav")["state"] == "done"
    (played,) = httpx.get(f"{here.camera.side_door_url}/played", timeout=30).json()
    assert abs(played["seconds"] - 1.5) < 0.01
    heard, rate = wav.read(httpx.get(f"{here.camera.side_door_url}/played.wav", timeout=30).content)
    wanted = wav.resampled(sweep, 44100)
    assert rate == g711.RATE
    assert len(heard) == len(wanted)
    assert np.corrcoef(heard, wanted)[0, 1] > 0.999


def test_the_scan_mode_is_set_and_left_again(here: Bench) -> None:
    assert done(here, "VideoMode", "scan")["state"] == "done"
    assert table(here, "VideoColor[0][0].Contrast") == "80"
    assert done(here, "VideoMode", "color", 2)["state"] == "done"
    assert table(here, "VideoColor[0][0].Contrast") == "50"


def test_privacy_is_switched_where_there_is_one_and_refused_elsewhere(here: Bench) -> None:
    end = done(here, "Privacy", "ON")
    if here.camera.server.device.tables.read("LeLensMask"):
        assert (end["state"], table(here, "LeLensMask[0].Enable")) == ("done", "true")
        assert done(here, "Privacy", "OFF", 2)["state"] == "done"
        assert table(here, "LeLensMask[0].Enable") == "false"
    else:
        assert end["state"] == "refused"
        assert "privacy" in end["error"]


def test_a_clock_that_is_wrong_is_set_and_the_card_is_told(tmp_path: Path, camera: simulated.Simulated) -> None:
    httpx.post(f"{camera.side_door_url}/clock", json={"offset_s": -5000}, timeout=30).raise_for_status()
    httpx.post(f"{camera.side_door_url}/card", json={"in": True}, timeout=30).raise_for_status()
    with bench(tmp_path, camera) as here:
        facts = here.service.bulletin.facts
        here.until(lambda: {"time_drift_s", "storage"} <= set(facts.values), WAIT_S)
        assert abs(float(facts.values["time_drift_s"])) < 2.0
        assert facts.values["storage"] != "none"


def test_motion_before_the_lens_is_told(here: Bench) -> None:
    here.until(lambda: here.payloads("motion") != [], WAIT_S)
    here.tell("stir", seconds=1.0)
    here.until(lambda: here.payloads("motion")[-1]["value"] == 1, WAIT_S)


def test_the_diagnostics_have_the_reports_set(here: Bench) -> None:
    def values() -> dict[str, str]:
        said = [one for one in here.said if one.topic == "diagnostics/camera/ip1"]
        found: dict[str, str] = json.loads(said[-1].payload)["values"] if said else {}
        return found

    wanted = {"http_latency_ms", "request_queue", "stream", "alarm", "storage", "firmware", "time_drift_s"}
    here.until(lambda: wanted <= set(values()), WAIT_S)
