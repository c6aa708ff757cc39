"""One contract, every bus: in memory, over the embedded broker, over a real mosquitto."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from services import peers
from services.bus import LOST_TOPIC, SESSION_TOPIC, Message, topic_matches
from services.bus.memory import Hub, MemoryBus
from services.bus.mqtt import Address, MqttBus
from services.bus.network import Client
from services.peers import embedded, free_port, mosquitto

WITHIN_S = 5.0
BIRTH = Message("service/operator/status", b"online", retain=True)
WILL = Message("service/operator/status", b"offline", retain=True)


class Kit:
    """What a test does with a bus: make clients, take the broker away and bring it back."""

    keeps_retained = True
    tells_as_published = True  # needs MQTT 5

    def __init__(self) -> None:
        self.buses: list[Any] = []

    def client(self, name: str, **options: Any) -> Any:
        bus = self.make(name, **options)
        self.buses.append(bus)
        until(lambda: bus.connected, bus)
        return bus

    def make(self, name: str, **options: Any) -> Any:
        raise AssertionError("a kit says how")

    def down(self) -> None: ...
    def back(self) -> None: ...

    def close(self) -> None:
        for bus in self.buses:
            bus.close()


class MemoryKit(Kit):
    def __init__(self) -> None:
        super().__init__()
        self.hub = Hub()

    def make(self, name: str, durable: bool = False, protocol: Any = 5, **options: Any) -> Any:
        return MemoryBus(self.hub, durable=durable, **options)

    def down(self) -> None:
        self.hub.down()

    def back(self) -> None:
        self.hub.back()


class BrokerKit(Kit):
    def __init__(self, start: Callable[[int], Any], *, inline: bool = False) -> None:
        super().__init__()
        self.start, self.inline = start, inline
        self.port = free_port()
        self.broker = ExitStack()
        self.back()

    def make(self, name: str, durable: bool = False, protocol: Any = 5, **options: Any) -> Any:
        address = Address(name, port=self.port, durable=durable, protocol=protocol, inline=self.inline)
        return MqttBus(address, **options)

    def down(self) -> None:
        self.broker.close()

    def back(self) -> None:
        self.broker.enter_context(self.start(self.port))

    def close(self) -> None:
        super().close()
        self.down()


REAL = [pytest.param(kind, marks=pytest.mark.mosquitto) for kind in ("mosquitto", "mosquitto-inline")]


@pytest.fixture(params=["memory", "embedded", *REAL])
def kit(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Kit]:
    try:
        made = make_kit(request.param, tmp_path)
    except peers.Missing as missing:
        pytest.skip(str(missing))
    yield made
    made.close()


def make_kit(kind: str, folder: Path) -> Kit:
    if kind == "memory":
        return MemoryKit()
    if kind == "embedded":
        made = BrokerKit(embedded.broker)
        made.keeps_retained = made.tells_as_published = False
        return made
    return BrokerKit(
        lambda port: mosquitto.private(folder, port=port, anonymous=True), inline=kind == "mosquitto-inline"
    )


def until(condition: Callable[[], Any], *buses: Any) -> Any:
    """Polls with the buses' own upkeep; fails loudly."""
    end = time.monotonic() + WITHIN_S
    while not (found := condition()):
        assert time.monotonic() < end, "not in time"
        for bus in buses:
            bus.receive(0.01, most=0)
    return found


def take(bus: Any, count: int, *others: Any) -> list[Message]:
    """The next messages of a bus."""
    got: list[Message] = []
    end = time.monotonic() + WITHIN_S
    while len(got) < count:
        assert time.monotonic() < end, f"only {got}"
        got += news(bus.receive(0.02))
        for other in others:
            other.receive(most=0)
    bus.ack(got)
    return got


def listen(bus: Any, *filters: str) -> None:
    """Subscribes and waits until the broker has granted it: a word to oneself comes back.

    It is said again until then: amqtt may hand on a word before it has entered the subscription that came first.
    """
    bus.subscribe([*filters, "reply/granted"])

    def granted() -> bool:
        bus.publish(Message("reply/granted", bus_id(bus)))
        return any(m.payload == bus_id(bus) for m in bus.receive(0.2))

    until(granted)


def bus_id(bus: Any) -> bytes:
    return str(id(bus)).encode()


