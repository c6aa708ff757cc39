"""What every test may use: private peers, and the rule that CI runs everything that Debian 12 has."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from services import peers
from services.peers import mariadb, mosquitto
from tests.databases import Database, fresh_mariadb, fresh_sqlite

settings.register_profile("apartment", deadline=None)  # the machine may be busy with other things
settings.load_profile("apartment")
NEEDED = {"mosquitto", "mariadb", "ros", "rtsp", "chromium", "node", "systemd"}


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """In CI a skip for a part that Debian 12 has is a failure: the part was not installed."""
    outcome = yield
    report = outcome.get_result()
    if report.skipped and os.environ.get("CI") and NEEDED & {mark.name for mark in item.iter_markers()}:
        report.outcome = "failed"
        report.longrepr = f"skipped in CI: {call.excinfo.value if call.excinfo else 'marked'}"


@pytest.fixture
def mosquitto_broker(tmp_path: Path) -> Iterator[mosquitto.Broker]:
    """A private mosquitto with the project's own configuration; who gives no name may do everything."""
    try:
        with mosquitto.private(tmp_path / "mosquitto", anonymous=True) as broker:
            yield broker
    except peers.Missing as missing:
        pytest.skip(str(missing))


@pytest.fixture(scope="session")
def mariadb_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[mariadb.Server]:
    """One private MariaDB for all tests."""
    try:
        with mariadb.private(tmp_path_factory.mktemp("mariadb")) as server:
            yield server
    except peers.Missing as missing:
        pytest.skip(str(missing))


@pytest.fixture(params=["sqlite", pytest.param("mariadb", marks=pytest.mark.mariadb)])
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Database:
    """Each database that storage runs on, empty."""
    if request.param == "sqlite":
        return fresh_sqlite(tmp_path)
    return fresh_mariadb(request.getfixturevalue("mariadb_server"))
