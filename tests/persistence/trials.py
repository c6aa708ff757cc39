"""Trials of the writer on real parts: killed, cut off, without database or broker, while 2,000 messages come a second.

Each asserts that the rows are exactly the messages that the broker acknowledged to the publisher, in their order, and
returns how many there were. The tests make a few of them, the soak a hundred.
"""

from __future__ import annotations

import os
import random
import select
import signal
import socket
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from services import peers
from services.errors import Unavailable
from services.peers import free_port, mariadb, mosquitto, running
from services.storage import open_storage, read_address
from tests.network import Network, network

ITEMS = 100
NAMES = [f"I{number}" for number in range(ITEMS)]
RATE = 2000  # messages a second
BURST = 20
DRAINED_S = 120.0
HEARD_S = 5.0


class Publisher:
    """Says consecutive numbers to the items in turn, QoS 1; a number is said once, and counts when it is acknowledged.

    What was not acknowledged when the connection broke is not said again: nobody was promised anything.
    """

    def __init__(self, port: int, items: Sequence[str] = NAMES, rate: float = RATE, burst: int = BURST) -> None:
        self._port, self._items, self._rate, self._burst = port, items, rate, burst
        self.acknowledged: set[int] = set()
        self.said = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="publisher", daemon=True)

    def __enter__(self) -> Publisher:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(10)

    def go_on(self, messages: float) -> None:
        """Returns when so many more are said."""
        wanted = self.said + messages
        peers.wait_until(lambda: self.said >= wanted, f"{messages:.0f} more messages", DRAINED_S)

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                with socket.create_connection(("127.0.0.1", self._port), timeout=5) as link:
                    self._connection(link)
            except OSError:
                self._stop.wait(0.05)

    def _connection(self, link: socket.socket) -> None:
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        link.sendall(b"\x10\x11\x00\x04MQTT\x04\x02\x00\x3c\x00\x05speak")  # CONNECT, clean, client id "speak"
        if link.recv(4)[3:] != b"\x00":
            raise OSError("refused")
        waiting: dict[int, int] = {}  # packet id to number
        rest = b""
        due = time.monotonic()
        while not self._stop.is_set() or waiting:
            if not self._stop.is_set() and time.monotonic() >= due and len(waiting) < 2000:
                due += self._burst / self._rate
                link.sendall(b"".join(self._packet(waiting) for _ in range(self._burst)))
            pause = 0.5 if self._stop.is_set() else max(0.0, due - time.monotonic())
            if select.select([link], [], [], pause)[0]:
                came = link.recv(65536)
                if not came:
                    raise OSError("closed")
                rest = self._take(rest + came, waiting)

    def _packet(self, waiting: dict[int, int]) -> bytes:
        number, self.said = self.said, self.said + 1
        packet = number % 65535 + 1
        waiting[packet] = number
        topic = f"home/{self._items[number % len(self._items)]}/state".encode()
        body = len(topic).to_bytes(2, "big") + topic + packet.to_bytes(2, "big") + str(number).encode()
        return b"\x32" + bytes([len(body)]) + body

    def _take(self, data: bytes, waiting: dict[int, int]) -> bytes:
        whole = len(data) // 4 * 4  # a PUBACK has four bytes
        for at in range(0, whole, 4):
            self.acknowledged.add(waiting.pop(int.from_bytes(data[at + 2 : at + 4], "big")))
        return data[whole:]


@dataclass
class Site:
    """Broker, network, database and the writer, each of which can be lost and comes back."""

    folder: Path
    broker: mosquitto.Broker
    server: mariadb.Server
    link: Network
    writer_pid: int = 0
    _parts: dict[str, ExitStack] = field(default_factory=dict)

    def start_broker(self) -> None:
        self.broker = self._parts["broker"].enter_context(
            mosquitto.private(self.folder / "mosquitto", port=self.broker.port, anonymous=True)
        )

    def stop_broker(self) -> None:
        self._parts["broker"].close()

    def start_database(self) -> None:
        self.server = self._parts["database"].enter_context(mariadb.private(self.folder / "mariadb"))

    def kill_database(self) -> None:
        os.kill(self.server.pid, signal.SIGKILL)
        self._parts["database"].close()

    def start_writer(self) -> None:
        log = self.folder / "writer.log"
        before = log.stat().st_size if log.exists() else 0
        command = [sys.executable, "-m", "services", "serve", "persistence", "--config", str(self.folder / "site.yaml")]
        ready = running(command, log, lambda: "READY" in log.read_text(errors="replace")[before:])
        self.writer_pid = self._parts["writer"].enter_context(ready).pid

    def kill_writer(self) -> None:
        os.kill(self.writer_pid, signal.SIGKILL)
        self._parts["writer"].close()

    def rows(self, since: float) -> list[tuple[str, int]]:
        """Items and numbers that are stored since then, by their times."""
        storage = open_storage(read_address(self.server.tcp_url, password=self.server.password))
        try:
            found = storage.read(
                "SELECT i.name, s.num FROM item i STRAIGHT_JOIN sample s ON s.item_id=i.item_id "
                f"AND s.time>=FROM_UNIXTIME({since:.6f}) ORDER BY s.time"
            )
        finally:
            storage.close()
        return [(str(name), int(num)) for name, num in found]