def news(messages: list[Message]) -> list[Message]:
    """Without what `listen` said to itself."""
    return [m for m in messages if m.topic != "reply/granted"]


def test_a_message_reaches_who_asked_for_it_and_nobody_else(kit: Kit) -> None:
    speaker, listener, deaf = kit.client("speaker"), kit.client("listener"), kit.client("deaf")
    listen(listener, "reply/+/a")
    listen(deaf, "reply/+/b")
    speaker.publish(Message("reply/1/a", "21.5 °C".encode()))
    speaker.publish(Message("reply/1/b", b"x"))
    assert [(m.topic, m.payload, m.retain) for m in take(listener, 1, speaker)] == [
        ("reply/1/a", "21.5 °C".encode(), False)
    ]
    assert [m.topic for m in take(deaf, 1)] == ["reply/1/b"]
    assert news(listener.receive(0.05)) == []


def test_whenever_it_subscribes_it_hears_before_during_and_after_connecting(kit: Kit) -> None:
    speaker = kit.client("speaker")
    for pause in (0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3):  # on loopback a connection takes some milliseconds
        late = kit.make(f"late{pause}")
        kit.buses.append(late)
        threading.Event().wait(pause)  # a service that is still importing: nothing receives yet
        late.subscribe(["reply/late"])
        until(lambda bus=late: bus.connected, late)
        listen(late)
        speaker.publish(Message("reply/late", str(pause).encode()))
        assert take(late, 1, speaker)[-1].payload == str(pause).encode()


def test_who_listens_hears_the_very_next_word_however_long_the_broker_takes_to_grant_that(
    kit: Kit, monkeypatch: pytest.MonkeyPatch
) -> None:
    asks, speaker = Client.ask_for, kit.client("speaker")
    until(lambda: speaker.listens, speaker)

    def ask_late(client: Client, *filters: Any) -> None:
        threading.Event().wait(0.1)
        asks(client, *filters)

    monkeypatch.setattr(Client, "ask_for", ask_late)
    for turn in range(5):
        late = kit.make(f"late{turn}")
        kit.buses.append(late)
        late.subscribe(["reply/late"])
        until(lambda bus=late: bus.listens, late)
        speaker.publish(Message("reply/late", str(turn).encode()))
        assert [message.payload for message in take(late, 1, speaker)] == [str(turn).encode()]


def test_order_is_kept(kit: Kit) -> None:
    speaker, listener = kit.client("speaker"), kit.client("listener")
    listen(listener, "reply/#")
    for number in range(500):
        speaker.publish(Message("reply/n", str(number).encode()))
    assert [int(m.payload) for m in take(listener, 500, speaker)] == list(range(500))


def test_who_comes_later_gets_the_retained_state_marked_as_such(kit: Kit) -> None:
    speaker, witness = kit.client("speaker"), kit.client("witness")
    listen(speaker, "reply/e")
    speaker.publish(Message("reply/s", b"1", retain=True))
    speaker.publish(Message("reply/s", b"2", retain=True))
    speaker.publish(Message("reply/e", b"event"))
    take(speaker, 1)  # the broker has all three
    witness.subscribe(["reply/#"])
    first = take(witness, 1, speaker)[0]
    assert (first.topic, first.payload, first.retain) == ("reply/s", b"2", True)


@pytest.mark.parametrize("late", [False, True])
def test_who_asks_for_it_is_told_whether_a_word_was_said_to_be_kept(kit: Kit, late: bool) -> None:
    if not kit.tells_as_published:
        pytest.skip("the embedded broker speaks MQTT 3.1.1")
    speaker, listener = kit.client("speaker"), kit.make("listener")
    kit.buses.append(listener)
    until(lambda: listener.connected or not late, listener)  # asked for with the connection, or later
    listener.subscribe(["reply/+/do", "reply/+/is"], ["reply/+/do"])
    listen(listener)
    for topic in ("reply/1/do", "reply/1/is"):
        speaker.publish(Message(topic, b"kept", retain=True))
        speaker.publish(Message(topic, b"said"))
    told = {(m.topic, m.payload): m.retain for m in take(listener, 4, speaker)}
    assert told == {
        ("reply/1/do", b"kept"): True, ("reply/1/do", b"said"): False,
        ("reply/1/is", b"kept"): False, ("reply/1/is", b"said"): False,
    }  # fmt: skip


