"""The probe at a simulated camera in virtual time."""

from __future__ import annotations

from typing import Any, Literal

import httpx
from pydantic import SecretStr

from services.camera.device import Direction
from services.camera.probe.contact import contact
from services.camera.probe.findings import Findings
from services.camera.probe.wire import Wire
from services.simulators import camera as simulated
from services.virtual import wire as virtual
from tests.camera.bench import PASSWORD, SHIPPED


class Silent:
    """A Teller that says nothing."""

    def begin(self, step: str) -> None:
        pass

    def detail(self, text: str) -> None:
        pass

    def end(self, step: str, found: Findings) -> None:
        pass


class Network(virtual.Wire):
    """Virtual time without an event stream, which would not end."""

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        if b"action=attach" in request.url.query and "Authorization" in request.headers:
            return httpx.Response(503)
        return super().handle_request(request)

    def pause(self, seconds: float) -> None:
        self.now += seconds

    def turning(self, what: Direction | Literal["drive"] | None) -> None:
        """Is told what turns, as a watchdog is."""


def config(**values: Any) -> simulated.Config:
    return simulated.Config.model_validate({"folder": SHIPPED, "user": "ros", "password": PASSWORD, **values})


def probed(network: Network, *, may_move: bool = True) -> tuple[Findings, Wire]:
    wire = Wire("http://127.0.0.1", "ros", SecretStr(PASSWORD), clock=lambda: network.now, pause=network.pause)
    wire.turning = network.turning
    wire.http = httpx.Client(base_url=wire.url, transport=network)
    return contact(wire, Silent(), lambda found: may_move), wire
