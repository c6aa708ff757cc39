"""The camera's door: known vectors, nonces, lockout."""

from __future__ import annotations

import base64
from dataclasses import replace
from random import Random

import pytest

from services.simulators.camera.digest import Door, Verdict, fields, hashed, response
from services.simulators.camera.profiles import Profile

REALM = "Login to AMC0000000000001"
TARGET = "/cgi-bin/magicBox.cgi?action=getDeviceType"


def _door(profile: Profile | None = None) -> Door:
    return Door(REALM, "admin", "secret123", profile or Profile(), Random(1))


def _nonce(verdict: Verdict) -> str:
    return fields(verdict.challenges[0])["nonce"]


def _header(nonce: str, nc: int = 1, password: str = "secret123", target: str = TARGET) -> str:
    ha1 = hashed(f"admin:{REALM}:{password}")
    said = response(ha1, nonce, f"{nc:08x}", "0a4f113b", "GET", target)
    return (
        f'Digest username="admin", realm="{REALM}", nonce="{nonce}", uri="{target}", qop=auth, nc={nc:08x}, '
        f'cnonce="0a4f113b", response="{said}"'
    )


def test_the_response_of_the_published_example_is_right() -> None:
    ha1 = hashed(f"admin:{REALM}:secret123")
    assert ha1 == "aef8901ffcfae57db2b3433ac934c835"
    assert hashed(f"GET:{TARGET}") == "9155b144760f58d27d4ffac64d51cc06"
    said = response(ha1, "1083253606", "00000001", "0a4f113b", "GET", TARGET)
    assert said == "d0800548eff4f05c60eec55986965032"


def test_the_challenge_has_the_captured_form() -> None:
    challenge = _door().judge("GET", TARGET, None, 0.0).challenges[0]
    parts = challenge.split(",")
    assert parts[:2] == [f'Digest realm="{REALM}"', 'qop="auth"']
    assert [part.partition("=")[0] for part in parts[2:]] == ["nonce", "opaque"]
    spaced = _door(Profile(challenge_spacing="spaced")).judge("GET", TARGET, None, 0.0).challenges[0]
    assert ', qop="auth", nonce=' in spaced


def test_the_right_password_passes_and_a_wrong_one_does_not() -> None:
    door = _door()
    nonce = _nonce(door.judge("GET", TARGET, None, 0.0))
    assert door.judge("GET", TARGET, _header(nonce), 0.0).passed
    assert not door.judge("GET", TARGET, _header(nonce, 2, "wrong"), 0.0).passed
    assert door.counters == {"challenges": 1, "passed": 1, "wrong": 1, "stale": 0, "locked": 0, "spurious": 0}


def test_the_uri_must_be_the_target_byte_for_byte() -> None:
    door = _door()
    nonce = _nonce(door.judge("GET", TARGET, None, 0.0))
    assert not door.judge("GET", TARGET.replace("getDevice", "getdevice"), _header(nonce), 0.0).passed


@pytest.mark.parametrize(("nonce_life", "passes"), [("reusable", True), ("single-use", False)])
def test_a_second_use_of_a_nonce_depends_on_the_firmware(nonce_life: str, passes: bool) -> None:
    door = _door(replace(Profile(), nonce=nonce_life))  # type: ignore[arg-type]
    nonce = _nonce(door.judge("GET", TARGET, None, 0.0))
    assert door.judge("GET", TARGET, _header(nonce, 1), 0.0).passed
    again = door.judge("GET", TARGET, _header(nonce, 2), 0.0)
    assert again.passed is passes
    assert passes or 'stale="true"' in again.challenges[0]


def test_some_firmware_does_not_say_that_it_was_the_nonce() -> None:
    door = _door(Profile(nonce="single-use", stale=False))
    nonce = _nonce(door.judge("GET", TARGET, None, 0.0))
    assert door.judge("GET", TARGET, _header(nonce, 1), 0.0).passed
    again = door.judge("GET", TARGET, _header(nonce, 2), 0.0)
    assert (again.passed, "stale" in again.challenges[0]) == (False, False)
    assert (door.counters["stale"], door.counters["wrong"]) == (1, 0)


def test_a_flaky_firmware_refuses_some_second_uses() -> None:
    door = _door(Profile(nonce="flaky"))
    nonce = _nonce(door.judge("GET", TARGET, None, 0.0))
    seen = {door.judge("GET", TARGET, _header(nonce, nc), 0.0).passed for nc in range(2, 30)}
    assert seen == {True, False}


def test_a_count_is_taken_once_only() -> None:
    door = _door()
    nonce = _nonce(door.judge("GET", TARGET, None, 0.0))
    assert door.judge("GET", TARGET, _header(nonce, 1), 0.0).passed
    assert not door.judge("GET", TARGET, _header(nonce, 1), 0.0).passed


def test_an_unknown_nonce_with_the_right_password_is_stale_and_no_failure() -> None:
    door = _door()
    verdict = door.judge("GET", TARGET, _header("12345"), 0.0)
    assert 'stale="true"' in verdict.challenges[0]
    assert door.record().failures == 0


def test_five_wrong_passwords_lock_even_the_right_one_out_for_half_an_hour() -> None:
    door = _door()
    nonce = _nonce(door.judge("GET", TARGET, None, 0.0))
    for count in range(1, 6):
        door.judge("GET", TARGET, _header(nonce, count, "wrong"), 10.0)
    locked = door.judge("GET", TARGET, _header(nonce, 9), 11.0)
    assert not locked.passed
    assert b"Locked" in locked.body
    assert door.judge("GET", TARGET, _header(nonce, 9), 10.0 + 1801.0).passed


def test_basic_passes_where_the_firmware_takes_it() -> None:
    header = "Basic " + base64.b64encode(b"admin:secret123").decode()
    assert _door(Profile(auth="basic")).judge("GET", TARGET, header, 0.0).passed
    assert not _door(Profile(auth="basic")).judge("GET", TARGET, "Basic !!", 0.0).passed
    assert not _door(Profile(auth="digest")).judge("GET", TARGET, header, 0.0).passed
