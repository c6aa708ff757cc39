"""Talking to masters that refuse, hang or talk nonsense."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

import pytest

from services.errors import Unavailable
from services.peers import free_port
from services.ros import master as master_module
from services.ros.master import Master, Registrations, register


@contextmanager
def serving(**methods: Any) -> Iterator[str]:
    """An XML-RPC server with these methods; yields its address."""
    with SimpleXMLRPCServer(("127.0.0.1", 0), SimpleXMLRPCRequestHandler, logRequests=False) as server:
        for name, method in methods.items():
            server.register_function(method, name)
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


def test_the_pid_tells_one_master_from_the_next() -> None:
    with serving(getPid=lambda caller: [1, "", 77]) as uri:
        assert Master(uri, "/node").pid() == 77


@pytest.mark.parametrize("answer", [[0, "not now", 0], [1, "", "seven"], [1], "text", 3, [[], [], []]])
def test_another_answer_is_as_no_answer(answer: Any) -> None:
    with serving(getPid=lambda caller: answer) as uri, pytest.raises(Unavailable):
        Master(uri, "/node").pid()


def test_nobody_there_is_unavailable() -> None:
    with pytest.raises(Unavailable, match="refused"):
        Master(f"http://127.0.0.1:{free_port()}", "/node").pid()


def test_no_xml_rpc_is_unavailable() -> None:
    with pytest.raises(Unavailable):
        Master("http://127.0.0.1:1/\x00", "/node").pid()


def test_a_master_that_hangs_is_given_up_in_time() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        started = time.monotonic()
        with pytest.raises(Unavailable, match="timed out"):
            Master(f"http://127.0.0.1:{silent.getsockname()[1]}", "/node").pid()
    assert time.monotonic() - started < 2 * master_module.TIMEOUT_S


def test_everything_is_registered_and_the_node_learns_who_publishes() -> None:
    calls: list[tuple[Any, ...]] = []

    def note(answer: Any, *arguments: Any) -> list[Any]:
        calls.append(arguments)
        return [1, "", answer]

    with (
        serving(publisherUpdate=lambda *said: note(0, "update", *said)) as node,
        serving(
            registerPublisher=lambda *said: note([], "pub", *said),
            registerSubscriber=lambda *said: note(["http://robot:1"], "sub", *said),
            registerService=lambda *said: note(1, "srv", *said),
        ) as uri,
    ):
        register(Master(uri, "/b"), Registrations(node, [("/a", "T")], [("/c", "T")], [("/s", "rosrpc://x:1")]))
    assert calls == [
        ("pub", "/b", "/a", "T", node),
        ("sub", "/b", "/c", "T", node),
        ("update", "/b", "/c", ["http://robot:1"]),
        ("srv", "/b", "/s", "rosrpc://x:1", node),
    ]
