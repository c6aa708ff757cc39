"""Pictures and floor plans as ROS wants them, without ROS."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from services import document
from services.bridge.images import Intrinsics, image, size
from services.bridge.mapfile import load
from services.bridge.multipart import Multipart
from services.errors import BadMessage, ConfigError
from services.vision.zoom import WIDEST, Level, Magnification
from tests.bridge.test_service import CONFIG

HEADER = {"stamp": 1.0, "frame_id": "ip1_optical_frame"}


def jpeg(width: int, height: int, progressive: int = 0) -> bytes:
    pixels = np.random.default_rng(1).integers(0, 255, (height, width, 3), np.uint8)
    return bytes(cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_PROGRESSIVE, progressive])[1])


def part(data: bytes, stamp: str = "") -> bytes:
    return b"--picture\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n%b\r\n%b\r\n" % (
        len(data),
        stamp.encode(),
        data,
    )


@pytest.mark.parametrize("progressive", [0, 1])
@pytest.mark.parametrize(("width", "height"), [(640, 360), (1152, 648), (17, 3)])
def test_the_size_is_read_without_decoding(width: int, height: int, progressive: int) -> None:
    assert size(jpeg(width, height, progressive)) == (width, height)


@pytest.mark.parametrize("data", [b"", b"\xff\xd8", b"\xff\xd8\xff\xda" + bytes(20), b"GIF89a" + bytes(40)])
def test_what_is_no_jpeg_is_told(data: bytes) -> None:
    with pytest.raises(BadMessage, match="expected a JPEG"):
        size(data)
    with pytest.raises(BadMessage, match="expected a JPEG"):
        image(data, HEADER)


@pytest.mark.parametrize("step", [1, 7, 1000, 10**6])
def test_a_stream_is_taken_apart_however_it_comes(step: int) -> None:
    first, second = jpeg(64, 48), b"\r\n\r\n" * 9
    data = part(first, "X-Timestamp: 12.500\r\n") + part(second)
    parts, found = Multipart(), []
    for at in range(0, len(data), step):
        found += parts.feed(data[at : at + step])
    assert [(one.jpeg, one.stamp) for one in found] == [(first, 12.5), (second, None)]


@pytest.mark.parametrize(
    "data",
    [
        b"x" * 5000,
        b"--picture\r\n\r\n",
        b"--picture\r\nContent-Length: 0\r\n\r\n",
        b"a\r\nContent-Length: 99999999\r\n\r\n",
    ],
)
def test_another_stream_is_told(data: bytes) -> None:
    with pytest.raises(BadMessage, match="expected the"):
        list(Multipart().feed(data))


def test_the_lens_is_scaled_to_the_picture_that_comes() -> None:
    lens = Intrinsics(document.read(CONFIG / "ip1" / "ost.yaml").value)
    info = lens.info(576, 324, 0.0, HEADER)
    assert (info["width"], info["height"], info["header"]) == (576, 324, HEADER)
    assert info["K"][0] == pytest.approx(579.2 / 2)
    assert info["K"][2] == pytest.approx((573.35 + 0.5) / 2 - 0.5)
    assert info["P"][:3] == info["K"][:3]
    assert (info["distortion_model"], len(info["D"]), len(info["P"])) == ("plumb_bob", 5, 12)


def test_a_zoomed_lens_is_known_between_the_levels_that_were_calibrated() -> None:
    levels = (Level(0.0, WIDEST), Level(4.0, Magnification(2.0, 0.001, 0.01, 0.0)))
    lens = Intrinsics(document.read(CONFIG / "ip1" / "ost.yaml").value, levels)
    wide, zoomed = (lens.info(1152, 648, zoom, HEADER) for zoom in (0.0, 4.0))
    middle = (1152 - 1) / 2
    assert zoomed["K"][0] == pytest.approx(2 * wide["K"][0])
    assert zoomed["K"][2] == pytest.approx(2 * (wide["K"][2] - middle) + middle + 0.01 * 1152)
    assert (zoomed["P"][:3], zoomed["D"]) == (zoomed["K"][:3], wide["D"])
    assert lens.info(1152, 648, 2.0, HEADER)["K"][0] == pytest.approx(1.5 * wide["K"][0])
    assert "K" not in lens.info(1152, 648, 6.0, HEADER)


@pytest.mark.parametrize(("width", "height", "zoom"), [(640, 480, 0.0), (1152, 648, 2.0)])
def test_where_the_calibration_does_not_hold_there_is_none(width: int, height: int, zoom: float) -> None:
    lens = Intrinsics(document.read(CONFIG / "ip1" / "ost.yaml").value)
    assert lens.info(width, height, zoom, HEADER) == {"header": HEADER, "width": width, "height": height}


@pytest.mark.parametrize(
    ("more", "cells"),
    [
        ("", [0, 0, 100, 100, 0, -1]),
        ("negate: 1\n", [100, 100, 0, 0, 100, 100]),
        ("mode: scale\n", [0, 0, 100, 100, 0, 1]),
        ("mode: raw\n", [-1, -1, 0, 0, -1, -1]),
    ],
)
def test_a_floor_plan_is_read_as_map_server_would(tmp_path: Path, more: str, cells: list[int]) -> None:
    (tmp_path / "flat.pgm").write_bytes(b"P5\n3 2\n255\n" + bytes([0, 254, 205, 254, 254, 0]))
    (tmp_path / "flat.yaml").write_text(f"image: flat.pgm\nresolution: 0.05\norigin: [-1, -2, 0]\n{more}")
    grid = load(tmp_path / "flat.yaml")
    assert grid["data"] == cells
    assert (grid["info"]["width"], grid["info"]["height"], grid["info"]["resolution"]) == (3, 2, 0.05)
    assert grid["info"]["origin"]["position"] == {"x": -1.0, "y": -2.0, "z": 0.0}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("image: none.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n", r"flat.yaml:1: image: expected a picture"),
        ("image: x\nresolution: 0\norigin: [0, 0, 0]\n", r"flat.yaml:2: resolution: expected"),
        ("image: x\nresolution: 1\norigin: [0, 0]\n", r"flat.yaml:3: origin"),
        ("nothing: 1\n", r"flat.yaml:1: "),
    ],
)
def test_a_faulty_floor_plan_is_told_with_its_line(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "flat.yaml").write_text(text)
    with pytest.raises(ConfigError, match=told):
        load(tmp_path / "flat.yaml")
