"""One HTTP connection to a camera: its timeouts, and its errors as ours. What is said there is the brand's."""

from __future__ import annotations

import httpx

from services.camera.address import Address
from services.camera.device import Away
from services.camera.web import trust
from services.camera.web.digest import Login

COMMAND = httpx.Timeout(6.0, connect=2.0)
STOP = httpx.Timeout(6.0, connect=0.45)  # a lost knock is repeated by the kernel after 1 s only; we knock sooner
PATIENT_STOP = httpx.Timeout(6.0, connect=0.9)  # still within 1 s of the network's return
IN_VAIN, PATIENT_EVERY = 20, 4  # after so many knocks in vain one in so many waits longer
TURNED_AWAY = ("refuses", "reset by peer", "disconnected without")  # which of httpx' errors say that, by their words
SNAPSHOT = httpx.Timeout(20.0, connect=2.0)


def connection(address: Address, login: Login, transport: httpx.BaseTransport | None = None) -> httpx.Client:
    """A client with one connection; `transport` replaces the network in tests."""
    limits = httpx.Limits(max_connections=1, max_keepalive_connections=1)
    return httpx.Client(
        base_url=address.url,
        auth=login,
        timeout=COMMAND,
        limits=limits,
        transport=transport,
        verify=trust.trust(address.url, address.certificate),
        trust_env=False,
    )


def fetch(http: httpx.Client, target: str, timeout: httpx.Timeout = COMMAND) -> httpx.Response:
    """The answer, whatever its status; Away when there is none. Brackets in the target are sent as they are."""
    if timeout in (STOP, PATIENT_STOP) and http.base_url.scheme == "https":
        timeout = COMMAND  # every connection begins with a handshake, for which small processors need longer
    try:
        return http.get(target, timeout=timeout)
    except httpx.HTTPError as error:
        raise lost(error) from error


def knock(number: int) -> httpx.Timeout:
    """The timeouts of a stop after `number - 1` without an answer: on a crowded network one is long on its way."""
    return PATIENT_STOP if number > IN_VAIN and number % PATIENT_EVERY == 0 else STOP


def lost(error: httpx.HTTPError) -> Away:
    """What it means that there is no answer."""
    text = f"{type(error).__name__} {error}".strip()
    if isinstance(error, httpx.ConnectError) and "refused" in text:
        text = "it refuses connections, is starting again or has no web server on"
    away = trust.away(error, f"no answer from the camera: {text}")
    away.turned_away = any(word in text for word in TURNED_AWAY)
    return away


def respelt(target: str) -> str:
    """The same with its brackets encoded, or plain again: firmware disagrees about how it reads them."""
    if "[" in target:
        return target.replace("[", "%5B").replace("]", "%5D")
    return target.replace("%5B", "[").replace("%5D", "]")
