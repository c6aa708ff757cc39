"""The probe looks whether moving pictures come over RTSP, within the limits of logins, and writes down where."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml
from pydantic import SecretStr

from services.camera.probe import paper, show, video
from services.camera.probe.findings import Findings
from services.camera.probe.wire import Wire
from services.config import load
from services.peers import free_port
from services.simulators import camera as simulated
from tests.camera.bench import PASSWORD, SHIPPED, simulator
from tests.camera.video.parts import rtsp_camera


def looked(camera: simulated.Simulated) -> Findings:
    wire = Wire(camera.url, "ros", SecretStr(PASSWORD))
    found = Findings(camera.url)
    try:
        video.look(wire, found)
    finally:
        wire.close()
    return found


def settings(found: Findings, folder: Path) -> Any:
    """The written section as the configuration reads it."""
    file = folder / "apartment.yaml"
    file.write_text(f"home: {SHIPPED / 'home.yaml'}\n" + paper.section(found, "ip9", "ros"))
    return load(file, environment={"CAMERA_IP9_PASSWORD": PASSWORD}, deep=True).instances["camera-ip9"].config


def test_both_streams_are_seen_and_the_port_is_written(tmp_path: Path) -> None:
    pytest.importorskip("gi", reason="apt-get install python3-gi gir1.2-gst-rtsp-server-1.0")
    with simulator(latency_s=0) as camera:
        found = looked(camera)
        sizes = {name: camera.server.pictures.size(stream) for name, stream in
                 (("main", "MainFormat"), ("sub", "ExtraFormat"))}  # fmt: skip
        assert httpx.get(f"{camera.side_door_url}/state", timeout=30).json()["door"]["wrong"] == 0
    assert found.unknown == {}
    assert found.streams == {name: f"h264, {width} x {height}" for name, (width, height) in sizes.items()}
    assert settings(found, tmp_path).rtsp_port == found.rtsp_port == camera.rtsp_port
    assert show.streams(found).startswith(f"RTSP on port {camera.rtsp_port}: main h264, ")


def test_a_refused_login_is_not_tried_at_the_other_stream(tmp_path: Path) -> None:
    with rtsp_camera(password="changed") as rtsp, simulator(latency_s=0, rtsp_port=None) as camera:
        camera.server.device.tables.fix("RTSP.Port", str(rtsp.port))
        found = looked(camera)
    assert found.streams == {}
    assert "does not know this user and password" in found.unknown["sub stream"]
    assert "main stream" not in found.unknown
    assert "# no moving pictures over RTSP: the camera's stream does not know" in paper.section(found, "ip9", "ros")
    assert PASSWORD not in str(found.data())
    assert settings(found, tmp_path).rtsp_port == rtsp.port


def test_nobody_at_the_port_is_told() -> None:
    with simulator(latency_s=0, rtsp_port=None) as camera:
        camera.server.device.tables.fix("RTSP.Port", str(free_port()))
        found = looked(camera)
    assert found.streams == {}
    assert set(found.unknown) == {"main stream", "sub stream"}
    assert "RTSP on port" in show.streams(found)


def test_what_the_service_supposes_anyway_is_not_written(tmp_path: Path) -> None:
    found = Findings("http://192.0.2.10", rtsp_port=554, streams={"sub": "h264, 704 x 480", "main": "h264, 1280 x 720"})
    section = yaml.safe_load(paper.section(found, "ip9", "ros"))["cameras"]["ip9"]
    assert not {"rtsp_port", "stream"} & set(section)
    del found.streams["sub"]
    assert settings(found, tmp_path).stream.source == "main"
