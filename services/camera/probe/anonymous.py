"""Takes out of recorded answers what tells whose camera it was: serials, names, users, addresses. Pure."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

from services.camera.probe.wire import Exchange

SERIAL, NAME, USER, HOST = "AMC0000000000001", "Camera1", "admin", "192.0.2.10"
IP = re.compile(r"(?<![\d.])(?:\d{1,3}\.){3}\d{1,3}(?![\d.])")
MAC = re.compile(r"(?i)(?<![0-9a-f])(?:[0-9a-f]{2}[:-]){5}[0-9a-f]{2}(?![0-9a-f])")
PLACE = re.compile(r"(?m)^(presets\[(\d+)\]\.Name=)[^\r\n]*")
REALM = re.compile(r'(realm=")[^"]*(")')
KEPT = ("content-type", "content-length", "www-authenticate", "connection")
PICTURE = b"\xff\xd8 (a picture, left out) \xff\xd9"


def cleaner(serial: str, name: str, user: str) -> Callable[[str], str]:
    """A function that replaces what is known of this camera, and what looks like an address."""
    known = [(old, new) for old, new in ((serial, SERIAL), (name, NAME), (user, USER)) if len(old) >= 3 and old != new]

    def clean(text: str) -> str:
        for old, new in known:
            text = re.sub(rf"(?<![A-Za-z0-9]){re.escape(old)}(?![A-Za-z0-9])", new, text)
        text = PLACE.sub(lambda found: f"{found[1]}Preset{int(found[2]) + 1}", text)
        text = REALM.sub(rf"\g<1>Login to {SERIAL}\g<2>", text)
        return MAC.sub("00:00:5E:00:53:01", IP.sub(HOST, text))

    return clean


def recorded(exchanges: Iterable[Exchange], clean: Callable[[str], str]) -> dict[str, str]:
    """File name -> the last answer of that name, status line and headers first; pictures are left out."""
    files: dict[str, str] = {}
    for one in exchanges:
        if not one.name or not one.status:
            continue
        head = "".join(f"{key}: {value}\r\n" for key, value in one.headers if key.lower() in KEPT)
        body = PICTURE.decode("latin-1") if one.body.startswith(b"\xff\xd8") else one.body.decode("latin-1")
        text = f"{one.method} {one.target}\r\nHTTP/1.1 {one.status}\r\n{head}\r\n{body}"
        files[f"{re.sub(r'[^a-z0-9]+', '_', one.name.lower()).strip('_')}.txt"] = clean(text)
    return files