def test_many_that_come_at_once_are_all_heard_and_hear(kit: Kit) -> None:
    names = [f"service/{number}/status" for number in range(20)]
    first = kit.client("first")
    for name in names:
        first.publish(Message(name, b"before", retain=True))
    buses = [kit.make(name.replace("/", "-")) for name in names]
    kit.buses += buses
    for name, bus in zip(names, buses, strict=True):
        bus.subscribe([name])
    until(lambda: all(bus.connected for bus in buses), *buses)
    for name, bus in zip(names, buses, strict=True):
        bus.publish(Message(name, b"online", retain=True))
    heard: dict[str, set[bytes]] = {name: set() for name in names}

    def all_heard() -> bool:
        for name, bus in zip(names, buses, strict=True):
            came = bus.receive(0.001)
            bus.ack(came)
            heard[name] |= {message.payload for message in news(came) if message.topic == name}
        return all(b"online" in one for one in heard.values())

    until(all_heard)


def test_posting_wakes_the_receiver_from_any_thread(kit: Kit) -> None:
    bus = kit.client("one")
    bus.post(Message("/local", value={"any": "object"}))
    assert take(bus, 1)[0].value == {"any": "object"}


def test_who_wants_to_know_is_told_once_that_the_connection_broke(kit: Kit) -> None:
    curious, other = kit.client("curious"), kit.client("other")
    curious.subscribe([LOST_TOPIC, "home/Lamp/state"])
    other.subscribe(["home/Lamp/state"])
    kit.down()
    assert [one.topic for one in take(curious, 1)] == [LOST_TOPIC]
    kit.back()
    until(lambda: curious.connected and other.connected, curious, other)
    sender = kit.client("sender")
    sender.publish(Message("home/Lamp/state", b"ON", retain=True))
    assert [one.topic for one in take(curious, 1, sender)] == ["home/Lamp/state"]
    assert [one.topic for one in take(other, 1, sender)] == ["home/Lamp/state"]


def test_a_connection_says_birth_and_a_clean_end_says_the_will(kit: Kit) -> None:
    watcher = kit.client("watcher")
    listen(watcher, "service/+/status")
    one = kit.client("one", birth=BIRTH, will=WILL)
    assert take(watcher, 1, one)[-1].payload == b"online"
    kit.buses.remove(one)
    one.close()
    assert take(watcher, 1)[-1].payload == b"offline"


def test_after_a_restart_of_the_broker_everyone_hears_and_is_heard_within_two_seconds(kit: Kit) -> None:
    speaker, listener = kit.client("speaker", birth=BIRTH, will=WILL), kit.client("listener")
    listen(listener, "reply/#", "service/#")
    speaker.publish(Message("reply/state", b"still true", retain=True))
    take(listener, 1, speaker)
    kit.down()
    until(lambda: not speaker.connected and not listener.connected, speaker, listener)
    kit.back()
    start = time.monotonic()
    until(lambda: speaker.connected and listener.connected, speaker, listener)
    assert time.monotonic() - start < 2.0
    speaker.publish(Message("reply/event", b"again"))
    heard = {m.topic: m.payload for m in take(listener, 3, speaker)}
    heard.update({m.topic: m.payload for m in listener.receive(0.3)})
    assert heard["reply/event"] == b"again"
    assert heard["service/operator/status"] == b"online"
    assert heard["reply/state"] == b"still true"
    assert (speaker.connections, listener.connections) == (2, 2)


def test_while_the_broker_is_away_events_wait_states_are_remembered_and_commands_die(kit: Kit) -> None:
    speaker = kit.client("speaker")
    kit.down()
    until(lambda: not speaker.connected, speaker)
    speaker.publish(Message("reply/e", b"first"))
    speaker.publish(Message("reply/s", b"old", retain=True))
    speaker.publish(Message("reply/s", b"new", retain=True))
    speaker.publish(Message("reply/c", b"move!", expires_s=5))
    speaker.publish(Message("reply/e", b"second"))
    assert speaker.dropped == 1
    kit.back()
    listener = kit.client("listener")
    listener.subscribe(["reply/#"])
    until(lambda: speaker.connected, speaker)
    heard = [(m.topic, m.payload) for m in take(listener, 1, speaker) + listener.receive(0.3) + listener.receive(0.3)]
    assert ("reply/s", b"new") in heard
    assert ("reply/s", b"old") not in heard
    assert not [topic for topic, _ in heard if topic == "reply/c"]


