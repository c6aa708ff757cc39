"""The network loop: whatever pieces a broker's bytes come in, and however many files are open."""

from __future__ import annotations

import os
import random
import resource
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from types import SimpleNamespace

import pytest
from paho.mqtt.client import Client as Paho
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from services.bus import Delivery, Message, inbox
from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.bus.network import Client
from services.peers import mosquitto, wait_until

CONNACK = {4: b"\x20\x02\x00\x00", 5: b"\x20\x03\x00\x00\x00"}
TOO_MANY = 1024  # descriptors, for `select.select`


@contextmanager
def client(protocol: int) -> Iterator[tuple[Client, socket.socket, list[Message]]]:
    """A client of ours that has connected, the broker's end of its connection, and what came."""
    came: list[Message] = []
    with socket.create_server(("127.0.0.1", 0)) as server:
        made = Client(CallbackAPIVersion.VERSION2, "one", protocol=MQTTProtocolVersion(protocol), manual_ack=True)
        made.on_came, made.clock, made.number = came.append, lambda: 7.0, 3
        made.connect(*server.getsockname())
        broker, _ = server.accept()
        made.write()
        with broker:
            broker.recv(4096)
            broker.sendall(CONNACK[protocol])
            read_until(made, made.is_connected)
            yield made, broker, came
        read_until(made, lambda: made.socket() is None)


def read_until(made: Client, condition: object) -> None:
    assert callable(condition)

    def look() -> bool:
        made.read()
        return bool(condition())

    wait_until(look, "what the broker sent")


def publish(protocol: int, topic: str, payload: bytes, qos: int, **properties: object) -> bytes:
    """A PUBLISH as paho sends it, from a client that has no connection."""
    made = Paho(CallbackAPIVersion.VERSION2, protocol=MQTTProtocolVersion(protocol))
    sent: list[bytes] = []
    made._sock, made._packet_queue = True, lambda _c, packet, *_: sent.append(bytes(packet))  # type: ignore[assignment]
    said = Properties(PacketTypes.PUBLISH) if properties else None  # type: ignore[no-untyped-call]
    for name, value in properties.items():
        setattr(said, name, value)
    made._send_publish(9, topic.encode(), payload, qos, retain=False, properties=said)
    made._sock = None
    return sent[0]


@pytest.mark.parametrize("protocol", [4, 5])
def test_messages_come_whole_in_whatever_pieces_the_network_cuts_them(protocol: int) -> None:
    rng, asked = random.Random(1), {"ResponseTopic": "reply/here", "CorrelationData": b"\x01"}
    texts = [(f"home/Ü{n}/state", rng.randbytes(rng.choice([0, 1, 100, 130, 20_000])), n % 2) for n in range(300)]
    data = b"".join(publish(protocol, *text) for text in texts)
    data += publish(protocol, "ask", b"?", 1, **(asked if protocol == 5 else {}))
    with client(protocol) as (made, broker, came):
        broker.setblocking(False)
        while data or len(came) <= len(texts):
            with suppress(BlockingIOError):
                data = data[broker.send(data[: rng.choice([1, 2, 3, 50, 5000, 100_000])]) :] if data else data
            made.read()
        told = (asked["ResponseTopic"], asked["CorrelationData"]) if protocol == 5 else (None, None)
        assert [(one.topic, one.payload, one.qos) for one in came[:-1]] == texts
        assert came[0] == Message(*texts[0][:2], qos=0, received=7.0, token=Delivery(3, 0, again=False))
        assert (came[-1].token, came[-1].reply_to, came[-1].correlation) == (Delivery(3, 9, again=False), *told)


@pytest.mark.parametrize(
    ("protocol", "packet"),
    [
        (4, b"\x30\x01\x00"),  # no room for the length of the topic
        (4, b"\x30\x03\x00\x05a"),  # a topic that is shorter than it says
        (4, b"\x32\x04\x00\x01a\x00"),  # half a packet id
        (4, b"\x30\x03\x00\x01\xff"),  # no UTF-8
        (4, b"\x34\x05\x00\x01a\x00\x01"),  # QoS 2, which nobody asked for
        (5, b"\x30\x03\x00\x01a"),  # no properties
        (5, b"\x30\x05\x00\x01a\x09\x00"),  # properties that are shorter than they say
        (5, b"\x30\x06\x00\x01a\x02\x7f\x00"),  # a property that nobody knows
    ],
)
def test_a_broker_that_talks_nonsense_is_left(protocol: int, packet: bytes) -> None:
    with client(protocol) as (made, broker, came):
        broker.sendall(packet)
        read_until(made, lambda: made.socket() is None)
        assert came == []


@pytest.mark.mosquitto
@pytest.mark.parametrize("inline", [False, True])
def test_it_works_with_more_files_open_than_select_can_watch(
    mosquitto_broker: mosquitto.Broker, *, inline: bool
) -> None:
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard <= 2 * TOO_MANY:
        pytest.skip(f"{hard} files at most may be open here")
    with ExitStack() as stack:
        stack.callback(resource.setrlimit, resource.RLIMIT_NOFILE, resource.getrlimit(resource.RLIMIT_NOFILE))
        resource.setrlimit(resource.RLIMIT_NOFILE, (2 * TOO_MANY, hard))
        while (number := os.open(os.devnull, os.O_RDONLY)) < TOO_MANY:
            stack.callback(os.close, number)
        stack.callback(os.close, number)
        bus = MqttBus(Address("many", port=mosquitto_broker.port, inline=inline))
        stack.callback(bus.close)
        bus.subscribe(["reply/many"])
        heard, end = False, time.monotonic() + 10.0
        while not heard:
            assert time.monotonic() < end, "nothing came"
            bus.publish(Message("reply/many", b"1"))
            heard = bool(bus.receive(0.1))


@pytest.mark.parametrize(("every_s", "gathers"), [(0.001, False), (0.0001, True)], ids=["1,000/s", "10,000/s"])
def test_only_a_flood_is_left_to_gather(monkeypatch: pytest.MonkeyPatch, every_s: float, gathers: bool) -> None:
    """At 1,000 a second a turn of 5 ms takes five at once, and whoever waits for those is not made to wait longer."""
    now, slept = [0.0], list[float]()
    monkeypatch.setattr(
        inbox, "time", SimpleNamespace(time=time.time, monotonic=lambda: now[0], sleep=slept.append), raising=True
    )
    bus = MqttBus(Address("gathering", port=1))
    try:
        for _turn in range(10):
            now[0] += 0.005
            for _ in range(round(0.005 / every_s)):
                bus.post(Message("home/Light/state"))
            assert len(bus.receive()) == round(0.005 / every_s)
    finally:
        bus.close()
    assert slept == ([inbox.GATHER_S] * 9 if gathers else [])
