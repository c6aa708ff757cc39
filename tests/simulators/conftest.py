"""The world of the shipped configuration, and a simulated camera on a free port."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from services.simulators.camera import Config, start
from services.simulators.camera.program import Simulated
from services.simulators.world import World, load

CONFIG = Path(__file__).parents[2] / "config"
USER, PASSWORD = "ros", "secret123"


@pytest.fixture(scope="session")
def world() -> World:
    return load(CONFIG / "world.yaml")


@pytest.fixture(scope="session")
def config() -> Config:
    return Config.model_validate({"folder": CONFIG, "user": USER, "password": PASSWORD, "latency_s": 0})


@pytest.fixture
def camera(config: Config) -> Iterator[Simulated]:
    with start(config) as running:
        yield running
