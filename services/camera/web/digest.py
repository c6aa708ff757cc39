"""HTTP Digest and Basic authentication that reuses the camera's challenge (RFC 7616, RFC 2617).

The last challenge is tried again with the next count. On a 401 the new challenge is taken and the request repeated;
after a second 401 once more half a second later. How many logins may fail at all is decided in `gate.py`.
"""

from __future__ import annotations

import base64
import hashlib
import re
import secrets
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import Literal

import httpx
from pydantic import SecretStr

from services.camera.web.gate import Gate
from services.errors import DeviceError

_FIELD = re.compile(r'(\w+)\s*=\s*(?:"([^"]*)"|([^\s,]+))')
_STALE = re.compile(r"stale\s*=\s*\"?true", re.IGNORECASE)
MOST_SENDS = 6  # of one request: bare, old nonce, new, new after a while, and a stale one or two between them
VAIN, SELDOM = 4, 100  # old nonces refused in a row until they are no longer tried; then one in so many requests
DOUBTED = 10  # so many requests go without an old nonce after one was refused and nothing said why
RELIABLE = 20  # old nonces taken in a row, after which a refusal is hardly one of the nonce
RELIED = 10  # as many, after which a camera that was away and refuses one has lost them
HASHES = {"md5": hashlib.md5, "sha-256": hashlib.sha256}
Outcome = Literal["passed", "stale", "refused"]


@dataclass
class Challenge:
    """What the camera asked for; `count` is how often its nonce was used."""

    scheme: str  # "digest" or "basic"
    realm: str = ""
    nonce: str = ""
    opaque: str | None = None
    qop: str | None = None
    algorithm: str = "MD5"
    count: int = field(default=0)


def read_challenge(headers: list[str]) -> Challenge | None:
    """The strongest challenge in the `WWW-Authenticate` headers that we can answer."""
    basic: Challenge | None = None
    digests: list[Challenge] = []
    for header in headers:
        scheme, _, rest = header.strip().partition(" ")
        values = {name.lower(): quoted or bare for name, quoted, bare in _FIELD.findall(rest)}
        if scheme.lower() == "basic":
            basic = Challenge("basic", realm=values.get("realm", ""))
        elif scheme.lower() == "digest" and values.get("algorithm", "MD5").lower() in HASHES:
            digests.append(_digest(values))
    digests.sort(key=lambda challenge: challenge.algorithm.lower() != "sha-256")
    return digests[0] if digests else basic


def says_stale(headers: list[str]) -> bool:
    """Whether it was the nonce that was refused, and the password is right."""
    return any(_STALE.search(header) for header in headers)


def _digest(values: dict[str, str]) -> Challenge:
    offered = [option.strip() for option in values.get("qop", "").split(",")]
    return Challenge(
        "digest",
        realm=values.get("realm", ""),
        nonce=values.get("nonce", ""),
        opaque=values.get("opaque"),
        qop="auth" if "auth" in offered else None,
        algorithm=values.get("algorithm", "MD5"),
    )


def authorization(challenge: Challenge, user: str, password: str, method: str, uri: str, cnonce: str) -> str:
    """The `Authorization` header of a Digest; `uri` is the request target byte for byte."""
    hashed = HASHES[challenge.algorithm.lower()]

    def digest(text: str) -> str:
        return hashed(text.encode()).hexdigest()

    first = digest(f"{user}:{challenge.realm}:{password}")
    second = digest(f"{method}:{uri}")
    count = f"{challenge.count:08x}"
    middle = f"{challenge.nonce}:{count}:{cnonce}:{challenge.qop}" if challenge.qop else challenge.nonce
    fields = [
        f'username="{user}"',
        f'realm="{challenge.realm}"',
        f'nonce="{challenge.nonce}"',
        f'uri="{uri}"',
        f'response="{digest(f"{first}:{middle}:{second}")}"',
    ]
    if challenge.qop:
        fields += [f"qop={challenge.qop}", f"nc={count}", f'cnonce="{cnonce}"']
    if challenge.algorithm != "MD5":
        fields.append(f"algorithm={challenge.algorithm}")
    if challenge.opaque is not None:
        fields.append(f'opaque="{challenge.opaque}"')
    return "Digest " + ", ".join(fields)


def header(challenge: Challenge, user: str, password: str, method: str, uri: str, cnonce: str) -> str:
    """The `Authorization` header that answers a challenge of either kind; counts the use of its nonce."""
    if challenge.scheme == "basic":
        return "Basic " + base64.b64encode(f"{user}:{password}".encode()).decode()
    challenge.count += 1
    return authorization(challenge, user, password, method, uri, cnonce)


