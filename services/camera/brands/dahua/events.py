"""The endless answer of `eventManager.cgi?action=attach`, read piece by piece however the network cut it. Pure.

A part ends with its length where that gives a whole event, else at the next boundary: firmware counts wrongly, puts
line ends before the text, and some writes a second header block before the first part. Not here: the connection
(`camera/alarm/listener.py`).
"""

from __future__ import annotations

import json
import re

from services.camera.device import Event

MOST = 256 * 1024  # bytes without a boundary: no event is so long
MOTION = "VideoMotion"
_BOUNDARY = re.compile(r"boundary=\"?-*([^\s\";]+)", re.IGNORECASE)
_LENGTH = re.compile(rb"^content-length:\s*(\d+)\s*$", re.IGNORECASE | re.MULTILINE)
_EVENT = re.compile(r"Code=(\w+);\s*action=(\w+);\s*index=(\d+)(?:;\s*data=(.*))?", re.DOTALL)


def attach(codes: tuple[str, ...], heartbeat_s: int) -> str:
    """Asks for these events, brackets as they are."""
    return f"/cgi-bin/eventManager.cgi?action=attach&codes=[{','.join(codes)}]&heartbeat={heartbeat_s}"


def indexes(code: str = MOTION) -> str:
    """Asks on which channels this is going on."""
    return f"/cgi-bin/eventManager.cgi?action=getEventIndexes&code={code}"


def boundary(content_type: str) -> str:
    """The boundary that the header names; the usual one where it names none."""
    found = _BOUNDARY.search(content_type)
    return found[1] if found else "myboundary"


class Parser:
    """Takes bytes as they come and gives the events in them; a heartbeat is an Event without a code."""

    def __init__(self, boundary: str = "myboundary") -> None:
        self._mark = b"--" + boundary.encode()
        self._waiting = b""
        self._inside = False  # what waits begins after a boundary

    def feed(self, data: bytes) -> list[Event]:
        """The events that are complete with these bytes."""
        self._waiting += data
        events: list[Event] = []
        while self._find_part() and (taken := self._take_part()) is not None:
            events += taken
        if len(self._waiting) > MOST:
            self._waiting, self._inside = b"", False
        return events

    def _find_part(self) -> bool:
        """Drops what stands before the next boundary, and the boundary; whether a part begins there."""
        if not self._inside:
            at = self._waiting.find(self._mark)
            if at < 0:
                self._waiting = self._waiting[-len(self._mark) :]
                return False
            self._waiting = self._waiting[at + len(self._mark) :]
            self._inside = True
        return True

    def _take_part(self) -> list[Event] | None:
        """What the first part says, when enough of it is there to know; None: more is needed."""
        end = self._waiting.find(self._mark)
        part = self._waiting if end < 0 else self._waiting[:end]
        header, blank, body = part.partition(b"\r\n\r\n")
        length = _LENGTH.search(header.replace(b"\r", b"")) if blank else None
        text = body.lstrip(b"\r\n")
        if length is not None and len(text) >= int(length[1]):
            event = read_event(text[: int(length[1])], whole=True)
            if event is not None:
                return self._done(end, [event])
        if end < 0:
            return None
        event = read_event(text, whole=False)
        return self._done(end, [] if event is None else [event])

    def _done(self, end: int, events: list[Event]) -> list[Event]:
        self._inside = False
        if end >= 0:
            self._waiting = self._waiting[end:]
        return events


def read_event(body: bytes, *, whole: bool) -> Event | None:
    """The event in a part's text; None when there is none. `whole`: nothing may be missing, JSON included."""
    text = body.decode("utf-8", "replace").strip()
    if text == "Heartbeat":
        return Event("", "Heartbeat")
    found = _EVENT.fullmatch(text)
    if found is None:
        return None
    code, action, index, data = found.groups()
    if whole and data is not None and not _is_json(data):
        return None
    return Event(code, action, int(index))


def _is_json(text: str) -> bool:
    try:
        json.loads(text)
    except (ValueError, RecursionError):
        return False
    return True


def read_indexes(body: str) -> bool:
    """Whether it is going on anywhere."""
    return body.lstrip().startswith("channels[")
