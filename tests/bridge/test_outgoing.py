"""What a subscriber is sent, and in which order, without ROS: connections as rospy's topic has them, over sockets."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from services.bridge.outgoing import Outgoing
from services.peers import wait_until

QUEUE = 3
PIECE = b"0123456789abcdef" * 65536  # more than the kernel takes of a subscriber that does not read


class Connection:
    """One subscriber's, as rospy has it: a blocking socket, and two counters."""

    def __init__(self, topic: Topic) -> None:
        self.topic = topic
        self.socket, self.peer = socket.socketpair()
        self.peer.settimeout(10.0)
        self.stat_bytes = self.stat_num_msg = 0
        topic.connections.append(self)

    def heard(self, count: int = 65536) -> bytes:
        """All of `count` bytes that it was sent; fewer when no more are there."""
        data = b""
        while len(data) < count:
            self.peer.setblocking(False)
            try:
                more = self.peer.recv(count - len(data))
            except BlockingIOError:
                break
            data += more
        return data

    def hears(self, count: int) -> bytes:
        """Waits for so many."""
        self.peer.settimeout(10.0)
        data = bytearray()
        while len(data) < count:
            more = self.peer.recv(count - len(data))
            assert more, "closed"
            data += more
        return bytes(data)

    def close(self) -> None:
        """As rospy does: under its own lock it tells the listener."""
        self.socket.close()
        with self.topic.lock:
            if self in self.topic.connections:
                self.topic.connections.remove(self)
                self.topic.outgoing.peer_unsubscribe("/t", len(self.topic.connections))


class Topic:
    """rospy's side of a topic."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.connections: list[Any] = []
        self.all: list[Connection] = []
        self.outgoing = Outgoing(QUEUE)
        self.outgoing.attach(self)

    def joins(self) -> Connection:
        connection = Connection(self)
        self.all.append(connection)
        self.outgoing.peer_subscribe("/t", None, None)
        return connection

    def says(self, data: bytes) -> None:
        self.outgoing.say(data)
        self.outgoing.flush()


@pytest.fixture
def topic() -> Iterator[Topic]:
    made = Topic()
    yield made
    for connection in made.all:
        connection.peer.close()
        connection.close()


def test_all_that_a_turn_says_is_one_write(topic: Topic) -> None:
    one = topic.joins()
    for data in (b"a", b"b", b"c"):
        topic.outgoing.say(data)
    assert one.heard() == b""
    topic.outgoing.flush()
    topic.outgoing.flush()
    assert (one.heard(), one.stat_num_msg) == (b"abc", 1)


def test_a_newcomer_gets_what_is_kept_and_nobody_anything_twice(topic: Topic) -> None:
    early = topic.joins()
    topic.outgoing.say(b"lamp on ", "lamp")
    topic.outgoing.say(b"lamp off ", "lamp")
    topic.outgoing.say(b"door ", "door")
    late = topic.joins()  # before the turn has ended
    topic.outgoing.flush()
    assert early.heard() == b"lamp on lamp off door "
    assert late.heard() == b"lamp off door "
    topic.outgoing.again()
    topic.outgoing.flush()
    assert late.heard() == early.heard() == b"lamp off door "


def test_what_is_kept_waits_for_the_first_subscriber(topic: Topic) -> None:
    topic.outgoing.say(b"news")
    topic.outgoing.say(b"state", "")
    assert topic.joins().heard() == b"state"


def test_who_does_not_read_holds_up_nobody_and_misses_the_oldest(topic: Topic) -> None:
    slow, quick = topic.joins(), topic.joins()
    topic.says(PIECE)  # begun, so it must become whole
    assert quick.hears(len(PIECE)) == PIECE
    began = time.monotonic()
    for number in range(10):
        topic.says(b"turn %d " % number)
        assert quick.hears(7) == b"turn %d " % number
    assert time.monotonic() - began < 5.0
    kept = b"turn 7 turn 8 turn 9 "
    assert slow.hears(len(PIECE) + len(kept)) == PIECE + kept
    wait_until(lambda: not slow_threads(), "nobody behind")
    topic.says(b"live")
    assert slow.hears(4) == b"live"


def test_a_slow_one_that_goes_is_let_go(topic: Topic) -> None:
    slow = topic.joins()
    topic.says(PIECE)
    topic.says(b"waits")
    slow.peer.close()
    wait_until(lambda: not slow_threads(), "its thread ended")
    topic.says(b"a")
    assert (topic.outgoing.listeners, topic.connections) == (0, [])


def slow_threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "slow subscriber"]


def test_who_has_gone_is_let_go_and_the_others_hear_on(topic: Topic) -> None:
    here, gone = topic.joins(), topic.joins()
    gone.peer.close()
    assert topic.outgoing.listeners == 2
    topic.says(b"a")
    assert (here.heard(), topic.outgoing.listeners, gone in topic.connections) == (b"a", 1, False)


def test_rospy_may_tell_us_of_one_while_we_write_to_another(topic: Topic) -> None:
    topic.joins().peer.close()
    with topic.lock:  # rospy is about to close somebody
        writer = threading.Thread(target=lambda: topic.says(b"a"), daemon=True)
        writer.start()
        topic.outgoing.peer_unsubscribe("/t", 1)
    writer.join(10.0)
    assert not writer.is_alive()
