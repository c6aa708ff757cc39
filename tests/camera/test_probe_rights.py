"""The probe tells what the account may do, and finds out the rest where a right is missing."""

from __future__ import annotations

import httpx
import pytest
import yaml
from rich.console import Console

from services.camera.probe import paper, rights, show
from services.camera.probe.findings import Findings
from services.camera.probe.wire import Exchange
from services.simulators.camera.program import inside
from tests.camera.first_contact import Network, config, probed


class Limited(Network):
    """A camera whose account lacks the right to some requests."""

    def __init__(self, *denied: str, status: int = 401) -> None:
        super().__init__(inside(config(), 0.0))
        self.denied, self.status, self.asked = denied, status, list[str]()

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        target = request.url.raw_path.decode()
        self.asked.append(target)
        if "Authorization" in request.headers and any(part in target for part in self.denied):
            return httpx.Response(self.status, stream=httpx.ByteStream(b"Error\r\nInvalid Authority!\r\n"))
        return super().handle_request(request)


def shown(found: Findings) -> str:
    console = Console(width=200, no_color=True)
    with console.capture() as capture:
        show.report(console, found)
    return capture.get()


def test_an_account_with_all_rights_may_do_all_that_is_tried() -> None:
    found, _ = probed(Network(inside(config(), 0.0)))
    assert set(found.rights.values()) == {True}
    assert found.data()["rights"] == found.rights
    assert "may: take snapshots, read where it looks, turn it, read settings, hear events" in shown(found)
    assert f"not tried: {rights.UNTRIED}" in shown(found)


def test_whether_it_may_turn_is_not_tried_without_leave() -> None:
    found, _ = probed(Network(inside(config(), 0.0)), may_move=False)
    assert found.rights["turn it"] is None
    assert f"not tried: turn it, {rights.UNTRIED}" in shown(found)


@pytest.mark.parametrize("status", [401, 200])
@pytest.mark.parametrize(
    ("denied", "lacks"),
    [
        ("/snapshot.cgi", "take snapshots"),
        ("/configManager.cgi", "read settings"),
        ("/eventManager.cgi", "hear events"),
    ],
)
def test_a_right_that_is_missing_is_told_and_the_rest_found_out(denied: str, lacks: str, status: int) -> None:
    found, wire = probed(Limited(denied, status=status), may_move=False)
    assert found.rights == {**dict.fromkeys(rights.ASKS, True), lacks: False, "turn it": None}
    assert f"may NOT: {lacks} " in shown(found)
    assert found.switches["ptz_channels"] == (0, 1)
    assert wire.odd == 0  # a right that is missing is no odd refusal of the login
    assert "heartbeat" in found.unknown
    if lacks == "read settings":
        assert {"brackets", "config_narrowing", "daynight", "lens_mask"} <= set(found.unknown)
        assert not {"brackets", "config_narrowing", "daynight", "lens_mask"} & set(found.switches)


def test_an_account_that_may_not_turn_it_turns_nothing_and_needs_no_stop() -> None:
    network = Limited("ptz.cgi?action=start", "ptz.cgi?action=stop")
    found, _ = probed(network)
    assert found.rights["turn it"] is False
    assert found.rights["read where it looks"] is True
    assert not found.moved
    assert found.unknown["move_status"] == "the account has no right to turn it"
    assert not [target for target in network.asked if "action=stop" in target]
    assert len([target for target in network.asked if "action=start" in target]) <= 2


def test_an_account_that_may_not_even_ask_the_motors_learns_the_rest() -> None:
    found, _ = probed(Limited("ptz.cgi"))
    assert (found.rights["turn it"], found.rights["read where it looks"]) == (None, False)
    assert found.unknown["ptz_channels"]
    assert found.latency_ms["median"] > 0
    assert found.model == "IP3M-941W"
    assert "Looks at" in shown(found)
    section = yaml.safe_load(paper.section(found, "ip9", "ros"))["cameras"]["ip9"]
    assert "channel" not in section


def test_no_events_is_an_answer() -> None:
    target = "/cgi-bin/eventManager.cgi?action=getEventIndexes&code=VideoMotion"
    assert rights.told([Exchange("", target, 200, body=b"Error: No Events\r\n")])["hear events"] is True
    assert rights.told([Exchange("", target, 400, body=b"Error\r\n")])["hear events"] is None
