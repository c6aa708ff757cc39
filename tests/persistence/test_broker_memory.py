"""The queue that the broker keeps for the writer fits into the memory that the broker may take: it is ended otherwise,
and again at each start, for it reads its queue back."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from services import peers
from services.apartment.home import Home
from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.installation import compose, units
from services.peers import free_port, mosquitto, wait_until
from services.persistence import Config
from tests.persistence.trials import Publisher

PER_MESSAGE = 400  # bytes with its topic, beside its payload; measured below
NAMES = [f"Living_Room_Temperature_{number}" for number in range(100)]
SAID = 30_000
MB = 2**20


def setting(name: str) -> int:
    found = re.search(rf"(?m)^{name} (\d+)$", mosquitto.CONF.read_text(encoding="utf-8"))
    assert found is not None
    return int(found[1])


def test_a_full_queue_leaves_a_third_of_the_brokers_memory() -> None:
    messages = setting("max_queued_messages")
    assert Config(url="sqlite:///unused", home=Home(items={})).broker_queue == messages
    assert f"MemoryMax={units.BROKER_MB}M\n" in units.broker()
    assert compose.compose([], "apartment.yaml")["services"]["broker"]["mem_limit"] == f"{units.BROKER_MB}m"
    assert messages * PER_MESSAGE + setting("max_queued_bytes") <= units.BROKER_MB * MB * 2 / 3


def resident(broker: mosquitto.Broker) -> int:
    """Bytes of memory that it has."""
    found = re.search(r"VmRSS:\s+(\d+) kB", Path(f"/proc/{broker.pid}/status").read_text())
    assert found is not None
    return int(found[1]) * 1024


@pytest.mark.mosquitto
def test_a_message_that_waits_takes_no_more_than_is_reckoned_also_after_a_restart(tmp_path: Path) -> None:
    port = free_port()
    try:
        with mosquitto.private(tmp_path, port=port, anonymous=True) as broker:
            own = {"user": "persistence", "password": broker.passwords["persistence"]}
            bus = MqttBus(Address("persistence", port=port, protocol=4, durable=True, **own))
            bus.subscribe(("home/+/state",))
            wait_until(lambda: bool(bus.receive(0.05)) or bus.listens, "the subscription")
            bus.close()
            before = resident(broker)
            with Publisher(port, NAMES, rate=1e6, burst=200) as publisher:
                publisher.go_on(SAID)
            waiting = len(publisher.acknowledged)
            assert waiting >= SAID
            assert 200 < (resident(broker) - before) / waiting < PER_MESSAGE
        with mosquitto.private(tmp_path, port=port, anonymous=True) as broker:
            assert 200 < (resident(broker) - before) / waiting < PER_MESSAGE
    except peers.Missing as missing:
        pytest.skip(str(missing))
