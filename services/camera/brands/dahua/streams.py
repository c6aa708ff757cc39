"""Where a camera's moving picture is: addresses without credentials. Pure."""

from __future__ import annotations

from typing import Literal

import httpx

from services.camera.address import Address
from services.camera.device import StreamAddress

SUBTYPES = {"main": 0, "sub": 1}
MJPEG = "/cgi-bin/mjpg/video.cgi?channel=1&subtype=1"  # firmware since 2016 has it of the sub stream only


def address(camera: Address, source: Literal["main", "sub"]) -> StreamAddress:
    """The channel of pictures is 1-based whatever the motors' is."""
    host = httpx.URL(camera.url).host
    where = f"[{host}]" if ":" in host else host
    path = f"/cam/realmonitor?channel=1&subtype={SUBTYPES[source]}"
    return StreamAddress(f"rtsp://{where}:{camera.rtsp_port}{path}", MJPEG)
