"""The page for Prometheus: by HTTP, read back by Prometheus' own parser."""

from __future__ import annotations

import json
import socket
import struct
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterable

import pytest
from prometheus_client.parser import text_string_to_metric_families

from services.bus import Message
from services.errors import BadMessage
from services.metrics import Config, start
from services.metrics.numbers import MOST, Known
from services.payloads import Diagnostic, ServiceInfo
from services.topics import DIAGNOSTICS, SERVICE_INFO, SERVICE_STATUS

T = 1_769_839_200.0
INFO = ServiceInfo(
    version="1.2", started="2026-01-31T06:00:00+00:00", counters={"bad": 3, "received": 1e6}, aside=["a"]
)


def came(*messages: Message) -> Iterable[Message]:
    return [message._replace(received=T) for message in messages]


def page(address: str) -> dict[tuple[str, ...], float]:
    with urllib.request.urlopen(address, timeout=20) as answer:
        text = answer.read().decode()
    samples = [sample for family in text_string_to_metric_families(text) for sample in family.samples]
    return {(one.name, *(one.labels[key] for key in sorted(one.labels))): one.value for one in samples}


def test_prometheus_reads_how_the_services_fare() -> None:
    with start(Config(port=0), lambda message: None) as service:
        odd = DIAGNOSTICS.message(Diagnostic(level=2, message='a "quote"\n'), component="camera/ip1/motors")
        for message in came(
            SERVICE_STATUS.message("online", service="bridge"),
            SERVICE_STATUS.message("offline", service="history"),
            SERVICE_INFO.message(INFO, service="bridge"),
            odd,
        ):
            assert list(service.handle(message, T)) == []
        assert service.due == T
        assert list(service.tick(T)) == []
        assert page(service.addresses["metrics"]) == {
            ("apartment_service_online", "bridge"): 1.0,
            ("apartment_service_online", "history"): 0.0,
            ("apartment_service_info", "bridge", "1.2"): 1.0,
            ("apartment_service_started_seconds", "bridge"): T,
            ("apartment_service_counted", "bad", "bridge"): 3.0,
            ("apartment_service_counted", "received", "bridge"): 1e6,
            ("apartment_service_aside", "bridge"): 1.0,
            ("apartment_diagnostic_level", "camera/ip1/motors"): 2.0,
            ("apartment_metrics_forgotten",): 0.0,
        }
    with pytest.raises(urllib.error.URLError):
        page(service.addresses["metrics"])


def test_a_component_that_is_taken_away_is_shown_no_more() -> None:
    known = Known()
    known.handle(DIAGNOSTICS.message(Diagnostic(level=0, message="fine"), component="a/b"), T)
    known.handle(Message("diagnostics/a/b", b"", retain=True), T)
    assert [one.name for one in known.numbers()] == ["apartment_metrics_forgotten"]


def test_invented_names_do_not_fill_the_memory() -> None:
    known = Known()
    for number in range(MOST + 50):
        known.handle(SERVICE_STATUS.message("online", service=f"s{number}"), T)
    assert len(known.online) == MOST
    assert known.forgotten == 50


def test_rubbish_is_a_bad_message() -> None:
    for topic, payload in (("service/a/info", b"[" * 10_000), ("diagnostics/a", json.dumps({"level": 9}).encode())):
        with pytest.raises(BadMessage):
            Known().handle(Message(topic, payload, received=T), T)


def test_who_goes_away_before_the_answer_leaves_no_trace_in_the_log(capfd: pytest.CaptureFixture[str]) -> None:
    """With a reset, in the middle of what it asks; the page answers the next one."""
    with start(Config(port=0), lambda message: None) as service:
        address = urllib.parse.urlsplit(service.addresses["metrics"])
        for _ in range(20):
            with socket.create_connection(("127.0.0.1", address.port or 0)) as link:
                link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                link.sendall(b"GET /" + b"x" * 100_000 + b" HTTP/1.1\r\n\r\n")
        list(service.tick(T))
        assert page(service.addresses["metrics"]) == {("apartment_metrics_forgotten",): 0.0}
    assert "Traceback" not in capfd.readouterr().err
