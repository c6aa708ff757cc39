"""A service with a bug, run as a real process to show what becomes of the message that finds it."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from services import process
from services.apartment.home import Home
from services.bus import Message
from services.config import Apartment, BusSettings, Instance
from services.registry import Row
from services.runner import Post
from services.section import Section
from services.topics import HOME_SET

NAME = "operator"  # an account that the broker knows
ROW = Row(NAME, __name__, (), "a service with a bug")


class Config(Section):
    """It has no settings."""


class Fragile:
    """Divides by what it is told on `home/Divisor/state`, and says the quotient."""

    subscribes = ("home/Divisor/state",)
    due = None

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        yield HOME_SET.message(f"{100 / float(message.payload):g}", item="Quotient")

    def tick(self, now: float) -> Iterable[Message]:
        return ()


@contextmanager
def start(config: Config, post: Post) -> Iterator[Fragile]:
    yield Fragile()


def main() -> None:
    port, state = int(sys.argv[1]), Path(sys.argv[2])
    process.log_to_stderr()
    instance = Instance(NAME, ROW, Config())
    apartment = Apartment(Path("-"), BusSettings(port=port), Home(items={}), state, (), instances={NAME: instance})
    process.serve(
        apartment, [NAME], lambda ready: sys.stdout.write(process.ready_line(NAME, ready) + "\n") and sys.stdout.flush()
    )


if __name__ == "__main__":
    sys.modules["tests.crashing"] = sys.modules["__main__"]
    main()
