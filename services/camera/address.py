"""Where a camera is and how to log in there: what every brand's `connect` is given."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import SecretStr


@dataclass(frozen=True)
class Address:
    """`channel` None: the brand finds out which one the firmware takes. The password never shows in a repr."""

    url: str
    user: str
    password: SecretStr
    rtsp_port: int = 554
    channel: int | None = None
