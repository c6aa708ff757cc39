"""How a paho client is made and which protocol the broker speaks. What is done with it is in `mqtt.py`."""

from __future__ import annotations

import socket
import ssl
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any, Literal

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from services.bus import Message
from services.bus.network import Client, Network

Protocol = Literal[4, 5]
WINDOW = 1000  # messages in a turn, and in flight from the broker (its max_inflight_messages is the same)
QUEUED = 50_000  # outgoing messages that paho holds, as in a burst of a robot; more wait in the outbox
CONNECT_TIMEOUT_S = 3.0


@dataclass(frozen=True)
class Address:
    """Where the broker is and who we are there. `protocol` 5 falls back to 4 (MQTT 3.1.1) where the broker has no 5."""

    client_id: str
    host: str = "127.0.0.1"
    port: int = 1883
    user: str | None = None
    password: str | None = field(default=None, repr=False)
    tls: ssl.SSLContext | None = None
    protocol: Protocol = 5
    keepalive_s: int = 15
    durable: bool = False  # the broker keeps our messages while we are away
    inline: bool = False  # the service's own thread reads and writes: no change of threads, and no long turns


def client(address: Address, protocol: Protocol, will: Message | None = None, client_id: str = "") -> Client:
    """A client that acknowledges when told to, does not reconnect by itself and holds nothing back."""
    made = Client(
        CallbackAPIVersion.VERSION2,
        client_id=client_id or address.client_id,
        clean_session=None if protocol == 5 else not address.durable,
        protocol=MQTTProtocolVersion(protocol),
        manual_ack=True,
        reconnect_on_failure=False,
    )
    made.connect_timeout = CONNECT_TIMEOUT_S
    made.max_inflight_messages_set(WINDOW)
    made.max_queued_messages_set(QUEUED)
    if address.user is not None:
        made.username_pw_set(address.user, address.password)
    if address.tls is not None:
        made.tls_set_context(address.tls)
    if will is not None:
        made.will_set(will.topic, will.payload, qos=1, retain=will.retain)
    made.on_socket_open = _without_delay
    return made


def connect(made: paho.Client, address: Address, protocol: Protocol) -> None:
    """Opens the connection and sends CONNECT; OSError when nobody answers there."""
    made.connect(address.host, address.port, address.keepalive_s, **_session(address, protocol))


def negotiate(address: Address) -> Protocol:
    """Asks once, with the barest CONNECT of MQTT 5, whether the broker speaks it; OSError when nobody answers.

    A broker that does not (amqtt) cannot skip the properties and the will of a full one, and would never answer.
    """
    asking = client(address, 5, client_id=f"{address.client_id}-asks")
    asking.connect(address.host, address.port, address.keepalive_s)
    reason = answer(asking)
    if reason is None:
        raise OSError("the broker does not answer CONNECT")
    return 4 if reason == "Unsupported protocol version" else 5


def answer(asking: Client) -> ReasonCode | None:
    """What the broker says to the CONNECT that was sent, None when it says nothing; the connection ends with it."""
    said: list[ReasonCode] = []
    asking.on_connect = lambda _client, _data, _flags, reason, _properties: said.append(reason)
    with closing(Network()) as network:
        network.run(lambda: asking, lambda: not said and asking.socket() is not None, CONNECT_TIMEOUT_S)
    asking.disconnect()
    asking.write()
    return said[0] if said else None


def properties(message: Message, protocol: Protocol) -> Properties | None:
    """What MQTT 5 sends beside the payload; None where there is nothing, or no MQTT 5."""
    said = {"MessageExpiryInterval": message.expires_s, "CorrelationData": message.correlation,
            "ResponseTopic": message.reply_to}  # fmt: skip
    if protocol != 5 or all(value is None for value in said.values()):
        return None
    made = Properties(PacketTypes.PUBLISH)  # type: ignore[no-untyped-call]
    for name, value in said.items():
        if value is not None:
            setattr(made, name, value)
    return made


def _session(address: Address, protocol: Protocol) -> dict[str, Any]:
    if protocol != 5:
        return {}
    properties = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
    properties.ReceiveMaximum = WINDOW
    if address.durable:
        properties.SessionExpiryInterval = 0xFFFFFFFF
    return {"clean_start": not address.durable, "properties": properties}


def _without_delay(_client: paho.Client, _data: Any, sock: Any) -> None:
    """Without this and `set_tcp_nodelay` in the broker one message in a hundred takes 40 ms (Nagle and delayed ack)."""
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
