"""What the demo does while nobody ends it."""

from __future__ import annotations

from io import StringIO
from typing import Any

import pytest
from rich.console import Console

from services import demo
from services.bus.memory import Hub, MemoryBus
from services.client import Client
from services.topics import HOME_STATE

MESSAGES = 500


class Screen(Console):
    """A terminal on which each line makes the home say something, and the last one is Ctrl-C."""

    def __init__(self, home: MemoryBus) -> None:
        super().__init__(file=StringIO())
        self._home = home
        self.lines = 0

    def print(self, *said: Any, **how: Any) -> None:
        super().print(*said, **how)
        self.lines += 1
        if self.lines > MESSAGES:
            raise KeyboardInterrupt
        self._home.publish(HOME_STATE.message(str(self.lines), item="Temp"))


def test_a_demo_that_is_left_running_keeps_nothing_of_what_it_has_shown() -> None:
    hub = Hub()
    bus = Client(MemoryBus(hub))
    bus.subscribe(HOME_STATE.filter)
    screen = Screen(MemoryBus(hub))
    with pytest.raises(KeyboardInterrupt):
        demo._until_ctrl_c(screen, bus)
    assert f"home/Temp/state  {MESSAGES}" in screen.file.getvalue()  # type: ignore[attr-defined]
    assert len(bus.seen) <= 1
