"""The simulated camera's ONVIF side, asked with bare messages: who may ask, what ends a motion, what is refused."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable
from datetime import UTC, datetime

import pytest

from services.simulators.camera import Config
from services.simulators.camera.motors import Pose
from services.simulators.camera.onvif.service import Onvif
from services.simulators.camera.program import inside

NOW = 1_768_000_000.0
WSSE = "http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-wssecurity-secext-1.0.xsd"
WSU = "http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-wssecurity-utility-1.0.xsd"
NAMES = (
    'xmlns:s="http://www.w3.org/2003/05/soap-envelope" xmlns:tds="http://www.onvif.org/ver10/device/wsdl" '
    'xmlns:ptz="http://www.onvif.org/ver20/ptz/wsdl" xmlns:tt="http://www.onvif.org/ver10/schema"'
)
PROFILE = "<ptz:ProfileToken>MediaProfile000</ptz:ProfileToken>"


class Asked:
    """One camera, and a client whose nonces are new each time."""

    def __init__(self, config: Config) -> None:
        self.inside = inside(config, NOW)
        self.onvif = Onvif(self.inside.device, "ros", "secret123")
        self.count = 0

    def header(self, now: float, password: str = "secret123", nonce: bytes | None = None) -> str:
        self.count += 1
        nonce = nonce or self.count.to_bytes(16, "big")
        created = datetime.fromtimestamp(now, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        digest = base64.b64encode(hashlib.sha1(nonce + created.encode() + password.encode()).digest()).decode()
        return (
            f'<w:Security xmlns:w="{WSSE}" xmlns:u="{WSU}"><w:UsernameToken><w:Username>ros</w:Username>'
            f"<w:Password>{digest}</w:Password><w:Nonce>{base64.b64encode(nonce).decode()}</w:Nonce>"
            f"<u:Created>{created}</u:Created></w:UsernameToken></w:Security>"
        )

    def ask(self, body: str, now: float = NOW, header: str | None = None) -> tuple[int, str]:
        header = self.header(now) if header is None else header
        message = f"<s:Envelope {NAMES}><s:Header>{header}</s:Header><s:Body>{body}</s:Body></s:Envelope>"
        answer = self.onvif.answer(message.encode(), "192.0.2.10:80", now)
        return answer.status, answer.body.decode()

    def turn(self, x: float, y: float, timeout: str, now: float = NOW) -> tuple[int, str]:
        velocity = f'<ptz:Velocity><tt:PanTilt x="{x}" y="{y}"/></ptz:Velocity>{timeout}'
        return self.ask(f"<ptz:ContinuousMove>{PROFILE}{velocity}</ptz:ContinuousMove>", now)

    def pose(self, at: float) -> Pose:
        return self.inside.device.motion(at)[0]


@pytest.fixture
def asked(config: Config) -> Asked:
    return Asked(config)


def test_the_time_may_be_asked_without_a_login(asked: Asked) -> None:
    status, text = asked.ask("<tds:GetSystemDateAndTime/>", header="")
    assert status == 200
    assert "<tt:Year>2026</tt:Year>" in text


@pytest.mark.parametrize(
    "header",
    [
        lambda asked: "",
        lambda asked: asked.header(NOW, password="wrong-horse"),
        lambda asked: asked.header(NOW - 60.0),
        lambda asked: asked.header(NOW).replace(">ros<", ">admin<"),
        lambda asked: asked.header(NOW).replace("</w:Nonce>", "%</w:Nonce>"),
    ],
    ids=["none", "password", "clock", "user", "nonce"],
)
def test_who_is_not_who_he_says_is_not_answered(asked: Asked, header: Callable[[Asked], str]) -> None:
    status, text = asked.ask("<tds:GetDeviceInformation/>", header=header(asked))
    assert (status, "ter:NotAuthorized" in text) == (400, True)


def test_a_message_that_was_heard_before_is_not_taken_again(asked: Asked) -> None:
    header = asked.header(NOW)
    assert asked.ask("<tds:GetDeviceInformation/>", header=header)[0] == 200
    assert asked.ask("<tds:GetDeviceInformation/>", header=header)[0] == 400


def test_a_motion_ends_by_itself_when_its_time_is_over(asked: Asked) -> None:
    assert asked.turn(0.5, 0.0, "<ptz:Timeout>PT1.5S</ptz:Timeout>")[0] == 200
    assert asked.inside.device.motion(NOW + 1.0)[1].pan > 0
    assert not any(asked.inside.device.motion(NOW + 3.0)[1])
    assert asked.pose(NOW + 3.0).pan == pytest.approx(15.0, abs=2.0)


def test_a_motion_without_a_time_ends_after_that_of_the_configuration(asked: Asked) -> None:
    asked.turn(0.0, -0.125, "")
    assert any(asked.inside.device.motion(NOW + 9.0)[1])
    assert not any(asked.inside.device.motion(NOW + 11.0)[1])


def test_both_axes_turn_at_once_to_the_right_and_upwards(asked: Asked) -> None:
    asked.turn(0.5, 0.25, "")
    asked.ask(f"<ptz:Stop>{PROFILE}</ptz:Stop>", NOW + 1.0)
    pose = asked.pose(NOW + 3.0)
    assert (5.0 < pose.pan < 20.0, 15.0 < pose.tilt < 20.0) == (True, True)


def test_a_position_is_gone_to_and_told_in_the_generic_space(asked: Asked) -> None:
    position = '<ptz:Position><tt:PanTilt x="0.25" y="-0.5"/><tt:Zoom x="1"/></ptz:Position>'
    assert asked.ask(f"<ptz:AbsoluteMove>{PROFILE}{position}</ptz:AbsoluteMove>")[0] == 200
    _, text = asked.ask(f"<ptz:GetStatus>{PROFILE}</ptz:GetStatus>", NOW + 60.0)
    assert 'x="0.250000" y="-0.500000"' in text
    assert '<tt:Zoom x="1.000000"' in text
    assert "<tt:PanTilt>IDLE</tt:PanTilt>" in text


@pytest.mark.parametrize(
    ("body", "code"),
    [
        ("<ptz:GetStatus><ptz:ProfileToken>other</ptz:ProfileToken></ptz:GetStatus>", "ter:NoProfile"),
        (f"<ptz:GotoPreset>{PROFILE}<ptz:PresetToken>24</ptz:PresetToken></ptz:GotoPreset>", "ter:NoToken"),
        (f"<ptz:SetPreset>{PROFILE}<ptz:PresetToken>24</ptz:PresetToken></ptz:SetPreset>", "ter:NoToken"),
        ("<ptz:GetNode><ptz:NodeToken>other</ptz:NodeToken></ptz:GetNode>", "ter:NoEntity"),
        (f'<ptz:AbsoluteMove>{PROFILE}<ptz:Position><tt:PanTilt x="1.2" y="0"/></ptz:Position></ptz:AbsoluteMove>',
         "ter:InvalidPosition"),
        (f'<ptz:ContinuousMove>{PROFILE}<ptz:Velocity><tt:PanTilt x="nan" y="0"/></ptz:Velocity></ptz:ContinuousMove>',
         "ter:InvalidVelocity"),
        ("<tds:GetUsers/>", "ter:ActionNotSupported"),
    ],
)  # fmt: skip
def test_what_it_cannot_do_is_a_fault_with_the_specifications_code(asked: Asked, body: str, code: str) -> None:
    status, text = asked.ask(body)
    assert (status in (400, 500), code in text) == (True, True), text


def test_presets_are_refused_when_all_are_taken(asked: Asked) -> None:
    answers = [asked.ask(f"<ptz:SetPreset>{PROFILE}</ptz:SetPreset>", NOW + 1.0) for _ in range(17)]
    assert [status for status, _ in answers] == [200] * 16 + [500]
    assert "ter:TooManyPresets" in answers[-1][1]


def test_rubbish_is_a_fault_too(asked: Asked) -> None:
    for body in (b"", b"<", b"\xff\xfe", b"<a/>"):
        assert asked.onvif.answer(body, "", NOW).status == 400
