"""The camera service's stream, a multipart of JPEG files, taken apart as its bytes come. Pure."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from services.errors import BadMessage

HEAD_LIMIT = 4096  # bytes before a picture
PICTURE_LIMIT = 8 * 1024 * 1024
END_OF_HEAD = b"\r\n\r\n"
LENGTH = re.compile(rb"(?mi)^Content-Length:\s*(\d+)\s*$")
STAMP = re.compile(rb"(?mi)^X-Timestamp:\s*(\d+(?:\.\d+)?)\s*$")


@dataclass(frozen=True)
class Shown:
    """One picture; `stamp` when it was exposed, seconds since 1970, where the stream says it."""

    jpeg: bytes
    stamp: float | None


class Multipart:
    """`feed` it what came; BadMessage when it is no such stream."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, data: bytes) -> Iterator[Shown]:
        """The pictures that are whole now."""
        self._rest += data
        while (shown := self._one()) is not None:
            yield shown

    def _one(self) -> Shown | None:
        end = self._rest.find(END_OF_HEAD, 2)  # the line before the boundary ends the picture before
        if end < 0:
            if len(self._rest) > HEAD_LIMIT:
                raise BadMessage("expected the head of a picture in the stream")
            return None
        head = bytes(self._rest[:end])
        found = LENGTH.search(head)
        length = int(found[1]) if found else 0
        if not 0 < length <= PICTURE_LIMIT:
            raise BadMessage(f"expected the length of a picture in the stream, got {head[-80:]!r}")
        begin = end + len(END_OF_HEAD)
        if len(self._rest) < begin + length:
            return None
        jpeg = bytes(self._rest[begin : begin + length])
        del self._rest[: begin + length]
        stamp = STAMP.search(head)
        return Shown(jpeg, float(stamp[1]) if stamp else None)
