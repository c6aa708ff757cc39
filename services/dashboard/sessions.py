"""Who is logged in, and who has tried too often. Pure: time comes in as `now`, seconds; secrets come in as texts.

Sessions live in memory: a restart of the dashboard ends them. A token is kept as its hash only.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field

from services.dashboard.settings import Role

LONGEST_S = 7 * 86_400.0
MOST = 1000  # sessions; the oldest go
FREE_TRIES = 3  # wrong passwords that nobody waits for
SLOWEST_S = 60.0
FORGOTTEN_S = 900.0  # after so long a wrong password counts no more
MOST_TRIED = 10_000  # names and addresses that are remembered


@dataclass
class Session:
    """One login. `csrf` goes with every request that changes something."""

    user: str
    role: Role
    csrf: str
    began: float
    seen: float


@dataclass
class Sessions:
    """The sessions, by the hash of their token."""

    idle_s: float
    _open: dict[str, Session] = field(default_factory=dict)

    def begin(self, token: str, csrf: str, user: str, role: Role, now: float) -> Session:
        """A new session; its token was known to nobody before."""
        while len(self._open) >= MOST:
            self._open.pop(next(iter(self._open)))
        session = self._open[_hash(token)] = Session(user, role, csrf, now, now)
        return session

    def find(self, token: str | None, now: float) -> Session | None:
        """The session with this token, while it lasts."""
        session = self._open.get(_hash(token)) if token else None
        if session is None:
            return None
        if now - session.seen > self.idle_s or now - session.began > LONGEST_S:
            self.end(token)
            return None
        session.seen = now
        return session

    def end(self, token: str | None) -> None:
        """Ends it."""
        if token:
            self._open.pop(_hash(token), None)


def _hash(token: str) -> str:
    return hashlib.sha256(token.encode()).hexdigest()


@dataclass
class Tries:
    """Slows down who guesses: after some wrong passwords each one doubles the time until the next try is heard.

    Kept by whatever the caller names, a user or an address.
    """

    _wrong: dict[str, tuple[int, float]] = field(default_factory=dict)  # how often, when last

    def wait_s(self, who: str, now: float) -> float:
        """How long until a try counts; 0 when it does now."""
        count, last = self._wrong.get(who, (0, 0.0))
        if count < FREE_TRIES or now - last > FORGOTTEN_S:
            return 0.0
        return max(0.0, last + min(SLOWEST_S, 2.0 ** (count - FREE_TRIES)) - now)

    def wrong(self, who: str, now: float) -> None:
        """Notes a wrong password."""
        count, last = self._wrong.pop(who, (0, now))
        while len(self._wrong) >= MOST_TRIED:
            self._wrong.pop(next(iter(self._wrong)))
        self._wrong[who] = (1 if now - last > FORGOTTEN_S else count + 1, now)

    def right(self, who: str) -> None:
        """Forgets what was wrong before."""
        self._wrong.pop(who, None)
