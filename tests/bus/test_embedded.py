"""The broker written in Python, where its own word counts and not what a client makes of it."""

from __future__ import annotations

import socket
import threading

import pytest

from services.peers import Missing, embedded

CLIENTS = 8
CONNECT = bytes([0x10, 0x0E, 0x00, 0x04, *b"MQTT", 0x04, 0x02, 0x00, 0x3C, 0x00, 0x02])  # 3.1.1, clean; and a name


def test_who_returns_while_it_goes_down_is_not_let_in_again() -> None:
    greeted: list[int] = []
    up = threading.Semaphore(0)
    try:
        with embedded.broker() as port:
            clients = [threading.Thread(target=_return, args=(port, name, greeted, up)) for name in range(CLIENTS)]
            for client in clients:
                client.start()
            for _ in clients:
                assert up.acquire(timeout=10)
    except Missing as missing:
        pytest.skip(str(missing))
    for client in clients:
        client.join()
    assert sorted(greeted) == list(range(CLIENTS))


def _return(port: int, name: int, greeted: list[int], up: threading.Semaphore) -> None:
    """Connects, and again as soon as it is sent away, until nobody listens."""
    while True:
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=10) as wire:
                wire.sendall(CONNECT + f"{name:02}".encode())
                if not wire.recv(4):
                    return
                greeted.append(name)
                up.release()
                wire.recv(1)
        except OSError:
            return
