"""A broker inside Python (amqtt), for the demo and for tests where no mosquitto is installed.

It speaks MQTT 3.1.1 only, keeps nothing over a restart, and has no accounts: loopback only.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from services.peers import Missing, answers, free_port, wait_until


@contextmanager
def broker(port: int = 0) -> Iterator[int]:
    """Runs a broker on loopback in a thread of its own until the end of the block; yields its port.

    Missing where amqtt is not installed.
    """
    port = port or free_port()
    host = _Host(port)
    thread = threading.Thread(target=host.run, name="embedded broker", daemon=True)
    thread.start()
    try:
        wait_until(lambda: host.ended() or answers(port), "embedded broker", 15.0)
        yield port
    finally:
        host.stop()
        thread.join(10.0)


class _Host:
    """The thread that the broker's event loop lives in."""

    def __init__(self, port: int) -> None:
        try:
            from amqtt.broker import Broker
        except ImportError as error:
            raise Missing("amqtt is not installed: pip install 'smart-apartment[embedded]'") from error
        self._make = Broker
        self._settings = _settings(port)
        self._loop = asyncio.new_event_loop()
        self._stopping = asyncio.Event()
        self._failure: BaseException | None = None

    def run(self) -> None:
        """The thread's body."""
        try:
            self._loop.run_until_complete(self._serve())
        except (OSError, RuntimeError) as error:
            self._failure = error
        finally:
            self._loop.close()

    def ended(self) -> bool:
        """False while it runs; raises what ended it."""
        if self._failure is not None:
            raise RuntimeError("the embedded broker did not start") from self._failure
        return False

    def stop(self) -> None:
        """Asks it to end, from any thread."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._stopping.set)

    async def _serve(self) -> None:
        logging.getLogger("transitions").setLevel(logging.WARNING)
        logging.getLogger("amqtt").setLevel(logging.CRITICAL)  # a client that only looks is an error to it
        self._loop.set_exception_handler(_ignore_lost_client)
        broker = self._make(self._settings)
        await broker.start()
        await self._stopping.wait()
        await broker.shutdown()


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
