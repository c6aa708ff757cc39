"""Who may do what at the broker: every account, every row of the table of topics, to write and to read; and who is not
let in at all. On a real mosquitto, with the files that `apartment secrets init` made."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import ssl
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion

from services import access
from services.bus import Message
from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.credentials import certificates, passwords
from services.credentials.folder import Folder, fill, renew
from services.peers import answers, free_port, program, running, wait_until
from tests.credentials.rights import CAMERAS, HEARD, SAID, STRANGE, Case, cases, may, of_devices

pytestmark = pytest.mark.mosquitto
CONFIG = Path(__file__).parents[2] / "config"
ACCOUNTS = access.accounts(CAMERAS)
CASES = list(cases([account for account in ACCOUNTS if account != access.DEVICES]))  # they are no service
OBSERVER = "observer"  # of the test alone: may everything
LIMIT_S = 20.0


@dataclass(frozen=True)
class Broker:
    """The broker of an installation."""

    port: int
    tls_port: int
    folder: Folder
    secrets: dict[str, str]
    pid: int


@pytest.fixture(scope="module")
def broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Broker]:
    """A mosquitto with the generated files; only ports are changed and the observer's account is added."""
    folder = Folder(tmp_path_factory.mktemp("installation") / "secrets")
    list(fill(folder, _config(tmp_path_factory.mktemp("config")), ["127.0.0.1"], datetime.now(UTC)))
    secrets = {account: folder.secrets()[passwords.name_of(account)] for account in ACCOUNTS}
    secrets[OBSERVER] = "sees everything"
    own = folder.path / "broker"
    with (own / "passwords").open("a") as file:
        file.write(access.password_line(OBSERVER, secrets[OBSERVER]) + "\n")
    with (own / "acl").open("a") as file:
        file.write(f"\nuser {OBSERVER}\ntopic readwrite #\ntopic read $SYS/#\n")
    port, tls_port = free_port(), free_port()
    text = (own / "mosquitto.conf").read_text()
    text = text.replace("listener 1883 127.0.0.1", f"listener {port} 127.0.0.1")
    text = text.replace("listener 8883", f"listener {tls_port} 127.0.0.1")
    (own / "here.conf").write_text(f"user root\n{text}")
    command = [program("mosquitto", "mosquitto"), "-c", str(own / "here.conf")]
    with running(command, own / "mosquitto.log", lambda: answers(port) and answers(tls_port)) as process:
        yield Broker(port, tls_port, folder, secrets, process.pid)


def _config(folder: Path) -> Path:
    """The example with a second camera."""
    file = Path(shutil.copytree(CONFIG, folder, dirs_exist_ok=True)) / "apartment.yaml"
    second = "cameras:\n  ip2:\n    brand: amcrest\n    url: http://192.0.2.10\n"
    file.write_text(file.read_text().replace("cameras:\n", second, 1))
    return file


class Mouth:
    """One connection; `came` is what it heard, `answered` the reason of each acknowledgement by packet."""

    def __init__(self, broker: Broker, account: str, *, name: str = "", will: str = "") -> None:
        self.account = account
        self.came: list[tuple[str, bytes, bool]] = []
        self.answered: dict[int, bool] = {}
        self.granted = threading.Event()
        self.client = paho.Client(
            CallbackAPIVersion.VERSION2, name or f"{account}-test", protocol=paho.MQTTv5, reconnect_on_failure=False
        )
        self.client.username_pw_set(account, broker.secrets[account])
        self.client.max_inflight_messages_set(1000)
        self.client.on_message = lambda _c, _d, m: self.came.append((m.topic, bytes(m.payload), m.retain))
        self.client.on_publish = lambda _c, _d, mid, reason, _p: self.answered.update({mid: not reason.is_failure})
        self.client.on_subscribe = lambda *_: self.granted.set()
        if will:
            self.client.will_set(will, b"a last will", qos=1, retain=True)
        self.client.connect("127.0.0.1", broker.port)
        self.client.loop_start()

    def listen(self, *filters: str) -> None:
        self.client.subscribe([(one, 0) for one in filters])
        wait_until(self.granted.is_set, "the subscription", LIMIT_S)

    def say(self, topics: list[str], *, retain: bool = False, text: str | None = None) -> dict[str, bool]:
        """Whether the broker took each."""
        words = self.account if text is None else text
        sent = {self.client.publish(topic, words, qos=1, retain=retain).mid: topic for topic in topics}
        wait_until(lambda: sent.keys() <= self.answered.keys(), "the acknowledgements", LIMIT_S)
        return {topic: self.answered[mid] for mid, topic in sent.items()}

    def topics(self, *, retain: bool) -> set[str]:
        return {topic for topic, _, kept in self.came if kept == retain}


@contextmanager
def mouth(broker: Broker, account: str, *, name: str = "", will: str = "") -> Iterator[Mouth]:
    one = Mouth(broker, account, name=name, will=will)
    try:
        wait_until(one.client.is_connected, f"{account} is let in", LIMIT_S)
        yield one
    finally:
        one.client.disconnect()
        one.client.loop_stop()
        del one.client  # else its sockets are closed when the collector comes round


