"""The probe's own connection: sends requests as they are, signs them by hand, and remembers every exchange.

Not `web/connection`: that hides what the probe wants to see (challenges, header names, refusals).
"""

from __future__ import annotations

import base64
import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx
from pydantic import SecretStr

from services.camera.device import Away, BadLogin, Locked, Refused
from services.camera.lanes import Turning
from services.camera.web.digest import Challenge, authorization, read_challenge
from services.camera.web.trust import away, trust

ANSWER = httpx.Timeout(8.0, connect=3.0)
PICTURE = httpx.Timeout(25.0, connect=3.0)
ODD_S = 0.5  # an odd refusal of a valid login is over after so long
ODD_TRIES = 4


class NoRight(Refused):
    """The account may log in, but not do that."""


@dataclass(frozen=True)
class Exchange:
    """One request and its answer; `status` 0: none came. Header names as the camera writes them."""

    name: str
    target: str
    status: int
    headers: tuple[tuple[str, str], ...] = ()
    body: bytes = b""
    sent: float = 0.0
    seconds: float = 0.0
    method: str = "GET"

    @property
    def text(self) -> str:
        """The body as text."""
        return self.body.decode("utf-8", "replace")

    @property
    def good(self) -> bool:
        """Whether the camera did as asked: 200, and no word of an error."""
        return self.status == 200 and not self.text[:40].lstrip().startswith("Error")

    @property
    def denied(self) -> bool:
        """Whether it knows the account, which has no right to this."""
        return "Invalid Authority" in self.text[:200]

    @property
    def challenges(self) -> list[str]:
        """What it wants to know of us."""
        return [value for key, value in self.headers if key.lower() == "www-authenticate"]


@dataclass
class Wire:
    """One camera, one request at a time. At most one wrong login is ever sent: then it is BadLogin for good."""

    url: str
    user: str
    password: SecretStr
    certificate: Path | None = None  # as in `Address`
    clock: Callable[[], float] = time.monotonic
    pause: Callable[[float], None] = time.sleep
    tell: Callable[[str], None] = lambda detail: None  # what a long step is at
    turning: Turning = lambda what: None  # what turns from now on, before it does (`watchdog.py`); None: nothing
    exchanges: list[Exchange] = field(default_factory=list)
    reuses: bool = False  # a nonce may be used again; found out by `login`
    proven: bool = False  # this user and password have worked
    challenge: Challenge | None = None
    heard: bytes = b""  # of the event stream
    odd: int = 0  # refusals of a login that is known to be good
    http: httpx.Client = field(init=False)

    def __post_init__(self) -> None:
        limits = httpx.Limits(max_connections=2, max_keepalive_connections=0)
        known = trust(self.url, self.certificate)
        self.http = httpx.Client(base_url=self.url, timeout=ANSWER, limits=limits, verify=known, trust_env=False)

    def bare(self, target: str, name: str = "") -> Exchange:
        """Asks without a login."""
        return self._send(target, name, {})

    def signed(self, target: str, challenge: Challenge, name: str = "") -> Exchange:
        """Asks with an answer to that challenge, once; a 401 is given back."""
        return self._send(target, name, {"Authorization": self._authorization("GET", target, challenge)})

    def ask(self, target: str, name: str = "", timeout: httpx.Timeout = ANSWER) -> Exchange:
        """Asks with a login. BadLogin when the first one fails; odd refusals after that are repeated."""
        for _ in range(ODD_TRIES):
            if self.challenge is None or not (self.reuses or self.challenge.scheme == "basic"):
                found = self.bare(target, name)
                if found.status != 401:
                    return found
                self.challenge = self._read(found)
            answer = self._send(
                target, name, {"Authorization": self._authorization("GET", target, self.challenge)}, timeout
            )
            if answer.status != 401 or answer.denied:
                self.proven = True
                return answer
            self._refused(answer)
        return answer

    def post(self, target: str, body: bytes, name: str = "") -> Exchange:
        """Sends a SOAP message without a login."""
        return self._send(target, name, {"Content-Type": "application/soap+xml; charset=utf-8"}, body=body)

    @contextmanager
    def stream(self, target: str, silence_s: float) -> Iterator[httpx.Response]:
        """An endless answer, with a login; httpx.ReadTimeout when nothing comes for so long."""
        try:
            for left in reversed(range(ODD_TRIES)):
                challenge = self._read(self.bare(target))
                headers = {"Authorization": self._authorization("GET", target, challenge)}
                with self.http.stream("GET", target, headers=headers, timeout=httpx.Timeout(silence_s)) as response:
                    if response.status_code != 401 or not left or b"Invalid Authority" in response.read():
                        yield response
                        return
                self.odd += 1
                self.pause(ODD_S)
        except httpx.HTTPError as error:
            raise Away(f"the stream broke off: {type(error).__name__}") from error

    def close(self) -> None:
        """Ends all connections."""
        self.http.close()

    def _refused(self, answer: Exchange) -> None:
        """A login that is not known to be good is never tried again: cameras lock accounts after a few."""
        if "User Locked" in answer.text:
            raise Locked("the camera has locked this account: wait half an hour, then try with the right password")
        stale = any("stale" in one.lower() and "true" in one.lower() for one in answer.challenges)
        if not self.proven and not stale:
            raise BadLogin("the camera does not accept this user and password; one login was tried, no more will be")
        self.odd += not stale
        self.challenge = None
        self.pause(0.0 if stale else ODD_S)

    def _read(self, found: Exchange) -> Challenge:
        if "User Locked" in found.text:
            raise Locked("the camera has locked this account: wait half an hour, then try with the right password")
        challenge = read_challenge(found.challenges)
        if challenge is None:
            raise Away(f"expected a challenge for a login, got {found.status} {found.text[:60]!r}")
        return challenge

    def _authorization(self, method: str, target: str, challenge: Challenge) -> str:
        secret = self.password.get_secret_value()
        if challenge.scheme == "basic":
            return "Basic " + base64.b64encode(f"{self.user}:{secret}".encode()).decode("ascii")
        challenge.count += 1
        return authorization(challenge, self.user, secret, method, target, secrets.token_hex(8))

    def _send(
        self,
        target: str,
        name: str,
        headers: dict[str, str],
        timeout: httpx.Timeout = ANSWER,
        body: bytes | None = None,
    ) -> Exchange:
        sent, method = self.clock(), "GET" if body is None else "POST"
        try:
            response = self.http.request(method, target, headers=headers, timeout=timeout, content=body)
        except httpx.TransportError as error:
            exchange = Exchange(name, target, 0, body=type(error).__name__.encode(), sent=sent)
            if not any(one.status for one in self.exchanges):
                raise away(error, f"nobody answers at {self.url}: {type(error).__name__} {error}".strip()) from error
        else:
            spelled = tuple((key.decode("latin-1"), value.decode("latin-1")) for key, value in response.headers.raw)
            took = self.clock() - sent
            exchange = Exchange(name, target, response.status_code, spelled, response.content, sent, took, method)
        self.exchanges.append(exchange)
        return exchange
