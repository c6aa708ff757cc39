"""HTTP Digest and Basic authentication that reuses the camera's challenge (RFC 7616, RFC 2617).

The last challenge is tried again with the next count. On a 401 the new challenge is taken once and the request
repeated; a second 401 goes to the caller. Never a loop: wrong passwords lock the account.
"""

from __future__ import annotations

import hashlib
import re
import secrets
from collections.abc import Callable, Generator
from dataclasses import dataclass, field

import httpx
from pydantic import SecretStr

_FIELD = re.compile(r'(\w+)\s*=\s*(?:"([^"]*)"|([^\s,]+))')
HASHES = {"md5": hashlib.md5, "sha-256": hashlib.sha256}


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


class Login(httpx.Auth):
    """One account; keeps the last challenge. `refused` counts 401 answers, for the diagnostics."""

    def __init__(
        self, user: str, password: SecretStr, cnonce: Callable[[], str] = lambda: secrets.token_hex(8)
    ) -> None:
        self.user = user
        self.password = password
        self.cnonce = cnonce
        self.challenge: Challenge | None = None
        self.refused = 0

    def auth_flow(self, request: httpx.Request) -> Generator[httpx.Request, httpx.Response, None]:
        """Sends with what is known, and once more with a new challenge."""
        if self.challenge is not None:
            self._sign(request, self.challenge)
        response = yield request
        if response.status_code != 401:
            return
        self.refused += 1
        self.challenge = read_challenge(response.headers.get_list("www-authenticate"))
        if self.challenge is None:
            return
        self._sign(request, self.challenge)
        response = yield request
        if response.status_code == 401:
            self.challenge = None

    def _sign(self, request: httpx.Request, challenge: Challenge) -> None:
        secret = self.password.get_secret_value()
        if challenge.scheme == "basic":
            login = httpx.BasicAuth(self.user, secret)
            next(login.auth_flow(request))
            return
        challenge.count += 1
        target = request.url.raw_path.decode("ascii")
        request.headers["Authorization"] = authorization(
            challenge, self.user, secret, request.method, target, self.cnonce()
        )
