"""The camera's own MJPEG: an endless multipart answer of JPEGs, as a session of `video/`. One thread uses it."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator

import httpx

from services.camera.address import Address
from services.camera.device import Away, BadLogin
from services.camera.video import pictures
from services.camera.video.session import Arrival
from services.camera.web.connection import connection
from services.camera.web.digest import Login
from services.camera.web.gate import Gate
from services.camera.web.trust import away
from services.errors import DeviceError

PATIENCE = httpx.Timeout(4.0, connect=2.0)
LARGEST = 8 * 1024 * 1024  # bytes of one picture
LENGTH = re.compile(rb"content-length:\s*(\d{1,8})", re.IGNORECASE)
BEGIN, END = b"\xff\xd8\xff", b"\xff\xd9"


class MotionJpeg:
    """A Session. Away or BadLogin when it cannot be opened."""

    name = "mjpeg"

    def __init__(
        self,
        target: str,
        address: Address,
        gate: Gate,
        clock: Callable[[], float] = time.time,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self.clock = clock
        self._http = connection(address, Login(address.user, address.password, gate), transport)
        try:
            self._answer = self._begin(target)
        except DeviceError:
            self._http.close()
            raise
        self._pictures = split(self._answer.iter_raw())

    def read(self, *, decode: bool) -> Arrival:
        """The next picture; it has no time of its own."""
        try:
            jpeg = next(self._pictures)
        except StopIteration:
            raise Away("the camera has ended its MJPEG") from None
        except httpx.HTTPError as error:
            raise Away(f"the MJPEG broke off: {type(error).__name__}") from error
        develop = (lambda: pictures.decode(jpeg)) if decode else None
        return Arrival(self.clock(), len(jpeg), None, develop, jpeg)

    def close(self) -> None:
        """Ends the connection."""
        self._answer.close()
        self._http.close()

    def _begin(self, target: str) -> httpx.Response:
        try:
            answer = self._http.send(self._http.build_request("GET", target, timeout=PATIENCE), stream=True)
        except httpx.HTTPError as error:
            raise away(error, f"no MJPEG from the camera: {type(error).__name__}") from error
        if answer.status_code == 401:
            answer.close()
            raise BadLogin("the camera's MJPEG does not know this user and password")
        kind = answer.headers.get("content-type", "")
        if answer.status_code != 200 or not kind.startswith("multipart/"):
            answer.close()
            raise Away(f"expected MJPEG from the camera, got {answer.status_code} {kind[:40]}".strip())
        return answer


def split(chunks: Iterator[bytes]) -> Iterator[bytes]:
    """The JPEGs in a multipart body, each as soon as it is whole.

    A length that ends on a JPEG's end is believed; otherwise (they lie at times) the next boundary tells.
    """
    body = bytearray()
    for chunk in chunks:
        body += chunk
        while (found := _first(body)) is not None:
            start, end = found
            yield bytes(body[start:end])
            del body[:end]
        if len(body) > LARGEST:
            body.clear()


def _first(body: bytearray) -> tuple[int, int] | None:
    """Where the first whole JPEG is."""
    start = body.find(BEGIN)
    if start < 0:
        return None
    told = LENGTH.search(body, 0, start)
    if told is not None and body.endswith(END, start, end := start + int(told[1])) and end <= len(body):
        return start, end
    end = body.find(END, start)
    while end >= 0:
        after = bytes(body[end + len(END) : end + 8]).lstrip(b"\r\n")
        if after.startswith(b"--"):
            return start, end + len(END)
        end = body.find(END, end + 1)
    return None
