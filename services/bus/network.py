"""The network loop of paho, run by ourselves: it reads all that has come at each wait, and writes in one piece.

paho's own loop waits before each packet, asks the kernel for a byte or two at a time, and writes each packet by
itself. Not here: what a message is and what becomes of it (`mqtt.py`).
"""

from __future__ import annotations

import math
import select
import socket
import ssl
import struct
import time
from collections import deque
from collections.abc import Callable, Container, Iterable
from contextlib import suppress
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import MessageType, MQTTErrorCode, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import MalformedPacket, Properties  # type: ignore[attr-defined]
from paho.mqtt.subscribeoptions import SubscribeOptions

from services.bus import Delivery, Message

READ_AT_ONCE = 16 * 1024  # bytes: some hundred small messages
WRITTEN_AT_ONCE = 64 * 1024
KEEPALIVE_EVERY_S = 1.0  # how often paho looks at its clock, at least
PUBACK = struct.Struct(">HH")
PUBACK_HEAD = MessageType.PUBACK << 8 | 2  # its first two bytes: the type, and that two more follow (MQTT 3.1.1, 3.4)
FAILURE, NOT_AUTHORIZED = 0x80, 0x87  # reasons in a PUBACK (MQTT 5, 3.4.2.1); 3.1.1 has none


class Client(paho.Client):
    """paho's client with a faster way in and out: most of its time goes into `on_message` and `on_publish`.

    `on_came` is given each message, `on_acknowledged` the packet ids of ours that the broker has, `on_denied` the topic
    of one that it threw away and why, and `on_granted` is called when it has taken in a subscription. `number` is told
    with each message: which connection it came by.
    """

    on_came: Callable[[Message], None]
    on_acknowledged: Callable[[int], None]
    on_denied: Callable[[str, str], None]
    on_granted: Callable[[], None]
    clock: Callable[[], float]
    number = 0

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._came, self._at = b"", 0
        self._asked: deque[None] = deque()  # one for each subscription that the broker has not granted yet
        self.on_socket_register_write = _nobody  # so that paho leaves the writing to `write`

    def ask_for(self, filters: Iterable[str], as_published: Container[str] = ()) -> None:
        """Subscribes, with QoS 1; not to the topics that are only within this process. MQTT 3.1.1 has no options."""
        wanted = [one for one in filters if not one.startswith("/")]
        if not wanted:
            return
        self._asked.append(None)
        if self._protocol == MQTTProtocolVersion.MQTTv5:
            self.subscribe([(one, SubscribeOptions(1, retainAsPublished=one in as_published)) for one in wanted])
        else:
            self.subscribe([(one, 1) for one in wanted])

    @property
    def listens(self) -> bool:
        """Whether everything that was asked for is granted, or denied."""
        return not self._asked

    def forget(self) -> None:
        """Whom it tells. Its socket is closed when nobody holds it; in a circle that would be left to chance."""
        self.on_connect = self.on_disconnect = None
        self.on_came = self.on_acknowledged = self.on_denied = self.on_granted = _nobody

    def ack_all(self, packets: Iterable[int]) -> None:
        """Acknowledges messages with QoS 1, by their packet ids, in one piece."""
        data = b"".join(PUBACK.pack(PUBACK_HEAD, packet) for packet in packets)
        self._packet_queue(MessageType.PUBACK, data, 0, 1)

    def read(self) -> None:
        """Handles every packet that has come, of at most READ_AT_ONCE."""
        self.loop_read()
        while self._at < len(self._came) and self._sock is not None:
            self.loop_read()

    def left(self) -> bool:
        """Whether TLS has read something and not handed it out yet."""
        link = self.socket()
        return isinstance(link, ssl.SSLSocket) and link.pending() > 0

    def write(self) -> None:
        """Writes what waits, as far as the kernel takes it, small packets joined."""
        if self._out_packet:
            self._join()
            self.loop_write()

    def _join(self) -> None:
        waiting, data = self._out_packet, bytearray()
        while waiting and waiting[0]["command"] in (MessageType.PUBLISH, MessageType.PUBACK):
            if len(data) >= WRITTEN_AT_ONCE:
                break
            packet = waiting.popleft()
            data += packet["packet"][packet["pos"] :]
        if data:
            waiting.appendleft(
                {"command": MessageType.PUBACK, "mid": 0, "qos": 1, "pos": 0, "to_process": len(data), "packet": data,
                 "info": None}
            )  # fmt: skip

    def _sock_recv(self, bufsize: int) -> bytes:
        """What paho asks for, out of one large piece."""
        if self._at >= len(self._came):
            self._came, self._at = super()._sock_recv(max(bufsize, READ_AT_ONCE)), 0
        piece = self._came[self._at : self._at + bufsize]
        self._at += len(piece)
        return piece

    def _handle_publish(self) -> MQTTErrorCode:
        try:
            message = self._decoded(self._in_packet["command"], self._in_packet["packet"])
        except (IndexError, KeyError, ValueError, struct.error, MalformedPacket):
            return MQTTErrorCode.MQTT_ERR_PROTOCOL
        self.on_came(message)
        return MQTTErrorCode.MQTT_ERR_SUCCESS

    def _decoded(self, head: int, data: bytearray) -> Message:
        """A PUBLISH (MQTT 5, 3.3). Hardly anybody sends properties, and paho takes long to find none."""
        qos, end = head >> 1 & 3, 2 + int.from_bytes(data[:2], "big")
        topic, packet, reply_to, correlation = data[2:end].decode(), 0, None, None
        if qos > 1:
            raise ValueError("nobody asks for more than QoS 1")
        if qos:
            packet, end = int.from_bytes(data[end : end + 2], "big"), end + 2
        if self._protocol == MQTTProtocolVersion.MQTTv5:
            if data[end]:
                properties = Properties(PacketTypes.PUBLISH)  # type: ignore[no-untyped-call]
                end += properties.unpack(bytes(data[end:]))[1] - 1  # type: ignore[no-untyped-call]
                reply_to, correlation = (getattr(properties, one, None) for one in ("ResponseTopic", "CorrelationData"))
            end += 1
        if end > len(data):
            raise IndexError("it is shorter than it says")
        token = Delivery(self.number, packet, bool(head & 8))
        payload, retain = bytes(data[end:]), bool(head & 1)
        return Message(topic, payload, retain, qos, self.clock(), None, reply_to, correlation, token=token)

    def _handle_suback(self) -> None:
        super()._handle_suback()
        with suppress(IndexError):  # a broker grants what nobody asked for
            self._asked.pop()
        self.on_granted()

    def _handle_pubackcomp(self, cmd: Any) -> MQTTErrorCode:
        data = self._in_packet["packet"]
        packet = int.from_bytes(data[:2], "big")
        with self._out_message_mutex:
            if packet not in self._out_messages:
                return MQTTErrorCode.MQTT_ERR_SUCCESS
            if len(data) > 2 and data[2] >= FAILURE:
                why = "not authorized" if data[2] == NOT_AUTHORIZED else f"reason {data[2]:#x}"
                self.on_denied(self._out_messages[packet].topic, why)
            self.on_acknowledged(packet)
            return self._do_on_publish(packet, None, None)  # type: ignore[arg-type]  # for `on_publish`, which is none


