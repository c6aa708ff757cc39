"""Passwords of people, their sessions, and who guesses."""

from __future__ import annotations

import subprocess
import sys

import pytest

from services.dashboard import passwords
from services.dashboard.sessions import FREE_TRIES, LONGEST_S, Sessions, Tries


def test_a_password_fits_its_own_hash_only() -> None:
    one, other = passwords.hashed("open sesame"), passwords.hashed("open sesame")
    assert one != other  # salted
    assert passwords.matches("open sesame", one)
    assert not passwords.matches("open sesamE", one)
    assert not passwords.matches("", one)


def test_nobody_has_a_hash_that_no_password_fits() -> None:
    assert passwords.is_hash(passwords.NOBODY)
    assert not passwords.matches("", passwords.NOBODY)


SALTED = "$8$1$fTFP3+5pHrMkz1GeqCTf0w==$/qa+lfSYkqoh28YQer/REHKmltaupldf9ZGCRwbrdSs="


@pytest.mark.parametrize(
    "text", ["", "open sesame", "scrypt$32768$8$1$short$short", f"scrypt$32767{SALTED}", f"scrypt$4194304{SALTED}"]
)
def test_what_is_no_hash_of_ours_is_told(text: str) -> None:
    assert passwords.is_hash(f"scrypt$32768{SALTED}")
    assert not passwords.is_hash(text)


def test_a_session_is_found_by_its_token_until_it_is_idle_too_long() -> None:
    sessions = Sessions(idle_s=100.0)
    sessions.begin("token", "csrf", "ann", "operator", 0.0)
    assert sessions.find("other", 1.0) is None
    assert sessions.find(None, 1.0) is None
    assert sessions.find("token", 90.0) is not None
    assert sessions.find("token", 180.0) is not None  # it was used meanwhile
    assert sessions.find("token", 281.0) is None
    assert sessions.find("token", 282.0) is None


def test_a_session_ends_after_a_week_even_when_it_is_used() -> None:
    sessions = Sessions(idle_s=LONGEST_S)
    sessions.begin("token", "csrf", "ann", "operator", 0.0)
    assert sessions.find("token", LONGEST_S - 1) is not None
    assert sessions.find("token", LONGEST_S + 1) is None


def test_a_session_that_was_ended_is_gone() -> None:
    sessions = Sessions(idle_s=100.0)
    sessions.begin("token", "csrf", "ann", "operator", 0.0)
    sessions.end("token")
    assert sessions.find("token", 1.0) is None


def test_who_guesses_waits_longer_each_time_and_is_forgiven() -> None:
    tries = Tries()
    for _ in range(FREE_TRIES):
        assert tries.wait_s("ann", 0.0) == 0.0
        tries.wrong("ann", 0.0)
    assert tries.wait_s("ann", 0.0) == 1.0
    assert tries.wait_s("vic", 0.0) == 0.0
    tries.wrong("ann", 1.0)
    assert tries.wait_s("ann", 1.0) == 2.0
    assert tries.wait_s("ann", 1000.0) == 0.0
    tries.right("ann")
    assert tries.wait_s("ann", 1.0) == 0.0


def test_the_command_makes_a_line_that_the_configuration_takes() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "services", "dashboard", "user", "ann", "--role", "operator"], input="open sesame\n",
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith('ann: {role: operator, password: "scrypt$')
    assert passwords.matches("open sesame", done.stdout.split('"')[1])
    assert "sesame" not in done.stdout
