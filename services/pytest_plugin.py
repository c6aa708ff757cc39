"""Fixtures for a lab's own tests: a broker, a client of it, and the whole apartment simulated.

They come with the package (`pip install smart-apartment[embedded]`); a test only names them:

    def test_the_kitchen_light_can_be_switched(simulated_apartment, bus_client):
        bus_client.say("home/Kitchen_Light/command", "ON")
        assert bus_client.payload("home/Kitchen_Light/state", lambda text: text == "ON") == "ON"
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:  # imported when used: a run of other tests does not pay for OpenCV and paho
    from services.client import Client
    from services.config import BusSettings
    from services.simulated import Parts, Simulated


@pytest.fixture(scope="session")
def apartment_parts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Parts]:
    """An embedded broker and a place for an SQLite file; override it to test against other peers."""
    from services.simulated import parts_of

    with parts_of(tmp_path_factory.mktemp("apartment"), real=False) as parts:
        yield parts


@pytest.fixture(scope="session")
def embedded_broker(apartment_parts: Parts) -> BusSettings:
    """The settings of the broker: `host` and `port`."""
    from services.config import BusSettings

    return BusSettings(port=int(apartment_parts.environment["APARTMENT_BROKER_PORT"]))


@pytest.fixture
def bus_client(embedded_broker: BusSettings) -> Iterator[Client]:
    """A client that hears everything; see `services.client.Client` for `say`, `payload`, `until` and `order`."""
    from services.client import connected

    with connected(embedded_broker, ["#"]) as client:
        yield client


@pytest.fixture(scope="session")
def simulated_apartment(apartment_parts: Parts, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Simulated]:
    """The home, the camera, the camera's service and persistence, running; started once for all tests."""
    from services.simulated import services_of

    with services_of(tmp_path_factory.mktemp("services"), apartment_parts) as running:
        yield running
