"""ONVIF messages: SOAP 1.2 frames, faults, and the UsernameToken that signs a request. Pure; the time comes in."""

from __future__ import annotations

import base64
import binascii
import hashlib
from collections import deque
from datetime import datetime
from xml.etree.ElementTree import Element
from xml.sax.saxutils import escape

from services.errors import BadMessage
from services.simulators.camera.messages import Answer

SOAP = "http://www.w3.org/2003/05/soap-envelope"
WSSE = "http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-wssecurity-secext-1.0.xsd"
NAMES = {
    "env": SOAP,
    "tds": "http://www.onvif.org/ver10/device/wsdl",
    "trt": "http://www.onvif.org/ver10/media/wsdl",
    "tptz": "http://www.onvif.org/ver20/ptz/wsdl",
    "tt": "http://www.onvif.org/ver10/schema",
    "ter": "http://www.onvif.org/ver10/error",
}
CLOCK_S = 10.0  # how far the time in a login may be off
NONCES_KEPT = 1000
TYPE = "application/soap+xml; charset=utf-8"
STATUS = {"env:Sender": 400, "env:Receiver": 500}  # SOAP 1.2, part 2, table 20


class Fault(BadMessage):
    """A request that is answered with a fault: the side that is wrong, then the specification's subcodes."""

    def __init__(self, reason: str, *codes: str) -> None:
        super().__init__(reason)
        self.reason, self.codes = reason, codes


def text(asked: Element, tag: str) -> str:
    """The text of a part of a request, wherever its namespace says it is from."""
    found = asked.find(f"{{*}}{tag}")
    return (found.text or "").strip() if found is not None else ""


def tag(name: str, inner: str, **attributes: object) -> str:
    """An element; `inner` is XML already."""
    marks = "".join(f' {key}="{escape(str(value))}"' for key, value in attributes.items())
    return f"<{name}{marks}>{inner}</{name}>"


def framed(body: str, status: int = 200) -> Answer:
    """A whole message."""
    spaces = "".join(f' xmlns:{name}="{uri}"' for name, uri in NAMES.items())
    whole = f'<?xml version="1.0" encoding="utf-8"?><env:Envelope{spaces}><env:Body>{body}</env:Body></env:Envelope>'
    return Answer(whole.encode(), status, TYPE)


def refused(fault: Fault) -> Answer:
    """The fault as an answer; subcodes stand inside each other."""
    side, *codes = fault.codes
    inner = ""
    for code in reversed(codes):
        inner = tag("env:Subcode", tag("env:Value", code) + inner)
    reason = tag("env:Reason", f'<env:Text xml:lang="en">{escape(fault.reason)}</env:Text>')
    return framed(tag("env:Fault", tag("env:Code", tag("env:Value", side) + inner) + reason), STATUS[side])


class Signatures:
    """Judges the UsernameToken of requests (WSS UsernameToken profile 1.0); each nonce is taken once."""

    def __init__(self, user: str, password: str) -> None:
        self._user, self._password = user, password
        self._nonces: deque[str] = deque(maxlen=NONCES_KEPT)

    def check(self, message: Element, now: float) -> None:
        """Fault unless it is signed by the user, not long ago and for the first time."""
        token = message.find(f".//{{{WSSE}}}UsernameToken")
        if token is None or not self._signed(token, now):
            raise Fault("Sender not Authorized", "env:Sender", "ter:NotAuthorized")

    def _signed(self, token: Element, now: float) -> bool:
        user, secret, nonce, created = (text(token, part) for part in ("Username", "Password", "Nonce", "Created"))
        try:
            raw = base64.b64decode(nonce, validate=True)
            at = datetime.fromisoformat(created).timestamp()
        except (binascii.Error, ValueError):
            return False
        digest = hashlib.sha1(raw + created.encode() + self._password.encode(), usedforsecurity=False).digest()
        if (user, secret) != (self._user, base64.b64encode(digest).decode()):
            return False
        if abs(at - now) > CLOCK_S or nonce in self._nonces:
            return False
        self._nonces.append(nonce)
        return True
