"""The moving picture from the simulated camera's own RTSP server: the fault list, a new password, and a scan."""

from __future__ import annotations

import time
from collections.abc import Iterator
from math import dist
from pathlib import Path
from typing import Any

import httpx
import pytest

from services import payloads
from services.camera.video import pictures
from services.simulators import camera as simulated
from tests.camera.bench import Bench, bench, simulator
from tests.camera.video.test_stream import address, diagnostic, first_picture, stream, turning

pytest.importorskip("gi", reason="apt-get install python3-gi gir1.2-gst-rtsp-server-1.0 gstreamer1.0-plugins-ugly")
pytestmark = pytest.mark.rtsp


@pytest.fixture
def camera() -> Iterator[simulated.Simulated]:
    with simulator() as running:
        yield running


def seeing(folder: Path, camera: simulated.Simulated, **changes: Any) -> Any:
    return bench(folder, camera, rtsp_port=camera.rtsp_port, **changes)


def switch_on(here: Bench) -> None:
    here.order("RTSP", "ON", "on")
    assert here.end_of("on", 30)["state"] == "done"
    here.until(lambda: diagnostic(here)["values"]["stream"] == "rtsp", 30)


def status(here: Bench) -> str:
    return str(here.payloads("status")[-1]["state"])


def test_the_cameras_stream_is_shown(tmp_path: Path, camera: simulated.Simulated) -> None:
    with seeing(tmp_path, camera) as here:
        switch_on(here)
        image = turning(here, lambda: first_picture(address(here, "RTSP")))
        assert image.shape[1] == 704
        snapshot = turning(
            here, lambda: httpx.get(stream(here)["url"].replace("stream.mjpg", "snapshot.jpg"), timeout=30)
        )
        assert pictures.decode(snapshot.content).shape == image.shape


def test_a_frozen_stream_is_told_within_15_s_and_recovers(tmp_path: Path, camera: simulated.Simulated) -> None:
    with seeing(tmp_path, camera) as here:
        switch_on(here)
        here.tell("fault", name="frozen_stream", on=True)
        here.until(lambda: status(here) == "degraded", 15)
        here.until(lambda: "no picture" in str(here.payloads("status")[-1]["reason"]), 30)
        here.tell("well")
        here.until(lambda: status(here) == "online" and diagnostic(here)["values"]["stream"] == "rtsp", 60)


def test_the_stream_comes_back_after_a_reboot(tmp_path: Path) -> None:
    with simulator(switches={"boot_s": 3.0}) as camera, seeing(tmp_path, camera) as here:
        switch_on(here)
        here.order("Reboot", "True", "again")
        assert here.end_of("again", 60)["state"] == "done"
        before = here.service.feed.channel.reader.flow.last
        here.until(lambda: here.service.feed.channel.reader.flow.last > max(before, time.time() - 2), 60)


def test_a_scan_of_the_stream_finds_the_marker_and_asks_for_no_snapshot(
    tmp_path: Path, camera: simulated.Simulated
) -> None:
    settings = {"source": "main"}
    video = "Encode[0].MainFormat[0].Video."  # an eighth of the work: a machine that is too slow for it takes snapshots
    camera.server.device.tables.write([(f"{video}Width", "1152"), (f"{video}Height", "648"), (f"{video}FPS", "5")])
    with seeing(tmp_path, camera, stream=settings, scan_pictures="stream", targets=[582]) as here:
        switch_on(here)  # with a snapshot, where the stream cannot be opened at once: that one is not the scan's
        ordered = time.time()
        here.order("Scan", {"places": ["Kitchen", "Living room"]}, "1")
        assert here.end_of("1", 200)["state"] == "done"
        results = [payloads.ScanResult.model_validate(one) for one in here.payloads("scan/result")]
        log = httpx.get(f"{camera.side_door_url}/log", timeout=30).json()
        truth = here.world.marker(582)
    (result,) = results
    assert result.position is not None
    assert dist((result.position.x, result.position.y, result.position.z), truth.position) < 0.10
    assert not [entry for entry in log if "snapshot.cgi" in entry["target"] and entry["time"] >= ordered]
    assert any(entry["time"] >= ordered for entry in log)


@pytest.mark.parametrize("broken", [b"", b"\xff\xd8\xff", b"no picture"])
def test_what_is_no_picture_is_not_taken_for_one(broken: bytes) -> None:
    with pytest.raises(pictures.Away):
        pictures.decode(broken)


def test_half_a_picture_is_none(camera: simulated.Simulated) -> None:
    whole = httpx.get(
        f"{camera.url}/cgi-bin/snapshot.cgi", auth=httpx.DigestAuth("ros", "secret123"), timeout=30
    ).content
    assert pictures.decode(whole + b"\0" * 100).shape == (1296, 2304, 3)
    with pytest.raises(pictures.Away):
        pictures.decode(whole[: len(whole) // 2])


def test_a_new_password_costs_three_failed_logins_at_most_with_the_stream_too(
    tmp_path: Path, camera: simulated.Simulated
) -> None:
    with seeing(tmp_path, camera, login_retry_s=6.0) as here:
        switch_on(here)
        before = here.truth()["door"]["wrong"]
        here.tell("fault", name="password")
        here.tell("drop")
        here.until(lambda: status(here) == "bad_login", 15)
        until = time.monotonic() + 3
        here.until(lambda: time.monotonic() > until, 10)
        assert 1 <= here.truth()["door"]["wrong"] - before <= 3
        here.tell("well")
        here.until(lambda: status(here) == "online", 60)
        here.until(lambda: diagnostic(here)["values"]["stream"] == "rtsp", 60)
