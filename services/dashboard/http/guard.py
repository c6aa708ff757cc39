"""Stands before everything: who may come in at all, which session a request belongs to, what headers answers carry.

* The Host must be ours, so that a page elsewhere which gives its own name our address reads nothing (DNS rebinding).
* Without users this machine alone may come, and is an operator.
* A request that changes something must carry the session's token in a header, and must not come from another site:
  a form or a picture of a foreign page can send the cookie (were it not SameSite=Strict), but not that header.
"""

from __future__ import annotations

import hmac
import re
import secrets
import socket
import time
from ipaddress import ip_address

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import cookie_parser
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from services.dashboard.house import House
from services.dashboard.http.endpoint import fault
from services.dashboard.sessions import Session

CSRF_HEADER = "x-csrf-token"
LOGIN = "/api/login"
STRICT = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
        "font-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=(), payment=(), usb=()",
}


def cookie_name(house: House) -> str:
    """The cookie; browsers let `__Host-` cookies be set over TLS and by this very host alone."""
    return "__Host-apartment" if house.config.tls else "apartment"


class Guard:
    """An ASGI application around another."""

    def __init__(self, inside: ASGIApp, house: House) -> None:
        self.inside, self.house = inside, house
        own = socket.gethostname().lower()
        self.names = {"localhost", own, f"{own.partition('.')[0]}.local", *map(str.lower, house.config.names)}
        self.open = Session("this machine", "operator", secrets.token_urlsafe(24), time.time(), time.time())

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return
        headers = Headers(scope=scope)
        scope["session"] = self._session(scope, headers)
        why = self._refusal(scope, headers)

        async def strict(message: Message) -> None:
            if message["type"] == "http.response.start":
                self._add_headers(MutableHeaders(scope=message))
            await send(message)

        await (self.inside if why is None else fault(403, why))(scope, receive, strict)

    def _session(self, scope: Scope, headers: Headers) -> Session | None:
        if not self.house.config.users:
            return self.open
        scope["token"] = cookie_parser(headers.get("cookie", "")).get(cookie_name(self.house))
        return self.house.sessions.find(scope["token"], time.time())

    def _refusal(self, scope: Scope, headers: Headers) -> str | None:
        if not self._knows(headers.get("host", "")):
            return "this name is not mine: add it to dashboard.names in the configuration"
        if not self.house.config.users and not _is_here(scope, headers):
            return "no users are configured, so this machine alone may look: `apartment dashboard user NAME` makes one"
        if scope["method"] in ("GET", "HEAD"):
            return None
        return self._foreign(scope, headers)

    def _foreign(self, scope: Scope, headers: Headers) -> str | None:
        origin = headers.get("origin")
        if origin is not None and origin != f"{scope['scheme']}://{headers.get('host', '')}":
            return "this request comes from another site"
        if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
            return "this request comes from another site"
        session, token = scope["session"], headers.get(CSRF_HEADER, "")
        if scope["path"] == LOGIN or session is None:
            return None  # its JSON cannot be sent by a foreign form; and without a session nothing is done
        if not hmac.compare_digest(token.encode(), session.csrf.encode()):
            return f"the header {CSRF_HEADER} is missing or old: GET /api/session tells it"
        return None

    def _knows(self, host: str) -> bool:
        name = host.lower().rpartition(":")[0] if re.fullmatch(r".*:\d*", host) else host.lower()
        name = name.rstrip(".")
        try:
            address = ip_address(name.removeprefix("[").removesuffix("]"))
        except ValueError:
            return name in self.names
        return address.is_loopback or bool(self.house.config.users)

    def _add_headers(self, headers: MutableHeaders) -> None:
        for name, value in STRICT.items():
            headers.setdefault(name, value)
        headers.setdefault("cache-control", "no-store")
        if self.house.config.tls:
            headers.setdefault("strict-transport-security", "max-age=31536000")


def _is_here(scope: Scope, headers: Headers) -> bool:
    """Whether the one who asks sits at this machine; who comes through a proxy does not."""
    if "x-forwarded-for" in headers or "forwarded" in headers:
        return False
    if not (client := scope.get("client")):
        return False
    address = ip_address(str(client[0]).partition("%")[0])
    return (getattr(address, "ipv4_mapped", None) or address).is_loopback
