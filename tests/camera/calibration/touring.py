"""A whole calibration of the mount in virtual time: five markers in the flat, each said to be a centimetre beside."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from services.payloads import Calibration, OrderResult
from services.virtual import VirtualApartment
from services.vision.frames import Mount
from tests.camera.calibration.showing import ordered, world_of
from tests.trials import virtual_flat

MORE = [
    {"id": 200, "size": 0.14, "position": [1.95, 0.45, 0.741], "where": "Desk", "place": "Desk"},
    {"id": 201, "size": 0.14, "position": [1.2, 3.35, 0.741], "where": "Dining table", "place": "Dining"},
    {"id": 202, "size": 0.14, "position": [4.75, 0.4, 0.012], "where": "Door mat", "place": "Hall"},
]
USED = (582, 17, 200, 201, 202)
TRUE = {"lean_deg": [0.6, -0.4], "tilt_zero_deg": 0.35, "sensor_roll_deg": -0.2}  # what nobody knows yet


@contextmanager
def crooked_flat(folder: Path) -> Iterator[VirtualApartment]:
    """The apartment with more markers, its camera hung a little crooked, its configuration not knowing that."""
    with virtual_flat(folder, _crooked) as flat:
        yield flat


def _crooked(config: Path) -> None:
    file = config.parent / "world.yaml"
    world = yaml.safe_load(file.read_text(encoding="utf-8"))
    world["markers"] += [{**one, "room": "Living" if one["id"] != 202 else "Hall"} for one in MORE]
    world["cameras"]["ip1"]["mount"].update(TRUE)
    file.write_text(yaml.safe_dump(world), encoding="utf-8")
    text = config.read_text(encoding="utf-8")
    config.write_text(text.replace("[3.05, 2.25, 2.60]", "[3.1, 2.2, 2.62]").replace("yaw_deg: 35.0", "yaw_deg: 32.0"))


def said_to_be(flat: VirtualApartment, rng: np.random.Generator, off_m: float = 0.01) -> dict[str, list[float]]:
    """Where somebody with a tape measure says that the markers are."""
    said = {}
    for marker in USED:
        way = rng.normal(size=3)
        place = np.array(world_of(flat).marker(marker).position) + off_m * way / np.linalg.norm(way)
        said[str(marker)] = [round(float(value), 4) for value in place]
    return said


def calibrated(flat: VirtualApartment, markers: dict[str, Any]) -> tuple[OrderResult, list[Calibration]]:
    """Orders it, and waits for its end."""
    return ordered(flat, "CalibrateMount", json.dumps({"value": {"markers": markers}}))


def mount_of(told: Calibration) -> Mount:
    """What came out."""
    assert told.mount is not None
    return Mount(**{key: tuple(value) if isinstance(value, list) else value for key, value in told.mount.items()})