def test_events_of_an_outage_come_in_order_to_who_listens_again(kit: Kit) -> None:
    listener, speaker = kit.client("listener"), kit.client("speaker")
    listen(listener, "reply/#")
    kit.down()
    until(lambda: not speaker.connected and not listener.connected, speaker, listener)
    for number in range(3):
        speaker.publish(Message("reply/e", str(number).encode()))
    kit.back()
    until(lambda: listener.connected, listener)
    until(lambda: speaker.connected, speaker)
    heard = [m.payload for m in news(listener.receive(1.0) + listener.receive(0.3))]
    assert heard == sorted(heard)  # those that came before the listener was there again are events it missed


def test_a_full_outbox_drops_the_oldest_event_and_counts_it(kit: Kit) -> None:
    speaker = kit.client("speaker")
    kit.down()
    until(lambda: not speaker.connected, speaker)
    for number in range(1003):
        speaker.publish(Message("reply/e", str(number).encode()))
    assert speaker.dropped == 3


def test_a_durable_client_gets_what_it_has_not_acknowledged_again(kit: Kit) -> None:
    speaker = kit.client("speaker")
    durable = kit.client("durable", durable=True, protocol=4)
    listen(durable, "reply/#")
    speaker.publish(Message("reply/1", b"done"))
    take(durable, 1, speaker)
    speaker.publish(Message("reply/2", b"not done"))
    held = until(lambda: durable.receive(0.05), speaker)
    assert [m.payload for m in held] == [b"not done"]
    if not kit.keeps_retained:
        pytest.skip("the embedded broker keeps no sessions over a restart")
    kit.down()
    until(lambda: not durable.connected, durable)
    kit.back()
    durable.ack(held)  # of the connection before: the broker must not hear it
    until(lambda: durable.connected, durable)
    again = until(lambda: [m for m in durable.receive(0.05) if m.payload == b"not done"], durable)
    durable.ack(again)
    assert len(again) == 1
    assert not held[0].token.again
    assert (again[0].token.packet, again[0].token.again) == (held[0].token.packet, True)


@pytest.mark.mosquitto
def test_who_subscribes_after_the_connection_is_made_is_told_of_the_session(mosquitto_broker: mosquitto.Broker) -> None:
    for kept in (False, True):
        bus = MqttBus(Address("durable", port=mosquitto_broker.port, protocol=4, durable=True))
        until(lambda: bus.connected, bus)  # noqa: B023
        bus.subscribe([SESSION_TOPIC, "reply/#"])
        told = until(lambda: bus.receive(0.05), bus)  # noqa: B023
        assert [(one.topic, one.value) for one in told] == [(SESSION_TOPIC, kept)]
        bus.close()


def test_response_topic_and_correlation_travel_where_the_broker_knows_them(kit: Kit) -> None:
    speaker, listener = kit.client("speaker"), kit.client("listener")
    listen(listener, "reply/#")
    speaker.publish(Message("reply/q", b"?", reply_to="reply/here", correlation=b"\x01\x02"))
    asked = take(listener, 1, speaker)[0]
    if getattr(listener, "_protocol", 5) == 4:
        assert (asked.reply_to, asked.correlation) == (None, None)
    else:
        assert (asked.reply_to, asked.correlation) == ("reply/here", b"\x01\x02")


@pytest.mark.parametrize(
    ("topic_filter", "topic", "matches"),
    [
        ("a/b", "a/b", True), ("a/b", "a/b/c", False), ("a/+", "a/b", True), ("a/+", "a", False), ("a/+", "a/", True),
        ("+/b", "a/b", True), ("#", "a/b", True), ("#", "$SYS/x", False), ("+/x", "$SYS/x", False), ("a/#", "a", True),
        ("a/#", "a/b/c", True), ("a/#", "b", False), ("$SYS/#", "$SYS/x", True),
        ("$share/g/a/+", "a/b", True), ("$share/g/a/+", "b/b", False), ("a/+/c", "a/b/c", True),
    ],
)  # fmt: skip
def test_filters_match_as_mqtt_says(topic_filter: str, topic: str, matches: bool) -> None:
    assert topic_matches(topic_filter, topic) is matches
