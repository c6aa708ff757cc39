"""The network loop of a paho client, run by ourselves: it reads all that has come at each wait.

paho's own loop waits before each packet, and writes each acknowledgement by itself; beside a busy thread each of
these calls costs a change of threads. Not here: what a message is and what becomes of it (`mqtt.py`).
"""

from __future__ import annotations

import select
import socket
import struct
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import MessageType

MOST_AT_ONCE = 100  # packets read before something is written again
KEEPALIVE_EVERY_S = 1.0  # how often paho looks at its clock, at least
PUBACK = struct.Struct(">HH")
PUBACK_HEAD = MessageType.PUBACK << 8 | 2  # its first two bytes: the type, and that two more follow (MQTT 3.1.1, 3.4)


class Client(paho.Client):
    """paho's client, which can acknowledge many messages at once."""

    def ack_all(self, packets: Iterable[int]) -> None:
        """Acknowledges messages with QoS 1, by their packet ids, in one piece."""
        data = b"".join(PUBACK.pack(PUBACK_HEAD, packet) for packet in packets)
        self._packet_queue(MessageType.PUBACK, data, 0, 1)


class Network:
    """Runs the loop of one client after the other, in the thread that calls `run`; `wake` is for the others.

    Whoever is given the messages counts them in `messages`.
    """

    def __init__(self) -> None:
        self.messages = 0
        self._woken, self._bell = socket.socketpair()
        self._woken.setblocking(False)
        self._bell.setblocking(False)

    def wake(self, *_: Any) -> None:
        """Something is to be written, or `run` is to end."""
        with suppress(OSError):  # it was rung so often that it will be heard, or nobody listens any more
            self._bell.send(b"!")

    def run(self, client: Client, lost: threading.Event, write: Callable[[], None]) -> None:
        """Until the connection is lost; `write` is called before each wait."""
        client.on_socket_register_write = self.wake
        while not lost.is_set() and (link := client.socket()) is not None:
            write()
            wanted = [link] if client.want_write() else []
            left = getattr(link, "pending", int)()  # that TLS has read and not handed out
            readable, writable, _ = select.select([link, self._woken], wanted, [], 0 if left else KEEPALIVE_EVERY_S)
            if self._woken in readable:
                with suppress(BlockingIOError):
                    self._woken.recv(4096)
            if left or link in readable:
                self._read(client)
            if writable:
                client.loop_write()
            client.loop_misc()
        client.on_socket_register_write = None

    def _read(self, client: Client) -> None:
        """One packet, and all messages that have come with it."""
        for _ in range(MOST_AT_ONCE):
            before = self.messages
            client.loop_read()
            if self.messages == before:
                return

    def close(self) -> None:
        """After `run` has ended for the last time."""
        self._woken.close()
        self._bell.close()