def _topics(account: str, *, write: bool) -> set[str]:
    of_table = {case.topic for case in CASES if may(account, case.row.writers if write else case.row.readers, case)}
    return of_table | of_devices(account, write=write)


def _answers(account: str) -> set[str]:
    """A device is asked nothing."""
    return set() if account == access.DEVICES else {"reply/me"}


def test_every_row_has_somebody_who_writes_and_somebody_who_reads() -> None:
    def somebody(case: Case, who: tuple[str, ...]) -> bool:
        return any(may(account, who, case) for account in ACCOUNTS)

    assert not [case.topic for case in CASES if not somebody(case, case.row.writers)]
    assert not [case.topic for case in CASES if not somebody(case, case.row.readers)]
    assert {"dashboard", "hubs", "robot", "history", "mission", "operator", "camera-ip2"} <= set(ACCOUNTS)


def test_a_service_tells_once_which_answer_the_broker_does_not_take_from_it(
    broker: Broker, caplog: pytest.LogCaptureFixture
) -> None:
    camera = Address("camera-ip1", port=broker.port, user="camera-ip1", password=broker.secrets["camera-ip1"])
    with mouth(broker, OBSERVER) as observer, closing(MqttBus(camera)) as bus:
        observer.listen("reply/#", "desk/#")
        wait_until(lambda: bool(bus.receive(0.01) or bus.connected), "the service is let in", LIMIT_S)
        for topic in ("desk/answer", "desk/answer", "reply/desk"):
            bus.publish(Message(topic, b"done", qos=1))
        wait_until(lambda: bool(bus.receive(0.01) or observer.came), "the answer that is taken", LIMIT_S)
    assert [topic for topic, _, _ in observer.came] == ["reply/desk"]
    told = [record.getMessage() for record in caplog.records if "desk/answer" in record.getMessage()]
    assert told == ["the broker takes nothing for desk/answer from camera-ip1: not authorized"]


def test_every_account_writes_what_the_table_says_and_nothing_else(broker: Broker) -> None:
    everything = [case.topic for case in CASES] + [*SAID, *HEARD, *STRANGE]
    expected = {(topic, account) for account in ACCOUNTS for topic in _topics(account, write=True)}
    with mouth(broker, OBSERVER) as observer:
        observer.listen("#")
        for account in ACCOUNTS:
            with mouth(broker, account) as speaker:
                taken = {topic for topic, well in speaker.say([*everything, "reply/me"]).items() if well}
            assert taken == _topics(account, write=True) | _answers(account), account
        expected |= {(topic, account) for account in ACCOUNTS for topic in _answers(account)}
        wait_until(lambda: len(observer.came) >= len(expected), "what was said", LIMIT_S)
        observer.say(["end"])
        wait_until(lambda: observer.came[-1][0] == "end", "the end", LIMIT_S)
        heard = {(topic, payload.decode()) for topic, payload, _ in observer.came[:-1]}
    assert heard == expected


def test_every_account_reads_what_the_table_says_however_it_asks(broker: Broker) -> None:
    """Kept messages and new ones; by `#`, by a shared subscription and by each topic's own name."""
    everything = [case.topic for case in CASES] + [*SAID, *HEARD, *(one for one in STRANGE if one[0] != "$")]
    with mouth(broker, OBSERVER) as observer:
        observer.say([*everything, "reply/me"], retain=True)
        try:
            for account in ACCOUNTS:
                _reads(broker, observer, account, everything)
        finally:
            observer.say([*everything, "reply/me"], retain=True, text="")


def _reads(broker: Broker, observer: Mouth, account: str, everything: list[str]) -> None:
    wanted = _topics(account, write=False) | ({"reply/me"} if account == "operator" else set())
    last = sorted(wanted)[0]
    with mouth(broker, account) as listener, mouth(broker, account, name=f"{account}-spy") as spy:
        listener.listen("#", "$SYS/#", *everything)
        spy.listen(f"$share/{account}/#")
        observer.say([*everything, "reply/me"])
        for one in (listener, spy):
            observer.client.publish(last, b"end", qos=1)
            wait_until(lambda one=one: any(payload == b"end" for _, payload, _ in one.came), "the end", LIMIT_S)  # type: ignore[misc]
        system = {topic for topic in listener.topics(retain=True) if topic.startswith("$")}
        assert listener.topics(retain=False) - system == wanted, account
        assert listener.topics(retain=True) - system == wanted, account
        assert bool(system) == (account == "persistence"), account
        assert spy.topics(retain=False) | spy.topics(retain=True) == wanted, account


