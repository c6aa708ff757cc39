"""Whether the camera has moving pictures over RTSP: its port, and what the main and the sub stream are like.

By the service's own reader, behind a gate: one login at a time, and after one that is refused none is tried.
"""

from __future__ import annotations

from contextlib import closing
from typing import Literal

from services.camera.address import Address
from services.camera.brands.dahua import streams
from services.camera.brands.dahua.replies import read_table
from services.camera.device import BadLogin, Refused
from services.camera.probe.findings import Findings
from services.camera.probe.wire import Wire
from services.camera.video import rtsp
from services.camera.web.gate import Gate
from services.errors import DeviceError

TABLE = "/cgi-bin/configManager.cgi?action=getConfig&name=RTSP"
USUAL_PORT = 554
SOURCES: tuple[Literal["sub", "main"], ...] = ("sub", "main")  # the service takes the sub stream
PACKETS = 150  # until one can be decoded: keyframes come every two seconds or so
STEP = "Moving pictures"


def look(wire: Wire, found: Findings) -> None:
    """Opens each stream until a picture of it is there."""
    told = read_table(wire.ask(TABLE, "RTSP").text).get("table.RTSP.Port", "")
    found.rtsp_port = int(told) if told.isdigit() else USUAL_PORT
    address = Address(wire.url, wire.user, wire.password, found.rtsp_port, certificate=wire.certificate)
    gate = Gate(pause=wire.pause)
    for source in SOURCES:
        wire.tell(source)
        try:
            found.streams[source] = _picture(streams.address(address, source).rtsp or "", address, gate)
        except DeviceError as error:
            found.unknown[f"{source} stream"] = str(error)
            if isinstance(error, BadLogin):
                return


def _picture(url: str, address: Address, gate: Gate) -> str:
    with closing(rtsp.opened(url, address, gate)) as session:
        for _ in range(PACKETS):
            if develop := session.read(decode=True).develop:
                height, width = develop().shape[:2]
                return f"{session.codec}, {width} x {height}"
    raise Refused(f"no picture in {PACKETS} packets")
