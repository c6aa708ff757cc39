"""OpenHAB's REST interface as its documentation has it: items, commands, updates, the event stream, tokens.

It can be taken away and come back. It knows nothing of who asks.
"""

from __future__ import annotations

import json
import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

GONE = object()


class OpenHab:
    """The items of a site and who listens; `autoupdate` makes a command the state, as for most items."""

    def __init__(self, items: dict[str, dict[str, Any]], token: str | None, prefix: str) -> None:
        self.items = items
        self.token, self.prefix = token, prefix
        self.commands: list[tuple[str, str]] = []
        self.updates: list[tuple[str, str]] = []
        self.requests = 0
        self.refuse_with: int | None = None
        self._listeners: list[queue.SimpleQueue[object]] = []
        self._lock = threading.Lock()

    def update(self, name: str, state: str) -> None:
        """The state of an item becomes another; listeners are told of a change."""
        with self._lock:
            old, self.items[name]["state"] = self.items[name]["state"], state
            if old != state:
                payload = {"type": "String", "value": state, "oldType": "String", "oldValue": old}
                event = {"topic": f"{self.prefix}/items/{name}/statechanged", "payload": json.dumps(payload),
                         "type": "ItemStateChangedEvent"}  # fmt: skip
                for one in self._listeners:
                    one.put(event)

    def listen(self) -> queue.SimpleQueue[object]:
        """A listener more."""
        with self._lock:
            self._listeners.append(queue.SimpleQueue())
            return self._listeners[-1]

    def hang_up(self) -> None:
        """Ends every event stream."""
        with self._lock:
            for one in self._listeners:
                one.put(GONE)
            self._listeners.clear()

    @property
    def listeners(self) -> int:
        """How many listen."""
        return len(self._listeners)


def _handler(openhab: OpenHab) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def _refused(self) -> bool:
            openhab.requests += 1
            wanted = f"Bearer {openhab.token}"
            status = openhab.refuse_with or (401 if openhab.token and self.headers["Authorization"] != wanted else None)
            if status is not None:
                self._answer(status)
            return status is not None

        def _answer(self, status: int, content: bytes = b"") -> None:
            self.send_response(status)
            self.send_header("Content-Length", str(len(content)))
            self.send_header("Content-Type", "application/json")
            self.end_headers()
            self.wfile.write(content)

        def do_GET(self) -> None:
            if self._refused():
                return
            split = urlsplit(self.path)
            if split.path == "/rest/items":
                fields = parse_qs(split.query).get("fields", [""])[0].split(",")
                listed = [{"name": name, **item} for name, item in openhab.items.items()]
                wanted = [{key: one[key] for key in one if key in fields} for one in listed]
                self._answer(200, json.dumps(wanted).encode())
            elif split.path == "/rest/events":
                self._stream(parse_qs(split.query)["topics"][0])
            else:
                self._answer(404)

        def _stream(self, topics: str) -> None:
            waiting = openhab.listen()
            self.send_response(200)
            self.send_header("Content-Type", "text/event-stream")
            self.end_headers()
            self.wfile.write(b'event: alive\ndata: {"type": "ALIVE", "interval": 10}\n\n')
            self.wfile.flush()
            while (event := waiting.get()) is not GONE:
                assert isinstance(event, dict)
                if topics.startswith(event["topic"].partition("/")[0]):
                    self.wfile.write(f"event: message\ndata: {json.dumps(event)}\n\n".encode())
                    self.wfile.flush()
            self.close_connection = True

        def _item(self) -> str:
            return unquote(self.path.split("/")[3])

        def do_POST(self) -> None:
            text = self.rfile.read(int(self.headers["Content-Length"])).decode()
            if self._refused():
                return
            name = self._item()
            if name not in openhab.items:
                self._answer(404)
                return
            openhab.commands.append((name, text))
            self._answer(200)
            openhab.update(name, text)

        def do_PUT(self) -> None:
            text = self.rfile.read(int(self.headers["Content-Length"])).decode()
            if self._refused():
                return
            openhab.updates.append((self._item(), text))
            self._answer(202)
            openhab.update(self._item(), text)

        def log_message(self, *_: object) -> None:
            pass

    return Handler


@contextmanager
def serving(openhab: OpenHab, port: int = 0) -> Iterator[int]:
    """Answers on loopback until the end of the block; gives the port."""
    server = ThreadingHTTPServer(("127.0.0.1", port), _handler(openhab))
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        openhab.hang_up()
        server.shutdown()
        server.server_close()
        thread.join(5.0)
