"""The event stream as the firmware writes it: heartbeat, form of an event, a second header inside the body."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Any

import httpx

from services.camera.device import Away
from services.camera.probe.findings import Findings
from services.camera.probe.wire import Wire

ATTACH = "/cgi-bin/eventManager.cgi?action=attach&codes=[VideoMotion]&heartbeat=1"
ENCODED = ATTACH.replace("[", "%5B").replace("]", "%5D")
LISTEN_S = 3.5  # three heartbeats


def events(wire: Wire, found: Findings, clock: Callable[[], float] = time.monotonic) -> None:
    """Listens for a few seconds. What was heard is kept for the fixtures."""
    try:
        body = listen(wire, ENCODED if found.switches.get("brackets") == "encoded" else ATTACH, clock)
    except Away as error:
        found.unknown["heartbeat"] = found.unknown["event_form"] = str(error)
        return
    wire.heard = body
    found.switches |= read_events(body)
    if "event_form" not in found.switches:
        found.unknown["event_form"] = f"nothing moved in the {LISTEN_S:.0f} s that were listened to"


def listen(wire: Wire, target: str, clock: Callable[[], float]) -> bytes:
    """The bytes of the stream."""
    body, end = b"", clock() + LISTEN_S
    with wire.stream(target, LISTEN_S) as response:
        if response.status_code != 200:
            raise Away(f"the event stream was answered with {response.status_code}")
        try:
            for chunk in response.iter_raw():
                body += chunk
                if clock() >= end:
                    break
        except httpx.ReadTimeout:
            pass  # silence: that is an answer too
    if body.startswith(b"Error"):
        raise Away(f"the event stream was refused: {' '.join(body[:60].decode('latin-1').split())}")
    return body


def read_events(body: bytes) -> dict[str, Any]:
    """What the stream shows. Pure."""
    form: dict[str, Any] = {
        "heartbeat": b"Heartbeat" in body,
        "event_header_twice": b"HTTP/1.1 200" in body,
    }
    event = re.search(rb"Code=VideoMotion;action=\w+;index=\d+(;data=)?", body)
    if event:
        form["event_form"] = "A" if event[1] else "B"
    length = re.search(rb"Content-Length:( ?)(\d+)", body, re.IGNORECASE)
    if length:
        form["event_length_space"] = bool(length[1])
        parts = body[length.end() :]  # a second header block ends in an empty line too
        if text := re.match(rb"\r\n\r\n(\r\n)?(.*?)\r\n\r\n", parts, re.DOTALL):
            form["event_line_before"] = bool(text[1])
            form["event_length_off"] = int(length[2]) - len(text[2])
        between = re.search(rb"(?:[^\r\n]\n?)\r\n\r\n((?:\r\n)*)--\w", parts)
        if between:
            form["event_blank_lines"] = len(between[1]) // 2
    return form
