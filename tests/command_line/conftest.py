"""A configuration with a camera whose service the test plays (`playing.py`)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from services.client import Client
from services.peers.mosquitto import Broker
from tests.command_line.playing import CAMERAS
from tests.command_line.terminal import config_of, somebody


@pytest.fixture
def config(mosquitto_broker: Broker, tmp_path: Path) -> Path:
    return config_of(tmp_path, mosquitto_broker, sections=CAMERAS)


@pytest.fixture
def camera(mosquitto_broker: Broker) -> Iterator[Client]:
    """The bus as the camera's service has it."""
    with somebody(mosquitto_broker, "camera/ip1/order/+") as bus:
        yield bus
