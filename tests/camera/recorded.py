"""A camera that answers what the probe has recorded of one: the folder `replies` that it leaves behind."""

from __future__ import annotations

from pathlib import Path

import httpx


class Recorded(httpx.BaseTransport):
    """Answers a request with what was recorded of it; what was never asked is refused in the camera's own way.

    It asks for no login.
    """

    def __init__(self, folder: Path) -> None:
        texts = (file.read_bytes().decode() for file in sorted(folder.glob("*.txt")) if file.name != "events.txt")
        self.answers: dict[str, httpx.Response] = {}
        for text in texts:
            request, answer = text.split("\r\n", 1)
            if read(answer).status_code != 401:
                self.answers[request] = read(answer)
        events = folder / "events.txt"
        self.events = events.read_bytes().decode().encode("latin-1") if events.exists() else b""

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """See `httpx.BaseTransport`."""
        asked = f"{request.method} {request.url.raw_path.decode()}"
        return self.answers.get(asked) or self.answers["GET /cgi-bin/magicBox.cgi?action=getNoSuchThing"]


def read(answer: str) -> httpx.Response:
    """Status, headers and body; the length is that of the body, in which names of another length may stand now."""
    head, _, body = answer.partition("\r\n\r\n")
    status, *lines = head.split("\r\n")
    headers = [tuple(line.split(": ", 1)) for line in lines if not line.lower().startswith("content-length")]
    return httpx.Response(int(status.split()[1]), headers=headers, content=body.encode("latin-1"))
