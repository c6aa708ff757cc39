"""A master that goes in the middle of what a robot's nodes ask it, and comes again."""

from __future__ import annotations

import os
import subprocess
import threading
import urllib.request
import xmlrpc.client
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from services.peers import ros, wait_until
from tests.bridge.conftest import PATIENCE_S
from tests.bridge.robots.test_on_ros import program
from tests.serving import serving

pytestmark = pytest.mark.ros
PARAMETERS = ("getParam", "hasParam", "searchParam", "subscribeParam")
ASKED = 6  # so often actionlib asks for parameters while a server starts


class Gate(ThreadingHTTPServer):
    """The way to a master; it goes with the question for a parameter of this number, and comes `again`."""

    def __init__(self, master: ros.Master, goes_at: int) -> None:
        super().__init__(("127.0.0.1", 0), Passing)
        self.master, self._left = master, goes_at
        self.away, self._lock = False, threading.Lock()

    def passes(self, body: bytes) -> bool:
        """Whether a request reaches the master."""
        _, method = xmlrpc.client.loads(body)
        with self._lock:
            if method in PARAMETERS:
                self._left -= 1
                self.away = self.away or self._left == 0
            return not self.away

    def again(self) -> None:
        """The master is there again."""
        self.away = False


class Passing(BaseHTTPRequestHandler):
    """Hands a request on, or ends the connection as a process that is killed would."""

    server: Gate

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        if not self.server.passes(body):
            self.close_connection = True
            return
        with urllib.request.urlopen(urllib.request.Request(self.server.master.uri, body)) as answer:
            told = answer.read()
        self.send_response(200)
        self.send_header("Content-Type", "text/xml")
        self.send_header("Content-Length", str(len(told)))
        self.end_headers()
        self.wfile.write(told)

    def log_message(self, *_: object) -> None:
        """Nothing."""


@pytest.mark.parametrize("question", range(1, ASKED + 1))
def test_a_robot_whose_master_goes_while_it_starts_is_there_when_it_comes(master: ros.Master, question: int) -> None:
    with serving(Gate(master, question)) as way:
        behind = replace(master, port=way.server_address[1])
        with program(behind, "tests.bridge.robots.robot_process"):
            wait_until(lambda: way.away, "the question", PATIENCE_S)
            way.again()
            for topic in ("/move_base/status", "/tf"):  # a server that has started, and a robot that lives
                said = subprocess.run(
                    ["rostopic", "echo", "-n", "1", topic],
                    env={**os.environ, **master.env}, capture_output=True, timeout=PATIENCE_S, check=True,
                )  # fmt: skip
                assert b"stamp" in said.stdout