def _nobody(*_: object) -> None:
    return


class Network:
    """Works for one client after the other in the thread that calls `run`; `wake` is for the others."""

    def __init__(self) -> None:
        self._woken, self._bell = socket.socketpair()
        self._woken.setblocking(False)
        self._bell.setblocking(False)
        self._waits = False

    def wake(self) -> None:
        """There is something new, for who waits in `run` or is about to."""
        if self._waits:
            with suppress(OSError):  # it was rung so often that it will be heard, or nobody listens any more
                self._bell.send(b"!")

    def run(
        self, prepare: Callable[[], Client | None], wanted: Callable[[], bool], timeout: float | None = None
    ) -> None:
        """Reads and writes while that is wanted, for `timeout` seconds at most (None: any time), and once at least.

        `prepare`, before each wait, hands over what is to be written, and tells the client; without one only `wake` is
        waited for.
        """
        end = math.inf if timeout is None else time.monotonic() + timeout
        while True:
            self._waits = True  # before we look: what is new after that rings
            client = prepare()
            self._once(client, max(0.0, min(end - time.monotonic(), KEEPALIVE_EVERY_S)) if wanted() else 0.0)
            if not wanted() or time.monotonic() >= end:
                return

    def _once(self, client: Client | None, wait_s: float) -> None:
        poll = select.poll()  # `select.select` fails at descriptors from 1024 on
        poll.register(self._woken, select.POLLIN)
        if client is not None:
            client.write()
            if (link := client.socket()) is not None:
                poll.register(link, select.POLLIN | (select.POLLOUT if client.want_write() else 0))
        left = client is not None and client.left()
        ready = [number for number, _ in poll.poll(0.0 if left else 1000 * wait_s)]
        self._waits = False
        if self._woken.fileno() in ready:
            ready.remove(self._woken.fileno())
            with suppress(BlockingIOError):
                self._woken.recv(4096)
        if client is not None:
            if ready or left:
                client.read()
            client.loop_misc()

    def close(self) -> None:
        """After the last `run`."""
        self._woken.close()
        self._bell.close()
