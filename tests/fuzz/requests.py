"""HTTP requests that no browser would send, drawn from a seed: bytes on a socket, so that all can be wrong."""

from __future__ import annotations

import json
import random
import socket
from contextlib import suppress

from tests.fuzz.payloads import RAW, TEXTS, value

METHODS = (
    "GET",
    "GET",
    "GET",
    "POST",
    "POST",
    "HEAD",
    "PUT",
    "DELETE",
    "OPTIONS",
    "TRACE",
    "CONNECT",
    "PATCH",
    "get",
    "G\0T",
    "X" * 300,
    "",
)
VERSIONS = ("HTTP/1.1", "HTTP/1.1", "HTTP/1.1", "HTTP/1.0", "HTTP/0.9", "HTTP/2.0", "HTTP/9999999999.1", "HTTQ", "")
HEADERS = (
    "Content-Length",
    "Transfer-Encoding",
    "Content-Type",
    "Cookie",
    "Origin",
    "X-CSRF-Token",
    "Range",
    "Expect",
    "Upgrade",
    "Connection",
    "Accept",
    "Accept-Encoding",
    "If-None-Match",
    "If-Modified-Since",
    "Last-Event-ID",
    "X-Forwarded-For",
    "Sec-Fetch-Site",
    "A" * 200,
    "é",
    "",
)
VALUES = (
    "",
    "0",
    "-1",
    "1e9",
    "99999999999999999999",
    "chunked",
    "gzip, chunked",
    "application/json",
    "text/plain",
    "apartment=x; apartment=y",
    "bytes=0-0,-1",
    "100-continue",
    "websocket",
    "close",
    "keep-alive",
    "null",
    "*",
    "127.0.0.1",
    "fe80::1%lo",
    "x" * 9000,
    "\x01",
    "é",
    "a\rb",
    'W/"x"',
)
ANSWER_S = 3.0


class Source:
    """Draws requests for a server whose right paths are known."""

    def __init__(self, seed: int, port: int, paths: list[str], headers: dict[str, str]) -> None:
        self._rng = random.Random(seed)
        self.port, self._paths, self._headers = port, paths, headers

    def draw(self) -> bytes:
        """The bytes of one."""
        rng = self._rng
        if rng.random() < 0.05:
            return rng.choice([rng.randbytes(rng.randrange(1, 500)), *RAW, b"\r\n" * 50, b"\x16\x03\x01\x02\x00\x01"])
        method, path, body = rng.choice(METHODS), self._path(), self._body()
        headers = {"Host": f"127.0.0.1:{self.port}", **self._headers}
        if body or method == "POST":
            headers |= {"Content-Type": "application/json", "Content-Length": str(len(body))}
        if rng.random() < 0.2:
            headers["Host"] = rng.choice(["", "evil.example", "127.0.0.1:x", "[::1", "x" * 3000, "\x01", "localhost"])
        lines = [f"{name}: {told}" for name, told in headers.items()]
        lines += [
            f"{rng.choice(HEADERS)}: {rng.choice(VALUES)}"
            for _ in range(rng.choice([0, 0, 1, 3, 300 if rng.random() < 0.1 else 1]))
        ]
        head = f"{method} {path} {rng.choice(VERSIONS)}\r\n" + "".join(f"{line}\r\n" for line in lines) + "\r\n"
        data = head.encode("utf-8", "surrogatepass") + body
        return data[: rng.randrange(len(data))] if rng.random() < 0.05 else data

    def _path(self) -> str:
        rng = self._rng
        path = rng.choice(self._paths)
        while "{" in path:
            before, _, rest = path.partition("{")
            path = (
                before
                + rng.choice(["Kitchen_Light", "ip1", "582", "%00", "..%2f..", "%", "%ff", "x" * 200, "é"])
                + rest.partition("}")[2]
            )
        chance = rng.random()
        if chance < 0.25:
            path += "?" + "&".join(
                f"{rng.choice(['item', 'since', 'until', 'limit', 'every', 'what', 'x'])}={_quoted(rng)}"
                for _ in range(rng.choice([1, 3]))
            )
        elif chance < 0.35:
            path = rng.choice(
                [
                    "/../../etc/passwd",
                    "//",
                    "/%2e%2e/%2e%2e/etc/passwd",
                    "*",
                    "http://evil.example/",
                    "/" + "x" * 70_000,
                    "/\0",
                    "",
                    "/static/../x",
                ]
            )
        return path

    def _body(self) -> bytes:
        rng = self._rng
        chance = rng.random()
        if chance < 0.5:
            return b""
        if chance < 0.6:
            return rng.choice(RAW)
        if chance < 0.61:
            return b"[" * 70_000
        made = {
            name: value(rng)
            for name in rng.sample(
                ["value", "topic", "payload", "pan", "tilt", "right", "down", "find", "user", "password", "id"], 3
            )
        }
        return json.dumps(made).encode()


def _quoted(rng: random.Random) -> str:
    text = rng.choice([*TEXTS, "1", "-1", "1e308", "Kitchen_Light", "samples", "2026-01-31T07:05:00Z"])
    return (
        "".join(f"%{byte:02x}" for byte in text.encode(errors="surrogatepass"))
        if rng.random() < 0.8
        else text.replace(" ", "+").replace("\n", "")
    )


def exchange(port: int, data: bytes) -> bytes:
    """What a server answers first; nothing where it ends the connection or waits for more."""
    with suppress(OSError), socket.create_connection(("127.0.0.1", port), ANSWER_S) as link:
        link.settimeout(ANSWER_S)
        with suppress(OSError):
            link.sendall(data)
        with suppress(OSError):
            link.shutdown(socket.SHUT_WR)
        return link.recv(4096)
    return b""
