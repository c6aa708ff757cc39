"""The camera's door: Basic and Digest (RFC 2617 and 7616), nonces and lockout. Pure; the time comes in."""

from __future__ import annotations

import base64
import binascii
import hashlib
import re
from dataclasses import dataclass, field
from random import Random

from services.simulators.camera.profiles import Profile

NONCES_KEPT = 64
FLAKY_REFUSALS = 0.5  # of the second and later uses of a nonce, where the firmware is flaky
LOCKED_BODY = b"Error\r\nUser Locked!\r\n"
HASHES = {"MD5": "md5", "SHA-256": "sha256"}
_PAIR = re.compile(r'([\w-]+)\s*=\s*(?:"([^"]*)"|([^,\s]+))')


def hashed(text: str, algorithm: str = "MD5") -> str:
    """The hash as lower-case hexadecimal digits."""
    return hashlib.new(HASHES[algorithm], text.encode(), usedforsecurity=False).hexdigest()


def response(
    ha1: str, nonce: str, nc: str, cnonce: str, method: str, uri: str, qop: str = "auth", algorithm: str = "MD5"
) -> str:
    """The answer to a challenge with qop (RFC 2617, 3.2.2.1); for auth-int of a request without a body."""
    asked = f"{method}:{uri}:{hashed('', algorithm)}" if qop == "auth-int" else f"{method}:{uri}"
    return hashed(f"{ha1}:{nonce}:{nc}:{cnonce}:{qop}:{hashed(asked, algorithm)}", algorithm)


def fields(header: str) -> dict[str, str]:
    """The fields of a Digest header, with or without quotes."""
    return {key.lower(): quoted or bare for key, quoted, bare in _PAIR.findall(header.partition(" ")[2])}


@dataclass
class Verdict:
    """Whether a request may pass; if not, the challenges and the body of the 401."""

    passed: bool
    challenges: list[str] = field(default_factory=list)
    body: bytes = b""


@dataclass
class Record:
    """What an account, or an address, has to answer for."""

    failures: int = 0
    locked_until: float = float("-inf")


