"""The named sets of switches, and those switches that show on the wire."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from random import Random
from typing import Any, Literal, get_args, get_origin, get_type_hints

import httpx
import pytest

from services.simulators.camera import Config, start
from services.simulators.camera.digest import Door, hashed, realm, response
from services.simulators.camera.digest import fields as said_in
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.profiles import Profile
from services.simulators.camera.program import Simulated

STATUS = "/cgi-bin/ptz.cgi?action=getStatus"
PASSWORD = "secret123"


def _values(kind: Any) -> set[Any]:
    """What a switch may be, where that is a list of words."""
    if kind is bool:
        return {True, False}
    if get_origin(kind) is tuple:
        return {(value,) for value in _values(get_args(kind)[0])}
    return set(get_args(kind)) if get_origin(kind) is Literal else set()


@pytest.mark.parametrize("switch", [field.name for field in fields(Profile) if field.name != "onvif"])
def test_some_named_firmware_has_every_value_of_a_switch(switch: str) -> None:
    used = {getattr(profile, switch) for profile in PROFILES.values()}
    assert _values(get_type_hints(Profile)[switch]) <= used


@contextmanager
def _running(
    config: Config, profile: str = "ip3m-941w-2019", **switches: Any
) -> Iterator[tuple[Simulated, httpx.Client]]:
    given = {**config.model_dump(exclude={"switches"}), "profile": profile, "switches": switches, "password": PASSWORD}
    with start(Config.model_validate(given)) as camera:
        auth: httpx.Auth = httpx.DigestAuth("ros", PASSWORD)
        if camera.server.device.profile.auth == "basic":
            auth = httpx.BasicAuth("ros", PASSWORD)
        with httpx.Client(base_url=camera.url, auth=auth, timeout=10) as client:
            yield camera, client


@pytest.mark.parametrize("name", PROFILES)
def test_every_firmware_lets_an_independent_client_in(config: Config, name: str) -> None:
    with _running(config, name, spurious_401=0.0, nonce="reusable", status_dither=False) as (_, client):
        assert client.get("/cgi-bin/magicBox.cgi?action=getDeviceType").text == f"type={PROFILES[name].model}\r\n"
        channel = PROFILES[name].ptz_channels[0]
        assert "[1]=20.0" in client.get(f"{STATUS}&channel={channel}").text


def test_the_newest_firmware_wants_sha_256(config: Config) -> None:
    with _running(config, "sd2a-2023") as (camera, client):
        first = httpx.get(camera.url + STATUS, timeout=30).headers["www-authenticate"]
        assert "algorithm=SHA-256" in first
        assert 'qop="auth,auth-int"' in first
        assert len(said_in(first)["realm"]) == len("Login to ") + 32
        assert client.get(STATUS).status_code == 200


def test_the_body_is_signed_where_a_client_wants_that() -> None:
    profile = PROFILES["sd2a-2023"]
    door = Door("here", "ros", PASSWORD, profile, Random(1))
    nonce = said_in(door.judge("GET", STATUS, None, 0.0).challenges[0])["nonce"]
    ha1 = hashed(f"ros:here:{PASSWORD}", "SHA-256")
    answer = response(ha1, nonce, "00000001", "c", "GET", STATUS, "auth-int", "SHA-256")
    head = f'Digest username="ros", nonce="{nonce}", uri="{STATUS}", nc=00000001, cnonce="c", algorithm=SHA-256'
    assert not door.judge("GET", STATUS, f'{head}, qop=auth, response="{answer}"', 0.0).passed
    assert door.judge("GET", STATUS, f'{head}, qop=auth-int, response="{answer}"', 0.0).passed


@pytest.mark.parametrize(
    ("form", "expected"),
    [
        ("serial", "Login to AMC0000000000001"),
        ("mac", f"DH_{hashed('AMC0000000000001')[:12].upper()}"),
        ("hex", f"Login to {hashed('AMC0000000000001')}"),
    ],
)
def test_a_realm_names_the_camera_in_its_firmwares_way(form: Any, expected: str) -> None:
    assert realm(replace(Profile(), realm=form), "AMC0000000000001") == expected


def test_header_names_may_be_in_capitals(config: Config) -> None:
    with _running(config, header_case="upper") as (camera, client):
        refused = httpx.get(camera.url + STATUS, timeout=30)
        assert {b"WWW-AUTHENTICATE", b"CONNECTION", b"CONTENT-LENGTH"} == {name for name, _ in refused.headers.raw}
        assert {name for name, _ in client.get(STATUS).headers.raw} == {
            b"CONNECTION",
            b"CONTENT-LENGTH",
            b"CONTENT-TYPE",
        }


@pytest.mark.parametrize(("brackets", "raw", "encoded"), [("both", 200, 200), ("raw", 200, 400), ("encoded", 400, 200)])
def test_firmware_disagrees_about_brackets(config: Config, brackets: str, raw: int, encoded: int) -> None:
    with _running(config, brackets=brackets) as (_, client):
        table = "/cgi-bin/configManager.cgi?action=getConfig&name=VideoInOptions"
        assert client.get(f"{table}[0]").status_code == raw
        assert client.get(f"{table}%5B0%5D").status_code == encoded


@pytest.mark.parametrize("status", [400, 401])
def test_who_is_one_too_many_is_turned_away(config: Config, status: int) -> None:
    attach = "/cgi-bin/eventManager.cgi?action=attach&codes=[VideoMotion]"
    with (
        _running(config, max_connections=2, over_limit=status) as (_, client),
        client.stream("GET", attach),
        client.stream("GET", attach),
    ):
        assert client.get(STATUS).status_code == status


def test_some_good_logins_are_refused_for_no_reason(config: Config) -> None:
    with _running(config, spurious_401=0.5) as (camera, client):
        seen = [client.get(STATUS).status_code for _ in range(30)]
        assert set(seen) == {200, 401}
        assert camera.server.door.record().failures == 0


def test_an_address_is_locked_out_and_others_are_not() -> None:
    door = Door("here", "ros", PASSWORD, replace(Profile(), auth="basic", lockout_of="address"), Random(1))
    for _ in range(5):
        door.judge("GET", STATUS, "Basic d3Jvbmc6cGFzcw==", 0.0, "192.0.2.1")
    right = httpx.BasicAuth("ros", PASSWORD)._auth_header
    assert not door.judge("GET", STATUS, right, 1.0, "192.0.2.1").passed
    assert door.judge("GET", STATUS, right, 1.0, "192.0.2.2").passed


def test_some_snapshots_have_no_answer_or_a_text(config: Config) -> None:
    with _running(config, snapshot_drop=1.0) as (_, client):
        seen = set()
        for _ in range(12):
            try:
                seen.add(client.get("/cgi-bin/snapshot.cgi").text)
            except httpx.TransportError:
                seen.add("nothing")
        assert seen == {"nothing", "busy\r\n"}


def test_a_camera_that_has_just_booted_or_serves_viewers_is_slower(config: Config) -> None:
    with _running(config) as (camera, _):
        latency = camera.server.device.latency
        latency.seconds = 0.3
        assert max(latency.control(0.0) for _ in range(200)) <= 1.2
        latency.viewers = lambda: 4
        assert min(latency.control(0.0) for _ in range(200)) >= 0.2 + 4 * 0.3
        latency.drowsy_until = 100.0
        assert min(latency.control(99.0) for _ in range(200)) >= 3.4
        assert min(latency.control(101.0) for _ in range(200)) < 1.8
