"""The HTTP server in a thread of its own. What it serves is in `application.py`."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from ipaddress import ip_address

import uvicorn

from services.dashboard.house import House
from services.dashboard.http.application import application
from services.dashboard.http.connection import Listening, Visit
from services.dashboard.view import Entry
from services.payloads.history import HistoryReply

log = logging.getLogger(__name__)
START_S = 20.0
END_S = 3.0
MOST_CONNECTIONS = 300
QUEUE = 64  # connections that nobody has accepted yet


class _Answering(uvicorn.Server):
    """Tells when it answers."""

    def __init__(self, config: uvicorn.Config, answers: threading.Event) -> None:
        super().__init__(config)
        self._answers = answers

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """See uvicorn."""
        await super().startup(sockets)
        self._answers.set()


class Server:
    """Answers from its making until `close`. OSError when it cannot listen, ConfigError when a certificate is wrong."""

    def __init__(self, house: House) -> None:
        self._house = house
        cert, key = house.config.certificate() or (None, None)
        self._socket = _listening(house.config.host, house.config.port)
        self.port: int = self._socket.getsockname()[1]
        self.url = f"{'https' if cert else 'http'}://{_shown(house.config.host)}:{self.port}/"
        self._running = threading.Event()
        self._uvicorn = _Answering(
            uvicorn.Config(
                application(house),
                log_config=None, log_level="warning", access_log=False, lifespan="off", ws="none", http=Visit,
                server_header=False, proxy_headers=False, limit_concurrency=MOST_CONNECTIONS, loop="asyncio",
                timeout_graceful_shutdown=1, timeout_keep_alive=20,
                ssl_certfile=cert, ssl_keyfile=key,
            ),
            self._running,
        )  # fmt: skip
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ended: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="http", daemon=True)
        self._thread.start()
        if not self._running.wait(START_S) or self._ended is not None:
            self.close()
            raise OSError("the HTTP server does not answer") from self._ended

    def spread(self, batch: tuple[Entry, ...]) -> None:
        """Hands a batch to the pages; from any thread."""
        self._soon(self._house.hub.spread, batch)

    def answered(self, reply: HistoryReply) -> None:
        """Hands over an answer of the history service; from any thread."""
        self._soon(self._house.answered, reply)

    def pictured(self, camera: str, jpeg: bytes) -> None:
        """Hands over an analysed picture of a scan; from any thread."""
        self._soon(self._house.pictured, camera, jpeg)

    def close(self) -> None:
        """Ends every connection, and the thread."""
        loop, self._loop = self._loop, None
        if loop is not None:
            with suppress(RuntimeError):  # it has ended by itself
                loop.call_soon_threadsafe(self._end)
        self._thread.join(END_S + 2.0)
        self._socket.close()

    def _end(self) -> None:
        self._house.hub.close()
        self._uvicorn.should_exit = True

    def _soon(self, call: Callable[..., None], *arguments: object) -> None:
        """In the server's thread; what has ended that comes out here."""
        if self._ended is not None:
            raise RuntimeError("the HTTP server has ended") from self._ended
        if self._loop is not None:
            self._loop.call_soon_threadsafe(call, *arguments)

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            self._ended = error
            self._running.set()
            raise

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        beside = [asyncio.create_task(one()) for one in self._house.running]
        try:
            await self._uvicorn.serve(sockets=[self._socket])
        finally:
            for task in beside:
                task.cancel()
            await asyncio.gather(*beside, return_exceptions=True)
            await self._house.close()


def _listening(host: str, port: int) -> socket.socket:
    made = Listening(socket.AF_INET6 if ":" in host else socket.AF_INET)
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if made.family == socket.AF_INET6:
            made.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
        made.bind((host, port))
        made.listen(QUEUE)
    except OSError as error:
        made.close()
        raise OSError(error.errno, f"cannot listen on {host}:{port}: {error.strerror}") from error
    return made


def _shown(host: str) -> str:
    """The host as people can open it."""
    try:
        address = ip_address(host)
    except ValueError:
        return host
    if address.is_unspecified:
        return socket.gethostname()
    return f"[{host}]" if address.version == 6 else host