@dataclass
class Nonces:
    """Whether this firmware takes a nonce more than once, learnt from what it does."""

    vain: int = 0  # uses of an old nonce in a row that were refused
    taken: int = 0  # ... and that passed
    doubted: int = 0  # requests that will go without one: what a new one meets tells whether the camera is at fault
    skipped: int = 0

    def worth_a_try(self) -> bool:
        """Whether to send an old nonce; seldom where that was always refused: firmware gets updates."""
        if self.doubted:
            self.doubted -= 1
            return False
        if self.vain < VAIN:
            return True
        self.skipped = (self.skipped + 1) % SELDOM
        return self.skipped == 0

    @property
    def reliable(self) -> bool:
        """Whether this firmware takes old nonces, as far as one can see."""
        return self.taken >= RELIABLE

    def used(self, outcome: Outcome) -> None:
        """An old nonce was sent."""
        self.doubted = DOUBTED if outcome == "refused" and not self.reliable else 0
        self.vain, self.taken = (0, self.taken + 1) if outcome == "passed" else (self.vain + 1, 0)


class Login(httpx.Auth):
    """One connection's way through the gate; keeps the last challenge. `refused` counts 401 answers.

    `urgent`: it carries the orders to the motors, which do not wait for other connections.
    """

    def __init__(
        self,
        user: str,
        password: SecretStr,
        gate: Gate,
        cnonce: Callable[[], str] = lambda: secrets.token_hex(8),
        *,
        urgent: bool = False,
    ) -> None:
        self.user = user
        self.password = password
        self.gate = gate
        self.cnonce = cnonce
        self.urgent = urgent
        self.challenge: Challenge | None = None
        self.nonces = Nonces()
        self.refused = 0
        self._answered = True  # the last request
        self._known: bool | None = None

    def recall(self) -> bool | None:
        """Whether the camera knew an old login when it answered again after it had not; None: nothing tells. Once."""
        known, self._known = self._known, None
        return known

    def auth_flow(self, request: httpx.Request) -> Generator[httpx.Request, httpx.Response, None]:
        """Sends with what is known, after a refusal with the new challenge, and after one more refusal once again.

        BadLogin or Locked when the gate is closed, or closes; a 401 that proves nothing goes to the caller.
        """
        self.gate.give_way(urgent=self.urgent)
        self._enter()
        again, self._answered = not self._answered, False
        refusals = 0
        for _ in range(MOST_SENDS):
            if self.challenge is None:
                request.headers.pop("Authorization", None)
                outcome = self._read((yield request))
                if outcome == "passed" or self.challenge is None:
                    return
                continue
            if refusals:
                self.gate.rest()
            old = self.challenge.count > 0
            with self.gate.login(urgent=self.urgent) as login:
                if old and login.doubted:
                    self.challenge = None
                    continue
                self._sign(request, self.challenge)
                outcome = self._read((yield request))
                if outcome == "passed":
                    login.passed()
                elif outcome == "refused":
                    login.failed(sure=refusals > 0, odd=not old or self.nonces.reliable)
            if old and again and self.nonces.taken >= RELIED:
                self._known = outcome == "passed"
            if old:
                self.nonces.used(outcome)
            if outcome == "passed":
                return
            refusals += outcome == "refused" and not old
        self.gate.check()

    def _enter(self) -> None:
        """After a time at the closed gate the first request goes bare: it tells whether the account is still locked."""
        try:
            self.gate.check()
        except DeviceError:
            self.challenge = None
            raise
        if self.challenge is not None and self.challenge.count > 0 and not self.nonces.worth_a_try():
            self.challenge = None

    def _read(self, response: httpx.Response) -> Outcome:
        """What an answer says of the login, and the challenge in it; Locked when it says that. Stale: another nonce."""
        self._answered = True
        if response.status_code != 401:
            return "passed"
        self.refused += 1
        text = response.read()[:200]
        if b"User Locked" in text:
            self.challenge = None
            raise self.gate.locked()
        if b"Invalid Authority" in text:
            return "passed"
        headers = response.headers.get_list("www-authenticate")
        self.challenge = read_challenge(headers)
        return "stale" if says_stale(headers) else "refused"

    def _sign(self, request: httpx.Request, challenge: Challenge) -> None:
        secret = self.password.get_secret_value()
        target = request.url.raw_path.decode("ascii")
        request.headers["Authorization"] = header(challenge, self.user, secret, request.method, target, self.cnonce())
