"""The bus over TLS: a broker with a certificate of our own CA is met, one of somebody else's is not."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.bus_settings import Tls
from services.peers import free_port, mosquitto, program, wait_until

pytestmark = pytest.mark.mosquitto


def certificates(folder: Path, name: str) -> tuple[Path, Path, Path]:
    """A CA, and a server's certificate and key for 127.0.0.1, made with the openssl of the machine."""
    folder.mkdir()
    openssl = program("openssl", "openssl")

    def run(*words: str) -> None:
        subprocess.run([openssl, *words], cwd=folder, check=True, capture_output=True, timeout=60)

    run(
        "req",
        "-x509",
        "-newkey",
        "rsa:2048",
        "-nodes",
        "-keyout",
        "ca.key",
        "-out",
        "ca.crt",
        "-days",
        "2",
        "-subj",
        f"/CN={name}",
    )
    run("req", "-newkey", "rsa:2048", "-nodes", "-keyout", "key", "-out", "request", "-subj", "/CN=broker")
    (folder / "names").write_text("subjectAltName=IP:127.0.0.1\n")
    sign = ("x509", "-req", "-CA", "ca.crt", "-CAkey", "ca.key", "-CAcreateserial", "-days", "2")
    run(*sign, "-in", "request", "-out", "crt", "-extfile", "names")
    return folder / "ca.crt", folder / "crt", folder / "key"


@contextmanager
def broker(folder: Path) -> Iterator[tuple[int, Path]]:
    """A broker with a second, encrypted listener, as `mosquitto.conf` says one adds it; yields its port and CA."""
    ca, crt, key = certificates(folder / "ours", "our CA")
    port = free_port()
    extended = folder / "mosquitto.conf"
    text = mosquitto.CONF.read_text(encoding="utf-8")
    extended.write_text(f"{text}\nlistener {port} 127.0.0.1\ncertfile {crt}\nkeyfile {key}\n", encoding="utf-8")
    with mosquitto.private(folder / "broker", anonymous=True, conf=extended):
        yield port, ca


# paho leaves the socket of a failed handshake to the garbage collector
@pytest.mark.filterwarnings("ignore:Exception ignored in. <ssl.SSLSocket:pytest.PytestUnraisableExceptionWarning")
def test_a_broker_of_our_ca_is_met_and_one_of_anothers_is_not(tmp_path: Path) -> None:
    other, _, _ = certificates(tmp_path / "theirs", "their CA")
    with broker(tmp_path) as (port, ca):
        good = MqttBus(Address("good", port=port, tls=Tls(ca=ca).context()))
        wait_until(lambda: good.receive(0.02) or good.connected, "a connection over TLS", 5.0)
        bad = MqttBus(Address("bad", port=port, tls=Tls(ca=other).context()))
        with pytest.raises(TimeoutError):
            wait_until(lambda: bad.receive(0.02) or bad.connected, "a connection to a stranger", 1.0)
        good.close()
        bad.close()
