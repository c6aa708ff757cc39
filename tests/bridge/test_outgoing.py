"""What a subscriber is sent, and in which order, without ROS: connections as rospy's topic has them."""

from __future__ import annotations

import threading
from typing import Any

from services.bridge.outgoing import Outgoing


class Connection:
    """One subscriber's; `written` is what reached it, write by write."""

    def __init__(self, topic: Topic, *, broken: bool = False) -> None:
        self.topic, self.broken = topic, broken
        self.written: list[bytes] = []
        topic.connections.append(self)

    def write_data(self, data: bytes) -> None:
        if self.broken:
            raise OSError("gone")
        self.written.append(data)

    def close(self) -> None:
        """As rospy does: under its own lock it tells the listener."""
        with self.topic.lock:
            self.topic.connections.remove(self)
            self.topic.outgoing.peer_unsubscribe("/t", len(self.topic.connections))


class Topic:
    """rospy's side of a topic."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.connections: list[Any] = []
        self.outgoing = Outgoing((OSError,))
        self.outgoing.attach(self)

    def joins(self, *, broken: bool = False) -> Connection:
        connection = Connection(self, broken=broken)
        self.outgoing.peer_subscribe("/t", None, None)
        return connection


def test_all_that_a_turn_says_is_one_write() -> None:
    topic = Topic()
    one = topic.joins()
    for data in (b"a", b"b", b"c"):
        topic.outgoing.say(data)
    assert one.written == []
    topic.outgoing.flush()
    topic.outgoing.flush()
    assert one.written == [b"abc"]


def test_a_newcomer_gets_what_is_kept_and_nobody_anything_twice() -> None:
    topic = Topic()
    early = topic.joins()
    topic.outgoing.say(b"lamp on ", "lamp")
    topic.outgoing.say(b"lamp off ", "lamp")
    topic.outgoing.say(b"door ", "door")
    late = topic.joins()  # before the turn has ended
    topic.outgoing.flush()
    assert b"".join(early.written) == b"lamp on lamp off door "
    assert b"".join(late.written) == b"lamp off door "
    topic.outgoing.again()
    topic.outgoing.flush()
    assert late.written[-1] == early.written[-1] == b"lamp off door "


def test_what_is_kept_waits_for_the_first_subscriber() -> None:
    topic = Topic()
    topic.outgoing.say(b"news")
    topic.outgoing.say(b"state", "")
    assert topic.joins().written == [b"state"]


def test_who_has_gone_is_let_go_and_the_others_hear_on() -> None:
    topic = Topic()
    here, gone = topic.joins(), topic.joins(broken=True)
    assert topic.outgoing.listeners == 2
    topic.outgoing.say(b"a")
    topic.outgoing.flush()
    assert (here.written, topic.outgoing.listeners, gone in topic.connections) == ([b"a"], 1, False)


def test_rospy_may_tell_us_of_one_while_we_write_to_another() -> None:
    topic = Topic()
    topic.joins(broken=True)
    with topic.lock:  # rospy is about to close somebody
        writer = threading.Thread(target=lambda: (topic.outgoing.say(b"a"), topic.outgoing.flush()), daemon=True)
        writer.start()
        topic.outgoing.peer_unsubscribe("/t", 1)
    writer.join(10.0)
    assert not writer.is_alive()
