"""The camera's door: Basic and Digest (RFC 2617: MD5, qop="auth"), nonces and lockout. Pure; the time comes in."""

from __future__ import annotations

import base64
import binascii
import re
from dataclasses import dataclass, field
from hashlib import md5
from random import Random

from services.simulators.camera.profiles import Profile

NONCES_KEPT = 64
FLAKY_REFUSALS = 0.5  # of the second and later uses of a nonce, where the firmware is flaky
LOCKED_BODY = b"Error\r\nUser Locked!\r\n"
_PAIR = re.compile(r'(\w+)\s*=\s*(?:"([^"]*)"|([^,\s]+))')


def hashed(text: str) -> str:
    """MD5 as 32 lower-case hexadecimal digits."""
    return md5(text.encode(), usedforsecurity=False).hexdigest()


def response(ha1: str, nonce: str, nc: str, cnonce: str, method: str, uri: str) -> str:
    """The answer to a challenge with qop=auth (RFC 2617, 3.2.2.1)."""
    return hashed(f"{ha1}:{nonce}:{nc}:{cnonce}:auth:{hashed(f'{method}:{uri}')}")


def fields(header: str) -> dict[str, str]:
    """The fields of a Digest header, with or without quotes."""
    return {key.lower(): quoted or bare for key, quoted, bare in _PAIR.findall(header.partition(" ")[2])}


@dataclass
class Verdict:
    """Whether a request may pass; if not, the challenges and the body of the 401."""

    passed: bool
    challenges: list[str] = field(default_factory=list)
    body: bytes = b""


class Door:
    """Judges Authorization headers for one account."""

    def __init__(self, realm: str, user: str, password: str, profile: Profile, rng: Random) -> None:
        self.realm, self.profile = realm, profile
        self.account = ("", "")
        self.set_account(user, password)
        self._rng = rng
        self._used: dict[str, set[str]] = {}  # nonce -> its counts that were used
        self.opaque = f"{rng.getrandbits(104):026x}"
        self.failures, self.locked_until = 0, float("-inf")
        self.counters = {"challenges": 0, "passed": 0, "wrong": 0, "stale": 0, "locked": 0}

    def set_account(self, user: str, password: str) -> None:
        """Gives the account another password; the old one does not pass any more."""
        self.account = (user, password)
        self._ha1 = hashed(f"{user}:{self.realm}:{password}")
        self._basic = base64.b64encode(f"{user}:{password}".encode())

    def judge(self, method: str, target: str, header: str | None, now: float) -> Verdict:
        """`target` is the request target byte for byte; `header` the Authorization header."""
        if now < self.locked_until:
            return self._refused("locked", body=LOCKED_BODY)
        if header is None:
            return self._refused("challenges")
        if header.lower().startswith("basic "):
            return self._basic_verdict(header, now)
        return self._digest_verdict(method, target, fields(header), now)

    def judge_viewer(self, method: str, header: str | None, now: float) -> bool:
        """Counts and locks out over RTSP too, where the response has no qop. Says nothing of the nonce."""
        if now < self.locked_until:
            return self._refused("locked").passed
        if header is None:
            return True  # a challenge follows
        if header.lower().startswith("basic "):
            right = header[6:].strip().encode() == self._basic
        else:
            said = fields(header)
            asked = hashed(f"{method}:{said.get('uri', '')}")
            right = said.get("response") == hashed(f"{self._ha1}:{said.get('nonce', '')}:{asked}")
            right = right and said.get("username") == self.account[0]
        return right or self._wrong(now).passed

    def forget(self) -> None:
        """Drops every nonce (a reboot)."""
        self._used.clear()

    def _basic_verdict(self, header: str, now: float) -> Verdict:
        if "basic" not in self.profile.auth:
            return self._refused("challenges")
        try:
            right = base64.b64encode(base64.b64decode(header[6:].strip(), validate=True)) == self._basic
        except binascii.Error:
            right = False
        return self._passed() if right else self._wrong(now)

    def _digest_verdict(self, method: str, target: str, said: dict[str, str], now: float) -> Verdict:
        if "digest" not in self.profile.auth:
            return self._refused("challenges")
        nonce, nc = said.get("nonce", ""), said.get("nc", "")
        expected = response(self._ha1, nonce, nc, said.get("cnonce", ""), method, target)
        if said.get("uri") != target or said.get("username") != self.account[0] or said.get("response") != expected:
            return self._wrong(now)
        if not self._fresh(nonce, nc):
            return self._refused("stale", stale=True)
        return self._passed()

    def _fresh(self, nonce: str, nc: str) -> bool:
        used = self._used.get(nonce)
        if used is None or nc in used:
            return False
        again, flaky = bool(used), self.profile.nonce == "flaky"
        used.add(nc)
        return not again or not flaky or self._rng.random() >= FLAKY_REFUSALS

    def _passed(self) -> Verdict:
        self.failures = 0
        self.counters["passed"] += 1
        if self.profile.nonce == "single-use":
            self._used = {nonce: used for nonce, used in self._used.items() if not used}
        return Verdict(True)

    def _wrong(self, now: float) -> Verdict:
        self.failures += 1
        if self.failures >= self.profile.lockout_failures:
            self.failures, self.locked_until = 0, now + self.profile.lockout_s
            return self._refused("locked", body=LOCKED_BODY)
        return self._refused("wrong")

    def _refused(self, why: str, *, stale: bool = False, body: bytes = b"") -> Verdict:
        self.counters[why] += 1
        return Verdict(False, self._challenges(stale), body)

    def _challenges(self, stale: bool) -> list[str]:
        offers = []
        if "digest" in self.profile.auth:
            nonce = str(self._rng.randrange(10**8, 2**31))
            self._used = {**dict(list(self._used.items())[1 - NONCES_KEPT :]), nonce: set()}
            parts = [f'realm="{self.realm}"', 'qop="auth"', f'nonce="{nonce}"', f'opaque="{self.opaque}"']
            parts += ['stale="true"'] if stale else []
            offers.append("Digest " + (", " if self.profile.spaced_challenge else ",").join(parts))
        if "basic" in self.profile.auth:
            offers.append(f'Basic realm="{self.realm}"')
        return offers
