"""OpenHAB's REST interface and its event stream: two threads that post what they hear. The only file that asks it.

After every connection all items are read again, behind the opening of the stream, so that no change is missed. Not
here: what of it goes to the bus (`mirror.py`).
"""

from __future__ import annotations

import json
import logging
import queue
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from types import TracebackType
from typing import Any
from urllib.parse import quote

import httpx

from services.bus import Message
from services.errors import Unavailable
from services.runner import Post
from services.topic import lateness

log = logging.getLogger(__name__)
STATES, STATE, ANSWER, LOST = "/openhab/states", "/openhab/state", "/openhab/answer", "/openhab/lost"
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.125, 64.0  # between two tries, doubled each time
ASK = httpx.Timeout(10.0, connect=3.0)
FIELDS = "name,type,state,groupNames"


@dataclass(frozen=True)
class Item:
    """An item as OpenHAB lists it."""

    type: str
    state: str
    groups: tuple[str, ...]


@dataclass(frozen=True)
class Write:
    """A command or an update for an item; `received`: when it came, seconds since 1970."""

    item: str
    text: str
    command: bool
    received: float


@dataclass(frozen=True)
class Answer:
    """What became of it; `fault` None: taken."""

    write: Write
    fault: str | None


class Connection:
    """Listens and writes until it is left; everything heard is posted."""

    def __init__(self, url: str, token: str | None, topic: str, silence_s: float, post: Post) -> None:
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        self._http = httpx.Client(base_url=url, headers=headers, timeout=ASK, trust_env=False)
        self._url, self._silence_s, self._post = url, silence_s, post
        self._topics = f"{topic}/items/*/statechanged"
        self._writes: queue.SimpleQueue[Write | None] = queue.SimpleQueue()
        self._ended = threading.Event()
        self._socket: socket.socket | None = None  # of the stream: what a thread waits at
        self._threads = [
            threading.Thread(target=self._listen, name="openhab-events", daemon=True),
            threading.Thread(target=self._send, name="openhab-writes", daemon=True),
        ]

    def __enter__(self) -> Connection:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self._ended.set()
        self._writes.put(None)
        if self._socket is not None:
            with suppress(OSError):  # closed already
                self._socket.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join(timeout=2.0)
        self._http.close()

    def write(self, write: Write) -> None:
        """Takes a command or an update, to be sent after those before it."""
        self._writes.put(write)

    def _listen(self) -> None:
        pause = FIRST_PAUSE_S
        told = False
        while not self._ended.is_set():
            try:
                for name, text in self._events():
                    pause, told = FIRST_PAUSE_S, False
                    self._post(Message(STATE, value=(name, text)))
            except Unavailable as error:
                if not told and not self._ended.is_set():
                    log.warning("%s: %s", self._url, error)
                told = True
                self._post(Message(LOST))
            self._ended.wait(pause)
            pause = min(2 * pause, LONGEST_PAUSE_S)

    def _events(self) -> Iterator[tuple[str, str]]:
        """Opens the stream, posts all items, then yields every change; Unavailable when it breaks."""
        timeout = httpx.Timeout(self._silence_s, connect=ASK.connect)
        try:
            with self._http.stream("GET", "/rest/events", params={"topics": self._topics}, timeout=timeout) as answer:
                self._socket = answer.extensions["network_stream"].get_extra_info("socket")
                if answer.status_code != httpx.codes.OK:
                    raise Unavailable(f"expected the event stream, got {answer.status_code}")
                self._post(Message(STATES, value=self._items()))
                for line in answer.iter_lines():
                    change = change_of(line)
                    if change is not None:
                        yield change
        except (httpx.HTTPError, httpx.StreamError) as error:
            raise Unavailable(f"the event stream broke: {type(error).__name__} {error}".strip()) from error
        raise Unavailable("the event stream ended")

    def _items(self) -> dict[str, Item]:
        answer = self._http.get("/rest/items", params={"recursive": "false", "fields": FIELDS})
        if answer.status_code != httpx.codes.OK:
            raise Unavailable(f"expected the items, got {answer.status_code}")
        try:
            return {one["name"]: _item(one) for one in answer.json()}
        except (ValueError, KeyError, TypeError) as error:
            raise Unavailable(f"expected a list of items: {type(error).__name__} {error}") from error

    def _send(self) -> None:
        while (write := self._writes.get()) is not None:
            self._post(Message(ANSWER, value=Answer(write, self._fault(write))))

    def _fault(self, write: Write) -> str | None:
        """Sends one; what is wrong with that, None when OpenHAB took it."""
        if late := lateness(write.received, time.time()):
            return f"{late}, not sent"
        path = f"/rest/items/{quote(write.item)}" + ("" if write.command else "/state")
        headers = {"Content-Type": "text/plain; charset=utf-8"}
        try:
            method = "POST" if write.command else "PUT"
            answer = self._http.request(method, path, content=write.text.encode(), headers=headers)
        except httpx.HTTPError as error:
            return f"not sent: {type(error).__name__} {error}".strip()
        return None if answer.is_success else f"OpenHAB answered {answer.status_code} {answer.text[:80]}".strip()


def _item(one: dict[str, Any]) -> Item:
    return Item(str(one["type"]), str(one["state"]), tuple(map(str, one.get("groupNames", ()))))


def change_of(line: str) -> tuple[str, str] | None:
    """The item and its new state, of a line of the stream; None for any other line."""
    if not line.startswith("data:"):
        return None
    try:
        event = json.loads(line.removeprefix("data:"))
        if not isinstance(event, dict) or event.get("type") != "ItemStateChangedEvent":
            return None
        return str(event["topic"]).split("/")[2], str(json.loads(event["payload"])["value"])
    except (ValueError, KeyError, TypeError, IndexError):
        return None
