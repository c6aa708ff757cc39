"""The simulated apartment on a real broker, a browser, and somebody on the bus: for the tests of pages."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from services import peers
from services.client import Client, connected
from services.config import BusSettings
from services.simulated import Simulated, parts_of, services_of, start_mosquitto
from tests.dashboard import browser as browsers
from tests.dashboard.browser import page


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Simulated]:
    """With mosquitto; SQLite and no ROS, which pages do not meet."""
    with parts_of(tmp_path_factory.mktemp("parts"), real=False) as parts:
        parts.broker.close()
        parts.environment["APARTMENT_DASHBOARD_PORT"] = f"{peers.free_port()}"  # the same when it is started again
        try:
            start_mosquitto(parts)
        except peers.Missing as missing:
            pytest.skip(str(missing))
        with services_of(tmp_path_factory.mktemp("flat"), parts, without=("bridge",)) as made:
            yield made


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    try:
        with browsers.chromium() as made:
            yield made
    except peers.Missing as missing:
        pytest.skip(str(missing))


@pytest.fixture
def bus(flat: Simulated) -> Iterator[Client]:
    """Somebody without a name, who may hear and say everything at the private broker."""
    with connected(BusSettings(port=flat.parts.broker_port), ["#"]) as client:
        yield client


@pytest.fixture
def shown(flat: Simulated, chromium: Browser) -> Iterator[Page]:
    with page(chromium, address(flat)) as made:
        yield made


def address(flat: Simulated) -> str:
    return str(flat.ready["dashboard"]["url"]).rstrip("/")
