"""The programs of the bridge's benchmark, each a process of its own: publishers, subscribers, and the bare loops.

`python -m tests.bridge.bench_parts PART {json}`; each says `READY` when it may begin, and what it measured as JSON.
Payloads are the time of sending in ns of the monotonic clock, which all processes of a machine share.
"""

from __future__ import annotations

import json
import socket
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import paho.mqtt.client as paho

QUIET_S = 5.0  # nothing came for so long: the rest is lost
WINDOW = 500
HERE = "127.0.0.1"


class Tally:
    """What a subscriber saw."""

    def __init__(self, count: int) -> None:
        self.count, self.done = count, threading.Event()
        self.times: list[float] = []
        self.first = self.last = 0.0
        self.since = time.monotonic_ns()  # what is kept for newcomers was sent before

    def take(self, sent_ns: str) -> None:
        """A message that was sent then."""
        now = time.monotonic_ns()
        if int(sent_ns) < self.since:
            return
        self.times.append((now - int(sent_ns)) / 1e6)
        self.last = now / 1e9
        if len(self.times) == 1:
            self.first = self.last
        if len(self.times) >= self.count:
            self.done.set()

    def say(self) -> None:
        """Waits for the last, or until no more come."""
        while not self.done.wait(QUIET_S):
            if self.times and time.monotonic() - self.last > QUIET_S:
                break
        rate = (len(self.times) - 1) / max(self.last - self.first, 1e-9) if self.times else 0.0
        late = sorted(self.times) or [0.0]
        tell({"came": len(self.times), "rate": rate, "p50": late[len(late) // 2], "p99": late[len(late) * 99 // 100],
              "max": late[-1]})  # fmt: skip


def tell(what: Any) -> None:
    sys.stdout.write(f"{what if isinstance(what, str) else json.dumps(what)}\n")
    sys.stdout.flush()


def blast(port: int, topics: list[str], qos: int, count: int, rate: float) -> None:
    """A publisher over a bare socket: `rate` messages per second, 0 for as fast as the broker takes them."""
    with socket.create_connection((HERE, port)) as link:
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        link.sendall(b"\x10\x10\x00\x04MQTT\x04\x02\x00\x3c\x00\x04fast")
        assert link.recv(4)[3] == 0, "refused"
        tell("READY")
        sys.stdin.readline()
        names = [len(topic).to_bytes(2, "big") + topic.encode() for topic in topics]
        acknowledged, began = 0, time.monotonic()
        for number in range(count):
            if rate:
                while (wait := began + number / rate - time.monotonic()) > 0:
                    threading.Event().wait(wait)
            mid = (number % 65535 + 1).to_bytes(2, "big") if qos else b""
            body = names[number % len(names)] + mid + b"%d" % time.monotonic_ns()
            link.sendall(bytes([0x30 | qos << 1, len(body)]) + body)
            while qos and (number + 1) % WINDOW == 0 and acknowledged < 4 * (number + 1 - WINDOW // 2):
                acknowledged += len(link.recv(65536))
        while qos and acknowledged < 4 * count:
            acknowledged += len(link.recv(65536))
        link.sendall(b"\xe0\x00")


def mqtt_client(port: int, name: str) -> paho.Client:
    client = paho.Client(paho.CallbackAPIVersion.VERSION2, client_id=name, protocol=paho.MQTTv311)
    client.max_inflight_messages_set(1000)
    client.on_socket_open = lambda _c, _d, sock: sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    client.connect(HERE, port)
    return client


def hear_mqtt(port: int, topic: str, qos: int, count: int) -> None:
    """A bare paho subscriber: the floor of everything that ends on MQTT."""
    tally = Tally(count)
    client = mqtt_client(port, "hears")
    client.on_message = lambda _c, _d, message: tally.take(message.payload.decode())
    client.on_subscribe = lambda *_: tell("READY")
    client.subscribe(topic, qos=qos)
    client.loop_start()
    tally.say()
    client.loop_stop()


def ros(name: str) -> Any:
    import rospy

    rospy.init_node(name, anonymous=True, disable_rosout=True, disable_signals=True)
    return rospy


def hear_ros(topic: str, count: int) -> None:
    """A rospy subscriber. It counts what carries a time; what is kept for newcomers came before."""
    from diagnostic_msgs.msg import KeyValue

    rospy, tally = ros("hears"), Tally(count)
    publishers = rospy.Subscriber(
        topic, KeyValue, lambda message: tally.take(message.value), tcp_nodelay=True, buff_size=2**20
    )
    connected(publishers)
    tell("READY")
    tally.say()


def connected(end: Any) -> None:
    """Waits for the other end. A subscriber counts those that it has only begun to call: it must have their answer."""
    while not any(one.type or one.direction == "o" for one in end.impl.connections):
        threading.Event().wait(0.05)


def say_ros(topic: str, keys: list[str], count: int, rate: float) -> None:
    """A rospy publisher."""
    from diagnostic_msgs.msg import KeyValue

    rospy = ros("says")
    publisher = rospy.Publisher(topic, KeyValue, tcp_nodelay=True, queue_size=count)
    connected(publisher)
    tell("READY")
    sys.stdin.readline()
    began = time.monotonic()
    for number in range(count):
        while rate and (wait := began + number / rate - time.monotonic()) > 0:
            threading.Event().wait(wait)
        publisher.publish(keys[number % len(keys)], str(time.monotonic_ns()))
    sys.stdin.readline()


def round_trip(out: str, back: str, count: int, rate: float) -> None:
    """Says and hears: there and back again."""
    from diagnostic_msgs.msg import KeyValue

    rospy, tally = ros("trips"), Tally(count)
    subscriber = rospy.Subscriber(back, KeyValue, lambda message: tally.take(message.value), tcp_nodelay=True)
    publisher = rospy.Publisher(out, KeyValue, tcp_nodelay=True, queue_size=100)
    connected(subscriber)
    connected(publisher)
    tell("READY")
    began = time.monotonic()
    for number in range(count):
        threading.Event().wait(max(0.0, began + number / rate - time.monotonic()))
        publisher.publish("trip", str(time.monotonic_ns()))
    tally.say()


def newcomer(topic: str, count: int) -> None:
    """How long a new subscriber waits for everything that is kept, from its making."""
    from diagnostic_msgs.msg import KeyValue

    rospy, came, done = ros("late"), [], threading.Event()

    def take(message: Any) -> None:
        came.append(time.monotonic())
        if len(came) == count:
            done.set()

    began = time.monotonic()
    rospy.Subscriber(topic, KeyValue, take, tcp_nodelay=True)
    done.wait(30.0)
    tell({"came": len(came), "snapshot": 1000 * (came[-1] - came[0]), "whole": 1000 * (came[-1] - began)})


def loop_to_ros(port: int, mqtt: str, topic: str, qos: int) -> None:
    """The second floor: paho's callback publishes on rospy, and nothing else."""
    from diagnostic_msgs.msg import KeyValue

    rospy = ros("loop")
    publisher = rospy.Publisher(topic, KeyValue, tcp_nodelay=True, queue_size=20_000)
    client = mqtt_client(port, "loop-to-ros")

    def pass_on(_client: Any, _data: Any, message: Any) -> None:
        publisher.publish(message.topic.split("/")[1], message.payload.decode())

    client.on_message = pass_on
    client.on_subscribe = lambda *_: tell("READY")
    client.subscribe(mqtt, qos=qos)
    client.loop_start()
    sys.stdin.readline()


def loop_to_mqtt(port: int, topic: str, qos: int) -> None:
    """The same the other way."""
    from diagnostic_msgs.msg import KeyValue

    rospy = ros("loop")
    client = mqtt_client(port, "loop-to-mqtt")
    client.loop_start()
    rospy.Subscriber(
        topic, KeyValue, lambda message: client.publish(f"flat/{qos}/{message.key}", message.value, qos=qos),
        tcp_nodelay=True,
    )  # fmt: skip
    tell("READY")
    sys.stdin.readline()


def traffic(out: str, back: str, keys: list[str], rate: float) -> None:
    """Once it is let, says numbers for ever; tells a few times a second which it said, with when, and what it heard."""
    from diagnostic_msgs.msg import KeyValue

    rospy, lock = ros("traffic"), threading.Lock()
    heard: list[tuple[str, str]] = []
    said: list[tuple[int, float]] = []

    def take(message: Any) -> None:
        with lock:
            heard.append((message.key, message.value))

    subscriber = rospy.Subscriber(back, KeyValue, take, tcp_nodelay=True)
    publisher = rospy.Publisher(out, KeyValue, tcp_nodelay=True, queue_size=10_000)
    connected(subscriber)
    connected(publisher)
    tell("READY")
    sys.stdin.readline()
    began, number = time.monotonic(), 0
    while True:
        threading.Event().wait(0.2)
        while number < (time.monotonic() - began) * rate:
            said.append((number, time.monotonic()))
            publisher.publish(keys[number % len(keys)], str(number))
            number += 1
        with lock:
            taken, heard[:] = list(heard), []
        tell({"heard": taken, "said": said})
        said = []


PARTS: dict[str, Callable[..., None]] = {
    part.__name__: part
    for part in (blast, hear_mqtt, hear_ros, say_ros, round_trip, newcomer, loop_to_ros, loop_to_mqtt, traffic)
}

if __name__ == "__main__":
    PARTS[sys.argv[1]](**json.loads(sys.argv[2]))
    sys.stdout.flush()
    import os

    os._exit(0)  # rospy's threads would not end
