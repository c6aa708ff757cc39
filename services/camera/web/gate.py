"""One camera's login gate: how often a password may be tried, over all connections to that camera together.

Everything that logs in there (control, pictures, events, sound, video) asks the same Gate before it sends credentials
and tells it what came of them. Three logins that fail in a row are the most there will be: then nobody tries for a
while that doubles each time, and a single failure after that while closes it again. A camera locks an account after
about five, and a valid login can meet an odd refusal, so one alone proves nothing. Not here: how credentials are
computed (`digest.py`). The watchdog is a process of its own and has a gate of its own.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

from services.camera.device import Away, BadLogin, Locked
from services.errors import DeviceError

MOST_FAILURES = 3
MOST_ODD, ODD_WINDOW_S = 7, 10.0
PATIENT_S = 2.0  # so long a request waits for a camera that refuses at random, before it gives up
RETRY_S, LONGEST_RETRY_S = 120.0, 1800.0  # a lock lasts about 30 minutes
ODD_S = 0.5  # an odd refusal of a valid login is over after so long
WAY_S = 5.0  # who waits longer for a stop that goes first gives up
PATIENCE_S = 30.0  # who waits longer for the outcome of other logins gives up


@dataclass
class Book:
    """What the gate knows, without clock and threads; times are seconds of any one clock.

    A camera that has just refused a login and then taken it (`ODD_WINDOW_S`) refuses at random: there three failures
    prove less, so a few single tries follow at growing distances before it counts as a wrong password. A nonce that is
    too old for the camera is no such refusal, nor is a password that was wrong until the gate had closed. Where a login
    has passed, two refusals prove nothing: by chance alone they would shut everybody out every few hours.
    """

    retry_s: float = RETRY_S
    failures: int = 0  # in a row
    ever: int = 0  # failures since the beginning
    unanswered: bool = False  # a login since the last that passed: the camera may have counted it as a failure
    flying: int = 0  # logins whose outcome is not known yet
    others: int = 0  # of these, the ones that are not urgent
    closings: int = 0  # in a row
    why: Literal["", "wrong", "locked", "odd"] = ""
    opens_at: float | None = None  # None: it is open
    closed_s: float = 0.0  # how long it was closed the last time
    good: bool = False  # this password was taken at some time
    odd: bool = False  # one of the failures in a row was by chance, if the password is right
    odd_until: float = float("-inf")

    def closed(self, now: float) -> DeviceError | None:
        """Why nobody may try at this time; None: it is open."""
        if self.opens_at is None or now >= self.opens_at:
            return None
        again = f"nobody tries again for {self.closed_s:.0f} s"
        if self.why == "odd":
            return Away(f"the camera refuses good logins at random; {again}")
        if self.why == "locked":
            return Locked(f"the camera has locked this account after wrong passwords; {again}", self.opens_at - now)
        return BadLogin(f"the camera does not accept this user and password; {again}", self.opens_at - now)

    def may_try(self, *, urgent: bool) -> bool:
        """Whether one more login can be afforded whatever becomes of those that are on their way.

        What is urgent waits only for the last of the tries; the rest goes one by one, and alone after a failure.
        """
        if self._counted + self.flying >= MOST_FAILURES:
            return self.flying == 0
        return urgent or (self.others == 0 and (self.failures == 0 or self.flying == 0))

    def tries(self, *, urgent: bool) -> int:
        """One more is on its way; the number is for `passed`."""
        self.flying += 1
        self.others += not urgent
        return self.ever

    @property
    def _counted(self) -> int:
        """Failures in a row as the camera may see them."""
        return self.failures + self.unanswered

    def back(self, *, urgent: bool, answered: bool) -> None:
        """It is not on its way any more."""
        self.flying -= 1
        self.unanswered = self.unanswered or not answered
        self.others -= not urgent

    def passed(self, number: int, now: float) -> None:
        """A login was accepted; it says nothing about those that failed after it was sent."""
        if number == self.ever:
            if self.odd and self.why in ("", "odd"):
                self.odd_until = now + ODD_WINDOW_S
            self.odd, self.good = False, True
            self.failures, self.closings, self.why, self.opens_at = 0, 0, "", None
            self.unanswered = False

    def failed(self, now: float, *, sure: bool, odd: bool = True) -> None:
        """A login was refused; `sure`: it was a repeat with a new challenge, some time after the first.

        Not `odd`: the camera may have refused its nonce.
        """
        self.failures += 1
        self.ever += 1
        self.odd = self.odd or odd
        if now < self.odd_until and not self.closings:
            if self.failures >= MOST_ODD:
                self.close(now, "wrong")
            elif self.failures >= MOST_FAILURES:
                self._shut(now, 2.0 ** (self.failures - MOST_FAILURES), "odd")
        elif (sure and not self.good) or self._counted >= MOST_FAILURES:
            self.close(now, "wrong")

    def close(self, now: float, why: Literal["wrong", "locked"]) -> None:
        """Nobody tries for a while, and then one alone."""
        if self.closed(now) is None:
            self._shut(now, min(LONGEST_RETRY_S, self.retry_s * 2**self.closings), why)
            self.closings += 1
        self.failures = max(self.failures, MOST_FAILURES)
        self.why = "locked" if why == "locked" else self.why

    def _shut(self, now: float, seconds: float, why: Literal["wrong", "locked", "odd"]) -> None:
        self.closed_s, self.opens_at, self.why = seconds, now + seconds, why


class Try:
    """One login that is on its way: tell what became of it before the context ends; nothing when no answer came."""

    def __init__(self, gate: Gate, number: int, *, doubted: bool) -> None:
        self._gate, self._number = gate, number
        self.answered = False
        self.doubted = doubted  # one has failed: another with an old nonce would prove nothing, and is one too many

    def again(self) -> None:
        """It is sent once more, after whatever has failed so far."""
        with self._gate.changed:
            self._number, self.doubted = self._gate.book.ever, self._gate.book.failures > 0

    def passed(self) -> None:
        """The camera knows us (it may refuse what was asked, for want of rights)."""
        self.answered = True
        with self._gate.changed:
            self._gate.book.passed(self._number, self._gate.clock())

    def failed(self, *, sure: bool = False, odd: bool = True) -> None:
        """The camera does not; `sure` when this was a repeat after ODD_S with a new challenge, `odd` as in the book."""
        self.answered = True
        with self._gate.changed:
            self._gate.book.failed(self._gate.clock(), sure=sure, odd=odd)


class Gate:
    """The book for several threads. `pause` waits out an odd refusal."""

    def __init__(
        self,
        retry_s: float = RETRY_S,
        clock: Callable[[], float] = time.monotonic,
        pause: Callable[[float], None] = time.sleep,
    ) -> None:
        self.book = Book(retry_s)
        self.clock = clock
        self.pause = pause
        self.changed = threading.Condition()
        self._mine = threading.local()  # the login of each thread that is on its way
        self.stop_owed = False  # the camera was lost while it turned: a stop is to be the first that reaches it

    def owe(self, on: bool) -> None:
        """A stop is owed from now on, or was confirmed."""
        with self.changed:
            self.stop_owed = on
            self.changed.notify_all()

    def give_way(self, *, urgent: bool) -> None:
        """Before anything is sent: lets a stop go first. Away when that takes too long."""
        with self.changed:
            if not urgent and not self.changed.wait_for(lambda: not self.stop_owed, WAY_S):
                raise Away("a stop goes first, and the camera does not answer it")

    def check(self) -> None:
        """BadLogin or Locked when nobody may try now."""
        with self.changed:
            if (why := self.book.closed(self.clock())) is not None:
                raise why

    def rest(self) -> None:
        """Between a refusal and the next try: waits out an odd one, or raises what closed the gate."""
        with self.changed:
            book, now = self.book, self.clock()
            shut_s = (book.opens_at or now) - now
            if book.closed(now) is None or book.why != "odd" or shut_s > PATIENT_S:
                shut_s = 0.0
        if not shut_s:
            self.check()
        self.pause(max(ODD_S, shut_s))

    def locked(self) -> Locked:
        """The camera said that the account is locked; the error to raise."""
        with self.changed:
            self.book.close(self.clock(), "locked")
            why = self.book.closed(self.clock())
        return why if isinstance(why, Locked) else Locked("the camera has locked this account after wrong passwords")

    @contextmanager
    def login(self, *, urgent: bool = False) -> Iterator[Try]:
        """Around each request that carries credentials, until its first answer. Waits while that may be one too many.

        BadLogin or Locked when nobody may try now, Away when the others take too long. `urgent` is for control.
        A request that carries them twice (SOAP's own, over HTTP that wants some, too) is one login.
        """
        if (outer := getattr(self._mine, "login", None)) is not None:
            outer.again()
            yield outer
            return
        self.give_way(urgent=urgent)
        with self.changed:
            if not self.changed.wait_for(lambda: self._open(urgent), PATIENCE_S):
                raise Away("other logins to this camera have no answer yet")
            number = self.book.tries(urgent=urgent)
            doubted = self.book.failures > 0
        login = self._mine.login = Try(self, number, doubted=doubted)
        try:
            yield login
            login.answered = True  # with anything else: a nonce that was too old, another status
        finally:
            self._mine.login = None
            with self.changed:
                self.book.back(urgent=urgent, answered=login.answered)
                self.changed.notify_all()

    def _open(self, urgent: bool) -> bool:
        if (why := self.book.closed(self.clock())) is not None:
            raise why
        return self.book.may_try(urgent=urgent)
