"""SOAP 1.2 over HTTP with a UsernameToken digest (WS-Security), as ONVIF wants it; its faults as our errors.

The digest holds the time as the device's own clock tells it: a device with a wrong clock refuses every other login.
What is said in the messages is the brand's.
"""

from __future__ import annotations

import base64
import hashlib
import secrets
import time
from collections.abc import Callable
from datetime import UTC, datetime
from urllib.parse import urlsplit
from xml.etree import ElementTree
from xml.sax.saxutils import escape

import httpx

from services.camera.address import Address
from services.camera.device import Away, BadLogin, Locked, Refused
from services.camera.web.connection import lost
from services.camera.web.gate import ODD_S, Gate

SOAP = "{http://www.w3.org/2003/05/soap-envelope}"
SCHEMA = "{http://www.onvif.org/ver10/schema}"
SECURITY = "http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-"
DEVICE = "http://www.onvif.org/ver10/device/wsdl"
FIRST = "/onvif/device_service"  # the specification fixes this path; where all others are is told there
SKEW_S = 2.0  # a device takes a login whose time is some seconds off, not more
HEADERS = {"Content-Type": "application/soap+xml; charset=utf-8"}


class NotAuthorized(BadLogin):
    """The camera does not take this user, password or time, or the account lacks the right: it has one word for all."""


class Soap:
    """Calls to one device; its clock is asked for once, and again when it takes a login no more."""

    def __init__(
        self,
        http: httpx.Client,
        address: Address,
        gate: Gate,
        clock: Callable[[], float] = time.time,
        *,
        urgent: bool = False,
    ) -> None:
        self.http, self.address, self.gate, self.clock, self.urgent = http, address, gate, clock, urgent
        self._ahead: float | None = None  # the device's clock before ours, seconds
        self._proven = False  # this user and password have worked here

    def call(self, path: str, service: str, action: str, inner: str = "") -> ElementTree.Element:
        """The answer to one signed call; DeviceError when there is none or it is a fault.

        Refused for want of rights: only asking for something that everybody may know tells that from a wrong password.
        """
        body = f'<{action} xmlns="{service}">{inner}</{action}>'
        self.gate.check()
        try:
            return self._login(path, body)
        except NotAuthorized:
            before, self._ahead = self._ahead or 0.0, self._skew()
            if abs(self._ahead - before) < SKEW_S:
                self.gate.pause(ODD_S)
        try:
            return self._login(path, body, sure=not self._proven)
        except NotAuthorized:
            if not self._proven:
                self.gate.check()
                raise
        self._login(FIRST, f'<GetDeviceInformation xmlns="{DEVICE}"/>', sure=True)
        raise Refused("the account has no right to do that")

    def _login(self, path: str, body: str, *, sure: bool = False) -> ElementTree.Element:
        """One try; the gate is told what became of it."""
        if self._ahead is None:
            self._ahead = self._skew()
        with self.gate.login(urgent=self.urgent) as login:
            try:
                answer = self._post(path, body, signed=True)
            except NotAuthorized:
                login.failed(sure=sure)
                raise
            except Refused:
                login.passed()
                raise
            login.passed()
        self._proven = True
        return answer

    def _skew(self) -> float:
        told = self._post(FIRST, f'<GetSystemDateAndTime xmlns="{DEVICE}"/>', signed=False)
        return read_clock(told) - self.clock()

    def _post(self, path: str, body: str, *, signed: bool) -> ElementTree.Element:
        head = ""
        if signed:
            secret = self.address.password.get_secret_value()
            now = self.clock() + (self._ahead or 0.0)
            head = token(self.address.user, secret, now, secrets.token_bytes(16))
        try:
            answer = self.http.post(path, content=envelope(head, body), headers=HEADERS)
        except httpx.HTTPError as error:
            raise lost(error) from error
        if answer.status_code == 404:
            raise Refused("the camera has no such ONVIF service")
        if answer.status_code == 401 and not answer.content.lstrip().startswith(b"<"):
            raise NotAuthorized("the camera does not accept this user and password")
        return read_envelope(answer.status_code, answer.content)


