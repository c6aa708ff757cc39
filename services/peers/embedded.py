"""A broker written in Python (amqtt), for the demo and for tests where no mosquitto is installed.

It runs in a process of its own, so that its work does not slow the caller's. It speaks MQTT 3.1.1 only, keeps
nothing over a restart and has no accounts: loopback only. Not here: the real one, `peers/mosquitto.py`.

amqtt 0.12.1 walks through its table of subscriptions and waits on the way. Who subscribes meanwhile ends the walk with
a RuntimeError that it tells nobody: the client that was greeted by it is connected and neither heard nor spoken to for
ever, or nobody is told anything any more. So the table that it gets here is walked through as it was at the beginning.
"""

from __future__ import annotations

import asyncio
import importlib.util
import logging
import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from services.peers import Missing, answers, free_port, running


@contextmanager
def broker(port: int = 0) -> Iterator[int]:
    """Runs a broker on loopback until the end of the block; yields its port. Missing where amqtt is not installed."""
    if importlib.util.find_spec("amqtt") is None:
        raise Missing("amqtt is not installed: pip install 'smart-apartment[embedded]'")
    port = port or free_port()
    command = [sys.executable, "-m", __name__, str(port)]
    with tempfile.TemporaryDirectory() as folder, running(command, Path(folder) / "log", lambda: answers(port)):
        yield port


class Table(dict[str, Any]):
    """Whoever walks through it sees it as it was when the walk began."""

    def __iter__(self) -> Iterator[str]:
        return iter(list(super().__iter__()))

    def items(self) -> Any:
        """See `dict`."""
        return dict(super().items()).items()


async def _serve(port: int) -> None:
    from amqtt.broker import Broker

    logging.getLogger("transitions").setLevel(logging.WARNING)
    logging.getLogger("amqtt").setLevel(logging.CRITICAL)  # a client that only looks is an error to it
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(_ignore_lost_client)
    stopping = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stopping.set)
    server = Broker(_settings(port))
    server._subscriptions = Table()
    await server.start()
    await stopping.wait()
    for listener in server._servers.values():  # amqtt ends its clients first, and lets in again who returns at once
        if listener.instance is not None:
            listener.instance.close()
    await server.shutdown()


def _ignore_lost_client(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """A client that went away in the middle of a word is no news."""
    if not isinstance(context.get("exception"), OSError):
        loop.default_exception_handler(context)


def _settings(port: int) -> dict[str, Any]:
    """Said in full: amqtt's own defaults listen on all addresses."""
    return {
        "listeners": {"default": {"type": "tcp", "bind": f"127.0.0.1:{port}", "max_connections": 100}},
        "plugins": {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}},
    }


if __name__ == "__main__":
    asyncio.run(_serve(int(sys.argv[1])))
