"""The broker: whether it is there, lets us in, speaks MQTT 5, keeps what it should and no commands, and is quick."""

from __future__ import annotations

import shlex
import socket
import ssl
import statistics
import time
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from services.bus import Message, connection, topic_matches
from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.client import Client
from services.config import BusSettings
from services.doctor.findings import Finding, ill, well
from services.process import address
from services.topics import HOME_COMMAND, HOME_SET, SERVICE_STATUS

PART = "broker"
ACCOUNT = "operator"
ANSWER_S = 5.0
BURSTS, BURST = 9, 3
OBEYED = (HOME_COMMAND.filter, HOME_SET.filter)  # by OpenHAB, whose binding tells no rule that a message was kept
SLOW_S = 0.03  # half of the bursts: Nagle and delayed acknowledgements cost 40 ms each time, a busy machine not half


def look(settings: BusSettings) -> Iterator[Finding]:
    """From the network upwards; what stands on something ill is not looked at."""
    where = f"{settings.host}:{settings.port}"
    try:
        at = address(settings, f"doctor-{uuid.uuid4().hex[:6]}", ACCOUNT)
        spoken = connection.negotiate(at)
    except OSError as error:
        yield _unreachable(where, error)
        return
    if spoken == 4:
        yield ill(PART, f"{where} speaks MQTT 3.1.1 only", "mosquitto 2: late orders are found out by MQTT 5 alone")
    refused = _refusal(replace(at, protocol=spoken))
    if refused:
        mend = "apartment secrets init, then apartment install --systemd for the broker's own; or bus.accounts.operator"
        yield ill(PART, f"{where} refuses {ACCOUNT}: {refused}", mend)
        return
    yield well(PART, f"{where} lets {ACCOUNT} in")
    yield from _used(replace(at, protocol=spoken))


def _unreachable(where: str, error: OSError) -> Finding:
    if isinstance(error, ssl.SSLError):
        mend = (
            "bus.tls.ca: the ca.crt of the broker's machine; bus.host: a name in its certificate, or there "
            "apartment install --systemd --host NAME"
        )
        return ill(PART, f"{where} shows a certificate that is not trusted: {error.reason or error}", mend)
    if isinstance(error, socket.gaierror):
        return ill(PART, f"nobody knows the name in {where}", "bus.host: the broker's address, or a line in /etc/hosts")
    mend = "systemctl start mosquitto; or bus.host and bus.port; from another machine by TLS at 8883 alone"
    return ill(PART, f"nothing answers at {where}: {error}", mend)


def _refusal(at: Address) -> str | None:
    """The broker's words when it does not let us in."""
    asking = connection.client(at, at.protocol)
    connection.connect(asking, at, at.protocol)
    reason = connection.answer(asking)
    if reason is None:
        return "no answer"
    return str(reason) if reason.is_failure else None


@contextmanager
def _client(at: Address) -> Iterator[Client]:
    bus = MqttBus(replace(at, client_id=f"doctor-{uuid.uuid4().hex[:6]}"))
    try:
        end = time.monotonic() + ANSWER_S
        while not bus.connected and time.monotonic() < end:
            bus.receive(0.05)
        yield Client(bus)
    finally:
        bus.close()


def _used(at: Address) -> Iterator[Finding]:
    """By a message of our own: heard at once, kept for who comes later, and how long it takes."""
    topic = SERVICE_STATUS.name(service=ACCOUNT)
    with _client(at) as speaker:
        speaker.subscribe(SERVICE_STATUS.filter)
        try:
            if not _comes(speaker, speaker, topic, kept=None):
                told = f"{ACCOUNT} may not say and hear {topic}"
                yield ill(PART, told, "the access list is not of this version: apartment install, or topics --acl FILE")
                return
            with _client(at) as late:
                late.subscribe(*OBEYED, SERVICE_STATUS.filter)  # in this order: our own word comes behind kept commands
                if not _comes(late, None, topic, kept=True):
                    told = "kept messages do not come to those who subscribe later by a wildcard"
                    yield ill(PART, told, "mosquitto 2; RabbitMQ cannot do it, NATS needs JetStream")
                    return
                yield well(PART, "it keeps states for those who come later")
                yield from _kept_commands(late.seen)
                yield _speed(speaker, late)
        finally:
            speaker.say(topic, b"", retain=True)
            speaker.pump(0.1)


def _kept_commands(heard: Iterable[Message]) -> Iterator[Finding]:
    """Each one does what it says again whenever OpenHAB connects."""
    for one in heard:
        if one.retain and any(topic_matches(wanted, one.topic) for wanted in OBEYED):
            mend = f"as {ACCOUNT}: mosquitto_pub -r -n -t {shlex.quote(one.topic)}"
            yield ill(PART, f"it keeps a command, which OpenHAB obeys at every start: {one.topic}", mend)


def _comes(listener: Client, speaker: Client | None, topic: str, *, kept: bool | None) -> bool:
    """Whether a message arrives; said again and again by the speaker, for the subscription may be late."""
    end = time.monotonic() + ANSWER_S
    while time.monotonic() < end:
        if speaker is not None:
            speaker.say(topic, "online", retain=True)
        if any(one.topic == topic and kept in (None, one.retain) for one in listener.pump(0.2)):
            return True
    return False


def _speed(asker: Client, answerer: Client) -> Finding:
    """Bursts there and back: who only listens acknowledges at once, and would hide what those wait for who speak."""
    there, back = (f"reply/{uuid.uuid4().hex[:12]}" for _ in range(2))
    answerer.subscribe(there)
    asker.subscribe(back)
    times = [_burst(asker, answerer, there, back) for _ in range(BURSTS + 1)][1:]  # the first waits for the filters
    half = statistics.median(times)
    told = f"{half * 1000:.0f} ms for {BURST} messages there and back"
    if half > SLOW_S:
        return ill(PART, told, "set_tcp_nodelay true in mosquitto.conf (see mosquitto/mosquitto.conf)")
    return well(PART, told)


def _burst(asker: Client, answerer: Client, there: str, back: str) -> float:
    asker.pump(0.02)
    begin = time.monotonic()
    for _ in range(BURST):
        asker.say(there, "a", qos=0)
    answered = came = 0
    while came < BURST and time.monotonic() < begin + ANSWER_S / BURSTS:
        for one in answerer.pump(0.0 if answered >= BURST else 0.05):
            if one.topic == there:
                answered += 1
                answerer.say(back, "b", qos=0)
        came += sum(1 for one in asker.pump(0.05 if answered >= BURST else 0.0) if one.topic == back)
    return time.monotonic() - begin
