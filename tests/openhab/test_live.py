"""What a running OpenHAB says of files, against a stand-in of its parse endpoint."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from typer.testing import CliRunner

from services.__main__ import app
from services.errors import Unavailable
from services.openhab.live import check
from services.peers import free_port

TOKEN = "oh.parse.only-for-tests"


class Handler(BaseHTTPRequestHandler):
    """Answers as a 5.1 does: items and things; refuses what has the word `wrong`; wants a token."""

    def do_POST(self) -> None:
        text = self.rfile.read(int(self.headers["Content-Length"])).decode()
        if self.headers["Authorization"] != f"Bearer {TOKEN}":
            self._answer(401, "")
        elif self.path != "/rest/file-format/parse":
            self._answer(404, "")
        elif self.headers["Content-Type"] not in ("text/vnd.openhab.dsl.item", "text/vnd.openhab.dsl.thing"):
            self._answer(415, "")
        elif "wrong" in text:
            self._answer(400, "[2,8]: no viable alternative at input 'wrong'\n")
        else:
            self._answer(200, "{}")

    def _answer(self, status: int, text: str) -> None:
        content = text.encode()
        self.send_response(status)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def url() -> Iterator[str]:
    """Where it answers."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    server.server_close()
    thread.join(5.0)


def test_its_faults_come_with_their_places(url: str) -> None:
    files = {"a.items": "Switch A\nSwitch wrong", "b.things": "", "c.sitemap": "wrong", "d.persist": "wrong"}
    assert [str(one) for one in check(files, url, TOKEN)] == [
        "a.items:2:8: error: OpenHAB: [2,8]: no viable alternative at input 'wrong'"
    ]


def test_a_wrong_token_and_nobody_there_are_told(url: str) -> None:
    with pytest.raises(Unavailable, match="token"):
        check({"a.items": ""}, url, "another")
    with pytest.raises(Unavailable, match="no answer"):
        check({"a.items": ""}, f"http://127.0.0.1:{free_port()}", TOKEN)


def test_the_command_asks_it_too(url: str, tmp_path: Path) -> None:
    (tmp_path / "a.items").write_text("Switch A\nSwitch wrong\n")
    done = CliRunner().invoke(app, ["openhab", "check", str(tmp_path), "--live", url], env={"OPENHAB_TOKEN": TOKEN})
    assert (done.exit_code, "OpenHAB: [2,8]" in done.output) == (1, True)
