"""The HTTP server in a thread of its own. What it serves is in `application.py`."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
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


class Server:
    """Listens from its making until `close`. OSError when it cannot."""

    def __init__(self, house: House) -> None:
        self._house = house
        self._socket = _listening(house.config.host, house.config.port)
        self.port: int = self._socket.getsockname()[1]
        tls = house.config.tls
        self.url = f"{'https' if tls else 'http'}://{_shown(house.config.host)}:{self.port}/"
        self._uvicorn = uvicorn.Server(
            uvicorn.Config(
                application(house),
                log_config=None, log_level="warning", access_log=False, lifespan="off", ws="none", http=Visit,
                server_header=False, proxy_headers=False, limit_concurrency=MOST_CONNECTIONS, loop="asyncio",
                timeout_graceful_shutdown=1, timeout_keep_alive=20,
                ssl_certfile=tls.cert if tls else None, ssl_keyfile=tls.key if tls else None,
            )
        )  # fmt: skip
        self._loop: asyncio.AbstractEventLoop | None = None
        self._running = threading.Event()
        self._thread = threading.Thread(target=self._run, name="http", daemon=True)
        self._thread.start()
        if not self._running.wait(START_S):
            raise OSError(f"the HTTP server did not start within {START_S:.0f} s")

    def spread(self, batch: tuple[Entry, ...]) -> None:
        """Hands a batch to the pages; from any thread."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._house.hub.spread, batch)

    def answered(self, reply: HistoryReply) -> None:
        """Hands over an answer of the history service; from any thread."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._house.answered, reply)

    def pictured(self, camera: str, jpeg: bytes) -> None:
        """Hands over an analysed picture of a scan; from any thread."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._house.pictured, camera, jpeg)

    def close(self) -> None:
        """Ends every connection, and the thread."""
        loop, self._loop = self._loop, None
        if loop is not None:
            loop.call_soon_threadsafe(self._end)
        self._thread.join(END_S + 2.0)
        self._socket.close()

    def _end(self) -> None:
        self._house.hub.close()
        self._uvicorn.should_exit = True

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._running.set()
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
