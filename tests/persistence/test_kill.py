"""MariaDB killed in the middle of commits and started again on its folder: nothing lost, nothing double."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Timer
from time import monotonic

import pytest
from pydantic import SecretStr

from services import peers
from services.apartment.home import Home, Item
from services.errors import Unavailable
from services.peers import mariadb
from services.persistence import Config, start
from services.persistence.service import Persistence
from services.storage import open_storage, read_address
from tests.persistence.test_service import T, state

ITEMS = [f"I{n}" for n in range(20)]
HOME = Home(items={name: Item(type="Number", label=name, persist=("everyUpdate",)) for name in ITEMS})
TURNS, KILLS, WITHIN_S = 300, 3, 60.0


class Flaky:
    """A server of its own that is killed and started again."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self._folder = folder
        self._stack = stack
        self.server = stack.enter_context(mariadb.private(folder))

    def kill(self) -> None:
        os.kill(self.server.pid, signal.SIGKILL)

    def again(self) -> None:
        self._stack.close()
        self.server = self._stack.enter_context(mariadb.private(self._folder))


@pytest.fixture
def flaky(tmp_path: Path) -> Iterator[Flaky]:
    with ExitStack() as stack:
        try:
            yield Flaky(tmp_path / "mariadb", stack)
        except peers.Missing as missing:
            pytest.skip(str(missing))


def complete(service: Persistence, now: float, flaky: Flaky) -> None:
    """Ticks until the turn is written; a server that is gone is started again."""
    end = monotonic() + WITHIN_S
    while monotonic() < end:
        try:
            service.tick(now)
            return
        except Unavailable:
            if not peers.answers(flaky.server.port):
                flaky.again()
            now += 10.0  # the pause between attempts is over
    pytest.fail("the database did not come back")


@pytest.mark.mariadb
def test_rows_are_exactly_the_messages_although_the_server_is_killed(flaky: Flaky) -> None:
    server = flaky.server
    address = read_address(server.tcp_url, password=server.password)
    config = Config(url=server.tcp_url, password=SecretStr(server.password), home=HOME)
    with start(config, lambda message: None) as service:
        for turn in range(TURNS):
            timer = Timer(0.002, flaky.kill) if turn % (TURNS // KILLS) == 50 else None
            if timer:
                timer.start()
            for n, item in enumerate(ITEMS):
                service.handle(state(item, str(turn), turn + n / 100), T)
            complete(service, T + turn, flaky)
            if timer:
                timer.join()
        assert service.counters["reconnects"] >= KILLS - 1
    storage = open_storage(address)
    for n, item in enumerate(ITEMS):
        rows = [(sample.time, sample.num) for sample in storage.samples(item)]
        assert rows == [(round((T + turn + n / 100) * 1e6), float(turn)) for turn in range(TURNS)]
    storage.close()