class Door:
    """Judges Authorization headers for one account; `refuses` is how often a good login is refused all the same."""

    def __init__(self, realm: str, user: str, password: str, profile: Profile, rng: Random) -> None:
        self.realm, self.profile = realm, profile
        self._rng = rng
        self._used: dict[str, set[str]] = {}  # nonce -> its counts that were used
        self._records: dict[str, Record] = {}
        self.set_account(user, password)
        self.first_account, self.locked = self.account, False
        self.opaque = f"{rng.getrandbits(104):026x}"
        self.refuses = profile.spurious_401
        self.counters = {"challenges": 0, "passed": 0, "wrong": 0, "stale": 0, "locked": 0, "spurious": 0}

    def set_account(self, user: str, password: str) -> None:
        """Gives the account another password; the old one does not pass any more."""
        self.account = (user, password)
        self._ha1 = {name: hashed(f"{user}:{self.realm}:{password}", name) for name in HASHES}
        self._basic = base64.b64encode(f"{user}:{password}".encode())

    def judge(self, method: str, target: str, header: str | None, now: float, address: str = "") -> Verdict:
        """`target` is the request target byte for byte; `header` the Authorization header; `address` who asks."""
        record = self.record(address)
        if self.locked or now < record.locked_until:
            return self._refused("locked", body=LOCKED_BODY)
        if header is None:
            return self._refused("challenges")
        if header.lower().startswith("basic "):
            verdict = self._basic_verdict(header)
        else:
            verdict = self._digest_verdict(method, target, fields(header))
        if verdict is None:
            return self._wrong(record, now)
        if verdict.passed:
            record.failures = 0
        return verdict

    def record(self, address: str = "") -> Record:
        """Who is locked out for failures from this address: the account, or the address alone."""
        return self._records.setdefault(address if self.profile.lockout_of == "address" else "", Record())

    def judge_viewer(self, method: str, header: str | None, now: float) -> bool:
        """Counts and locks out over RTSP too, where the response has no qop. Says nothing of the nonce."""
        record = self.record()
        if self.locked or now < record.locked_until:
            return self._refused("locked").passed
        if header is None:
            return True  # a challenge follows
        if header.lower().startswith("basic "):
            right = header[6:].strip().encode() == self._basic
        else:
            said = fields(header)
            asked = hashed(f"{method}:{said.get('uri', '')}")
            right = said.get("response") == hashed(f"{self._ha1['MD5']}:{said.get('nonce', '')}:{asked}")
            right = right and said.get("username") == self.account[0]
        return right or self._wrong(record, now).passed

    def forget(self) -> None:
        """Drops every nonce (a reboot)."""
        self._used.clear()

    def unlock(self) -> None:
        """Forgives every failure."""
        self._records.clear()

    def _basic_verdict(self, header: str) -> Verdict | None:
        if "basic" not in self.profile.auth:
            return self._refused("challenges")
        try:
            right = base64.b64encode(base64.b64decode(header[6:].strip(), validate=True)) == self._basic
        except binascii.Error:
            right = False
        return self._passed() if right else None

    def _digest_verdict(self, method: str, target: str, said: dict[str, str]) -> Verdict | None:
        """None: a wrong password."""
        algorithm, qop = said.get("algorithm", "MD5").upper(), said.get("qop", "auth")
        if "digest" not in self.profile.auth or algorithm not in self.profile.digest_algorithms:
            return self._refused("challenges")
        if qop not in self.profile.qop.split(","):
            return None
        nonce, nc, cnonce = said.get("nonce", ""), said.get("nc", ""), said.get("cnonce", "")
        expected = response(self._ha1[algorithm], nonce, nc, cnonce, method, target, qop, algorithm)
        if said.get("uri") != target or said.get("username") != self.account[0] or said.get("response") != expected:
            return None
        return self._passed() if self._fresh(nonce, nc) else self._refused("stale", stale=True)

    def _fresh(self, nonce: str, nc: str) -> bool:
        used = self._used.get(nonce)
        if used is None or nc in used:
            return False
        again, flaky = bool(used), self.profile.nonce == "flaky"
        used.add(nc)
        return not again or not flaky or self._rng.random() >= FLAKY_REFUSALS

    def _passed(self) -> Verdict:
        if self.profile.nonce == "single-use":
            self._used = {nonce: used for nonce, used in self._used.items() if not used}
        if self.refuses and self._rng.random() < self.refuses:
            return self._refused("spurious")
        self.counters["passed"] += 1
        return Verdict(True)

    def _wrong(self, record: Record, now: float) -> Verdict:
        record.failures += 1
        if record.failures >= self.profile.lockout_failures:
            record.failures, record.locked_until = 0, now + self.profile.lockout_s
            return self._refused("locked", body=LOCKED_BODY)
        return self._refused("wrong")

    def _refused(self, why: str, *, stale: bool = False, body: bytes = b"") -> Verdict:
        self.counters[why] += 1
        return Verdict(False, self.challenges(stale=stale), body)

    def challenges(self, *, stale: bool = False) -> list[str]:
        """What to answer to, with a new nonce."""
        offers = [self._digest(name, stale) for name in self.profile.digest_algorithms if "digest" in self.profile.auth]
        return offers + ([f'Basic realm="{self.realm}"'] if "basic" in self.profile.auth else [])

    def _digest(self, algorithm: str, stale: bool) -> str:
        nonce = str(self._rng.randrange(10**8, 2**31))
        self._used = {**dict(list(self._used.items())[1 - NONCES_KEPT :]), nonce: set()}
        parts = [f'realm="{self.realm}"', f'qop="{self.profile.qop}"', f'nonce="{nonce}"', f'opaque="{self.opaque}"']
        parts += [f"algorithm={algorithm}"] if algorithm != "MD5" else []
        parts += ['stale="true"'] if stale and self.profile.stale else []
        return "Digest " + (", " if self.profile.challenge_spacing == "spaced" else ",").join(parts)


def realm(profile: Profile, serial: str) -> str:
    """What the camera calls itself at its door: its serial number, in old firmware its MAC, in new one a digest."""
    if profile.realm == "mac":
        return f"DH_{hashed(serial)[:12].upper()}"
    return f"Login to {serial if profile.realm == 'serial' else hashed(serial)}"
