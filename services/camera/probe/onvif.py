"""First contact with a camera that has no Dahua API but speaks ONVIF: what every brand can tell, by our own client.

It only reads: how such a camera turns, the service learns by itself.
"""

from __future__ import annotations

from typing import cast

from services.camera.address import Address
from services.camera.capabilities import Capabilities, GetCapabilities
from services.camera.device import BadLogin, Camera, Identify, Identity, Reading, Snapshot, Status
from services.camera.probe import firmware
from services.camera.probe.findings import Findings
from services.camera.probe.wire import Wire
from services.camera.watchdog import connector
from services.camera.web.gate import Gate

ASKED = 10  # readings for the latency
STEP = "ONVIF"


def meet(wire: Wire, found: Findings) -> None:
    """Asks who it is, where it looks, what its motors can, and for a picture."""
    found.brand = "onvif"
    address = Address(wire.url, wire.user, wire.password, certificate=wire.certificate)
    camera = connector("onvif", address, Gate(pause=_no_second_try))()
    try:
        _facts(camera, wire, found)
    finally:
        camera.close()
    found.notes.append("it has no Dahua or Amcrest HTTP API, so little of its firmware could be asked for")


def _no_second_try(seconds: float) -> None:
    raise BadLogin("the camera does not accept this user and password; one login was tried, no more will be")


def _facts(camera: Camera, wire: Wire, found: Findings) -> None:
    identity = cast(Identity, camera.send(Identify()))
    found.model, found.serial, found.firmware = identity.model, identity.serial, identity.version
    told = cast(Capabilities, camera.send(GetCapabilities("motors")))
    found.capabilities |= {"presets": told.presets, "absolute": told.absolute, "timed": told.timed, "zoom": told.zoom}
    took = []
    for _ in range(ASKED):
        sent = wire.clock()
        reading = cast(Reading, camera.send(Status()))
        took.append(wire.clock() - sent)
    found.pose = (reading.pan, reading.tilt, reading.zoom)
    found.latency_ms = firmware.times(took)
    found.picture["size"] = firmware.jpeg_size(cast(bytes, camera.send(Snapshot())))