def test_a_last_will_is_no_way_round(broker: Broker) -> None:
    with mouth(broker, OBSERVER) as observer:
        observer.listen("home/#", "service/#")
        for topic in ("home/Lab_Lamp/state", "service/camera-ip1/status"):
            with mouth(broker, "camera-ip1", will=topic) as dying:
                sock = dying.client.socket()
                assert sock is not None
                sock.shutdown(socket.SHUT_RDWR)
                wait_until(lambda dying=dying: not dying.client.is_connected(), "the end", LIMIT_S)  # type: ignore[misc]
                dying.client.disconnect()
        wait_until(lambda: any(topic.startswith("service/") for topic, _, _ in observer.came), "its will", LIMIT_S)
        observer.say(["service/camera-ip1/status"], retain=True, text="")
    assert {topic for topic, payload, _ in observer.came if payload} == {"service/camera-ip1/status"}


def _answer(port: int, user: str | None, password: str | None, tls: ssl.SSLContext | None = None) -> str:
    """What the broker says to a CONNECT."""
    said: list[str] = []
    client = paho.Client(CallbackAPIVersion.VERSION2, "knocks", protocol=paho.MQTTv5, reconnect_on_failure=False)
    client.on_connect = lambda _c, _d, _f, reason, _p: said.append(str(reason))
    if user is not None:
        client.username_pw_set(user, password)
    if tls is not None:
        client.tls_set_context(tls)
    client.connect("127.0.0.1", port)
    client.loop_start()
    try:
        wait_until(lambda: bool(said), "an answer", LIMIT_S)
    finally:
        client.disconnect()
        client.loop_stop()
    return said[0]


def test_who_does_not_say_who_he_is_stays_outside(broker: Broker) -> None:
    ours = ssl.create_default_context(cafile=str(broker.folder.authority))
    for port, tls in ((broker.port, None), (broker.tls_port, ours)):
        assert _answer(port, None, None, tls) == "Not authorized"
        assert _answer(port, "bridge", "wrong", tls) == "Not authorized"
        assert _answer(port, "bridge", "", tls) == "Not authorized"
        assert _answer(port, "bridge", broker.secrets["operator"], tls) == "Not authorized"
        assert _answer(port, "nobody", broker.secrets["bridge"], tls) == "Not authorized"
        assert _answer(port, "bridge", broker.secrets["bridge"], tls) == "Success"


def test_only_a_certificate_of_our_authority_is_believed(broker: Broker, tmp_path: Path) -> None:
    other = Folder(tmp_path / "other")
    list(fill(other, CONFIG / "apartment.yaml", ["127.0.0.1"], datetime.now(UTC)))
    for stranger in (ssl.create_default_context(cafile=str(other.authority)), ssl.create_default_context()):
        with (
            pytest.raises(ssl.SSLCertVerificationError),
            socket.create_connection(("127.0.0.1", broker.tls_port), timeout=LIMIT_S) as plain,
            stranger.wrap_socket(plain, server_hostname="127.0.0.1"),
        ):
            pass
    with pytest.raises(TimeoutError):
        _plain_answer(broker.tls_port)


def _plain_answer(port: int) -> bytes:
    """What comes to a CONNECT that is not encrypted; TimeoutError when nothing does, or the end."""
    with socket.create_connection(("127.0.0.1", port), timeout=1.0) as plain:
        plain.sendall(b"\x10\x10\x00\x04MQTT\x04\x02\x00\x3c\x00\x04test")
        try:
            answer = plain.recv(100)
        except ConnectionError:
            answer = b""
    if not answer.startswith(b"\x20"):  # CONNACK
        raise TimeoutError
    return answer


def test_other_machines_are_heard_by_tls_alone(broker: Broker) -> None:
    text = (broker.folder.path / "broker/mosquitto.conf").read_text()
    assert re.findall(r"(?m)^listener (.*)", text) == ["1883 127.0.0.1", "8883"]
    encrypted = text[text.index("listener 8883") :]
    assert "certfile " in encrypted
    assert "keyfile " in encrypted
    assert re.findall(r"(?m)^allow_anonymous (.*)", text) == ["false"]
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.2", broker.port), timeout=5)  # this machine too, by another of its addresses


def test_a_renewed_certificate_is_shown_after_a_reload_and_nobody_is_thrown_out(broker: Broker) -> None:
    def shown() -> str:
        context = ssl.create_default_context(cafile=str(broker.folder.authority))
        with (
            socket.create_connection(("127.0.0.1", broker.tls_port), timeout=LIMIT_S) as plain,
            context.wrap_socket(plain, server_hostname="127.0.0.1") as encrypted,
        ):
            der = encrypted.getpeercert(binary_form=True)
        assert der is not None
        return ssl.DER_cert_to_PEM_cert(der).strip()

    before = shown()
    with mouth(broker, "bridge") as stays:
        list(renew(broker.folder, timedelta(days=9999), datetime.now(UTC)))
        pair = broker.folder.pair("broker")
        assert pair is not None
        os.kill(broker.pid, signal.SIGHUP)
        wait_until(lambda: shown() == pair.certificate.strip(), "the new certificate", LIMIT_S)
        assert stays.client.is_connected()
    assert shown() != before
    assert certificates.pin(shown()) == certificates.pin(before), "by which OpenHAB knows the broker"
