"""An answer that never ends (events, sound): its bytes as they come, and a way to end it from another thread.

Not here: what the bytes mean (`brands/dahua/`), and who tries again after it broke.
"""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import httpx

from services.camera.address import Address
from services.camera.device import Away
from services.camera.web.digest import Login
from services.camera.web.gate import Gate
from services.camera.web.trust import away, trust

CONNECT_S = 2.0
# the second line after heartbeats: the kernel asks after 20 s of silence, every 10 s, and gives up after 5 times
KEEP_ALIVE = (
    (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
    (socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 20),
    (socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 10),
    (socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 5),
)


class Endless:
    """One connection for one endless answer at a time; `silence_s` without a byte ends it.

    `patience_s`, where it is given, instead once the answer has begun: it may be silent while all is well. That the
    other end is gone the kernel notices.
    """

    def __init__(self, address: Address, gate: Gate, silence_s: float) -> None:
        self._login = Login(address.user, address.password, gate)
        self._http = httpx.Client(
            base_url=address.url,
            auth=self._login,
            timeout=httpx.Timeout(silence_s, connect=CONNECT_S),
            transport=httpx.HTTPTransport(
                verify=trust(address.url, address.certificate), socket_options=KEEP_ALIVE, trust_env=False
            ),
            trust_env=False,
        )
        self._socket: socket.socket | None = None

    @contextmanager
    def open(self, target: str, patience_s: float | None = None) -> Iterator[tuple[httpx.Response, Iterator[bytes]]]:
        """The answer's head and its bytes; Away when there is none or it breaks, Silent when nothing more comes."""
        begun, silence_s = False, self._http.timeout.read
        try:
            with self._http.stream("GET", target) as response:
                self._socket = _socket_of(response)
                begun = True
                if response.status_code != 200 or response.headers.get("content-type", "").startswith("text/"):
                    response.read()  # a refusal
                silence_s = response.request.extensions["timeout"]["read"] = patience_s or silence_s  # from now on
                yield response, response.iter_raw()
        except httpx.ReadTimeout as error:
            kind = Silent if begun else Away
            raise kind(f"nothing came for {silence_s:g} s") from error
        except httpx.HTTPError as error:
            raise away(error, f"the connection broke: {type(error).__name__} {error}".strip()) from error
        finally:
            self._socket = None

    def close(self) -> None:
        """From any thread: who reads gets Away."""
        if (open_socket := self._socket) is not None:
            with suppress(OSError):  # it may just have been closed
                # not TLS's own, which lets who reads go on with the bytes as they are on the wire
                socket.socket.shutdown(open_socket, socket.SHUT_RDWR)


class Silent(Away):
    """The connection stands, as far as one can see, but nothing comes."""


def _socket_of(response: httpx.Response) -> socket.socket | None:
    stream: Any = response.extensions.get("network_stream")
    found = stream.get_extra_info("socket") if stream is not None else None
    return found if isinstance(found, socket.socket) else None