@contextmanager
def site(folder: Path) -> Iterator[Site]:
    """All of it running; Missing where a part is not installed."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = {name: ExitStack() for name in ("database", "broker", "link", "writer")}
    with ExitStack() as all_of_it:
        for part in parts.values():
            all_of_it.enter_context(part)
        server = parts["database"].enter_context(mariadb.private(folder / "mariadb"))
        port = free_port()
        broker = parts["broker"].enter_context(mosquitto.private(folder / "mosquitto", port=port, anonymous=True))
        link = parts["link"].enter_context(network(port))
        made = Site(folder, broker, server, link, _parts=parts)
        items = "".join(f"  I{n}: {{type: Number, label: I{n}, persist: [everyUpdate]}}\n" for n in range(ITEMS))
        (folder / "home.yaml").write_text(f"items:\n{items}")
        # With an account of its own: what comes for a nameless client between a restart of mosquitto 2.0 and its return
        # is lost where there is an ACL, because the rights of nobody are not read before somebody connects.
        account = f"accounts: {{persistence: '{broker.passwords['persistence']}'}}"
        (folder / "site.yaml").write_text(
            f"bus: {{port: {link.port}, keepalive_s: 5, {account}}}\nhome: home.yaml\nstate: state\n"
            f"persistence: {{url: '{server.tcp_url}', password: '{server.password}'}}\n"
        )
        made.start_writer()
        peers.wait_until(lambda: _is_heard(made), "the writer's subscription")
        yield made


def _is_heard(one: Site) -> bool:
    """Whether all that is said is stored: before the first subscription nobody is owed anything."""
    began = time.time()
    with Publisher(one.broker.port) as publisher:
        publisher.go_on(BURST)
    return not _drained(one, began, publisher.acknowledged, HEARD_S)[0]


def kill_writer(one: Site, publisher: Publisher, rng: random.Random) -> None:
    """kill -9 between any two of its instructions, and the next one starts."""
    one.kill_writer()
    one.start_writer()


def kill_database(one: Site, publisher: Publisher, rng: random.Random) -> None:
    """kill -9 of MariaDB; it recovers from its log."""
    one.kill_database()
    publisher.go_on(rng.uniform(0, RATE / 2))
    one.start_database()


def restart_broker(one: Site, publisher: Publisher, rng: random.Random) -> None:
    """mosquitto is stopped as the system does it, and started."""
    one.stop_broker()
    one.start_broker()


def pull_network(one: Site, publisher: Publisher, rng: random.Random) -> None:
    """The writer's cable to the broker, until after its keep-alive or before."""
    one.link.cut()
    publisher.go_on(rng.uniform(0.2, 3.0) * RATE)
    one.link.mend()


Trouble = Callable[[Site, Publisher, random.Random], None]
TROUBLES: tuple[Trouble, ...] = (kill_writer, kill_database, restart_broker, pull_network)


def trouble(one: Site, rng: random.Random, what: Trouble | None = None) -> int:
    """One trial: messages come, something happens at a random moment, messages go on; then everything is counted."""
    what = what or rng.choice(TROUBLES)
    began = time.time()
    with Publisher(one.broker.port) as publisher:
        publisher.go_on(rng.uniform(0.3, 1.5) * RATE)
        what(one, publisher, rng)
        publisher.go_on(rng.uniform(0.3, 1.0) * RATE)
    lost, rows = _drained(one, began, publisher.acknowledged)
    name = getattr(what, "__name__", "trouble")
    assert not lost, f"{name}: {len(lost)} of {len(publisher.acknowledged)} lost: {sorted(lost)[:10]}"
    counted = Counter(number for _, number in rows)
    doubled = [number for number, times in counted.items() if times > 1]
    assert not doubled, f"{name}: {len(doubled)} doubled: {sorted(doubled)[:10]}"
    last: dict[str, int] = {}
    for item, number in rows:
        assert number > last.get(item, -1), f"{name}: {item}: {number} behind {last[item]}"
        last[item] = number
    assert len(publisher.acknowledged) > RATE / 4
    return len(publisher.acknowledged)


def _drained(
    one: Site, since: float, acknowledged: set[int], within_s: float = DRAINED_S
) -> tuple[set[int], list[tuple[str, int]]]:
    """What is missing in the end, and all rows; waits for what is still on its way."""
    found: list[list[tuple[str, int]]] = [[]]

    def complete() -> bool:
        with suppress(Unavailable):
            found[0] = one.rows(since - 0.001)
        return not acknowledged - {number for _, number in found[0]}

    with suppress(TimeoutError):
        peers.wait_until(complete, "every row", within_s)
    return acknowledged - {number for _, number in found[0]}, found[0]


def kill_broker(one: Site, rng: random.Random, *, backlog: bool) -> tuple[int, int, int]:
    """kill -9 of mosquitto, whose saving is not tied to its acknowledgements: acknowledged, lost, doubled.

    With `backlog` the writer has been away for a second before. What is said last comes after all that is lost.
    """
    began = time.time()
    with Publisher(one.broker.port) as publisher:
        publisher.go_on(rng.uniform(0.5, 1.5) * RATE)
        if backlog:
            one.kill_writer()
            publisher.go_on(RATE)
        os.kill(one.broker.pid, signal.SIGKILL)
        one.stop_broker()
        one.start_broker()
        if backlog:
            one.start_writer()
        publisher.go_on(RATE)
    newest = max(publisher.acknowledged)
    peers.wait_until(lambda: newest in {n for _, n in one.rows(began - 0.001)}, "the last message", DRAINED_S)
    counted = Counter(number for _, number in one.rows(began - 0.001))
    lost = len(publisher.acknowledged - set(counted))
    return len(publisher.acknowledged), lost, sum(times - 1 for times in counted.values())