def token(user: str, password: str, now: float, nonce: bytes) -> str:
    """The security header; `now` is the device's own time, seconds since 1970."""
    created = datetime.fromtimestamp(now, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    digest = hashlib.sha1(nonce + created.encode() + password.encode(), usedforsecurity=False).digest()
    hidden, once = (base64.b64encode(data).decode("ascii") for data in (digest, nonce))
    return (
        f'<Security s:mustUnderstand="1" xmlns="{SECURITY}wssecurity-secext-1.0.xsd"><UsernameToken>'
        f"<Username>{escape(user)}</Username>"
        f'<Password Type="{SECURITY}username-token-profile-1.0#PasswordDigest">{hidden}</Password>'
        f'<Nonce EncodingType="{SECURITY}soap-message-security-1.0#Base64Binary">{once}</Nonce>'
        f'<Created xmlns="{SECURITY}wssecurity-utility-1.0.xsd">{created}</Created></UsernameToken></Security>'
    )


def envelope(head: str, body: str) -> bytes:
    """A whole SOAP message."""
    text = f'<s:Envelope xmlns:s="{SOAP[1:-1]}"><s:Header>{head}</s:Header><s:Body>{body}</s:Body></s:Envelope>'
    return f'<?xml version="1.0" encoding="UTF-8"?>{text}'.encode()


def read_envelope(status: int, body: bytes) -> ElementTree.Element:
    """What stands in a message's body; a fault becomes the error that says what to do about it.

    SOAP forbids a document type, so a text with one is refused before it is parsed: no entity is ever expanded.
    """
    try:
        text = body.decode("utf-8-sig")
        if "<!DOCTYPE" in text:
            raise Away("expected SOAP from the camera, got a document type")
        found = ElementTree.fromstring(text).find(f"{SOAP}Body/*")
    except (UnicodeDecodeError, ElementTree.ParseError) as error:
        raise Away(f"expected SOAP from the camera, got {status} {body[:40]!r}") from error
    if found is None:
        raise Away("expected an answer in the camera's SOAP body, got nothing")
    if found.tag == f"{SOAP}Fault":
        raise fault(found)
    return found


def fault(told: ElementTree.Element) -> Refused | BadLogin | Locked | Away:
    """A fault as our error."""
    codes = [(node.text or "").rpartition(":")[2] for node in told.iter(f"{SOAP}Value")]
    reason = " ".join((told.findtext(f"{SOAP}Reason/{SOAP}Text") or " ".join(codes)).split())[:80]
    if any("Lock" in code for code in codes):
        return Locked("the camera has locked this account after wrong passwords")
    if {"NotAuthorized", "FailedAuthentication", "FailedCheck"} & set(codes):
        return NotAuthorized("the camera does not accept this user and password")
    if codes == ["Receiver"]:
        return Away(f"the camera has a fault: {reason}", answered=True)
    return Refused(f"the camera said no: {reason}")


def local(uri: str) -> str:
    """Path and query of an address that the camera tells; Away when it is none."""
    try:
        parts = urlsplit(uri)
        path = f"/{parts.path.lstrip('/')}{'?' if parts.query else ''}{parts.query}"
        httpx.URL(path)
    except (ValueError, httpx.InvalidURL) as error:
        raise Away(f"expected an address from the camera, got {uri[:80]!r}") from error
    return path


def read_clock(told: ElementTree.Element) -> float:
    """The device's time, seconds since 1970."""
    utc = told.find(f".//{SCHEMA}UTCDateTime")
    if utc is None:
        raise Away("expected the camera's time, got none")
    parts = [utc.findtext(f".//{SCHEMA}{part}") for part in ("Year", "Month", "Day", "Hour", "Minute", "Second")]
    try:
        year, month, day, hour, minute, second = (int(part or "") for part in parts)
        return datetime(year, month, day, hour, minute, min(second, 59), tzinfo=UTC).timestamp()
    except (ValueError, OverflowError) as error:
        raise Away(f"expected a date from the camera, got {parts}") from error
