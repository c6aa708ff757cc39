"""ONVIF's messages: the signature byte for byte, faults as errors, clocks that are off, and positions in each space."""

from __future__ import annotations

import base64
from collections.abc import Callable
from datetime import UTC, datetime
from xml.etree import ElementTree

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import SecretStr

from services.camera.address import Address
from services.camera.brands.onvif import GENERIC as BOUNDS
from services.camera.brands.onvif import (
    MEDIA,
    PTZ,
    Onvif,
    Profile,
    position,
    read_capabilities,
    read_presets,
    read_profile,
    read_reading,
)
from services.camera.device import Away, BadLogin, FindStream, Locked, Reading, Refused, Status, StreamAddress
from services.camera.web.gate import Gate
from services.camera.web.soap import DEVICE, FIRST, SCHEMA, Soap, envelope, read_envelope, token

ADDRESS = Address("http://192.0.2.10", "admin", SecretStr("secret123"))
NOW = 1_768_000_000.0
SPACES = {"media": MEDIA, "ptz": PTZ, "events": "http://www.onvif.org/ver10/events/wsdl"}
GENERIC = Profile("p", (-1.0, 1.0), (-1.0, 1.0), (0.0, 1.0))


def fault(*codes: str) -> bytes:
    values = "".join(f"<e:Value>{code}</e:Value>" for code in codes)
    reason = '<e:Reason><e:Text xml:lang="en">as it says</e:Text></e:Reason>'
    return envelope(
        "", f'<e:Fault xmlns:e="http://www.w3.org/2003/05/soap-envelope"><e:Code>{values}</e:Code>{reason}</e:Fault>'
    )


def clock(hour: int) -> bytes:
    return envelope("", (
        '<a xmlns="http://www.onvif.org/ver10/schema"><UTCDateTime><Time><Hour>'
        f"{hour}</Hour><Minute>0</Minute><Second>60</Second></Time><Date><Year>2026</Year><Month>1</Month><Day>9</Day>"
        "</Date></UTCDateTime></a>"
    ))  # fmt: skip


def test_the_digest_is_that_of_the_onvif_programmers_guide() -> None:
    at = datetime(2010, 9, 16, 7, 50, 45, tzinfo=UTC).timestamp()
    text = token("user", "userpassword", at, base64.b64decode("LKqI6G/AikKCQrN0zqZFlg=="))
    assert ">2010-09-16T07:50:45Z<" in text
    assert ">tuOSpGlFlIXsozq4HFNeeGeFLEI=<" in text


@pytest.mark.parametrize(
    ("codes", "kind"),
    [
        (("s:Sender", "ter:NotAuthorized"), BadLogin),
        (("s:Sender", "wsse:FailedAuthentication"), BadLogin),
        (("s:Sender", "ter:AccountLocked"), Locked),
        (("s:Sender", "ter:InvalidArgVal", "ter:NoToken"), Refused),
        (("s:Receiver", "ter:ActionNotSupported"), Refused),
        (("s:Receiver", "ter:Action", "ter:MovingPTZ"), Refused),
        (("s:Receiver",), Away),
    ],
)
def test_a_fault_is_the_error_that_says_what_to_do(codes: tuple[str, ...], kind: type[Exception]) -> None:
    with pytest.raises(kind) as raised:
        read_envelope(400, fault(*codes))
    assert isinstance(raised.value, kind)
    assert getattr(raised.value, "answered", True)


class Device:
    """Answers in turn; remembers when each signature says that it was made."""

    def __init__(self, *answers: bytes) -> None:
        self.answers, self.created = list(answers), list[str]()

    def __call__(self, request: httpx.Request) -> httpx.Response:
        _, found, rest = request.content.decode().partition('utility-1.0.xsd">')
        self.created.append(rest[:16] if found else "unsigned")
        return httpx.Response(200, content=self.answers.pop(0))


def soap(device: Callable[[httpx.Request], httpx.Response]) -> Soap:
    http = httpx.Client(base_url=ADDRESS.url, transport=httpx.MockTransport(device))
    return Soap(http, ADDRESS, Gate(pause=lambda seconds: None), lambda: NOW)


def test_a_login_holds_the_time_of_the_cameras_own_clock() -> None:
    device = Device(clock(3), envelope("", "<done/>"), envelope("", "<done/>"))
    calls = soap(device)
    assert calls.call(FIRST, "x", "Do").tag == "done"
    calls.call(FIRST, "x", "Do")
    assert device.created == ["unsigned", "2026-01-09T03:00", "2026-01-09T03:00"]


def test_a_camera_whose_clock_was_set_is_asked_for_the_time_again() -> None:
    device = Device(clock(3), fault("ter:NotAuthorized"), clock(7), envelope("", "<done/>"))
    assert soap(device).call(FIRST, "x", "Do").tag == "done"
    assert device.created == ["unsigned", "2026-01-09T03:00", "unsigned", "2026-01-09T07:00"]


def test_a_wrong_password_is_tried_twice_and_no_more() -> None:
    refused = fault("ter:NotAuthorized")
    device = Device(clock(3), refused, clock(3), refused)
    calls = soap(device)
    for _ in range(3):
        with pytest.raises(BadLogin):
            calls.call(FIRST, "x", "Do")
    assert device.answers == []


def test_an_account_without_the_right_is_told_from_a_wrong_password() -> None:
    refused, done = fault("ter:NotAuthorized"), envelope("", "<done/>")
    device = Device(clock(3), done, refused, clock(3), refused, done, done)
    calls = soap(device)
    calls.call(FIRST, "x", "Do")
    with pytest.raises(Refused, match="no right"):
        calls.call(FIRST, "x", "Forbidden")
    assert calls.call(FIRST, "x", "Do").tag == "done"


@pytest.mark.parametrize(
    ("at", "pan", "tilt"),
    [((-1.0, 1.0), 186.0, -10.0), ((1.0, -1.0), 179.0, 108.0), ((0.0, 0.0), 2.5, 49.0)],
)
def test_the_generic_space_is_the_whole_travel(at: tuple[float, float], pan: float, tilt: float) -> None:
    found = read_reading(status(*at), Profile("p", (-1.0, 1.0), (-1.0, 1.0), (0.0, 1.0)), ADDRESS)
    assert (found.pan, found.tilt, found.zoom, found.moving) == (pan, tilt, 4.0, True)


@given(pan=st.floats(186.0, 538.9).map(lambda pan: pan % 360.0), tilt=st.floats(-10.0, 108.0), zoom=st.floats(0.0, 8.0))
def test_a_position_is_read_as_it_was_written(pan: float, tilt: float, zoom: float) -> None:
    for profile in (GENERIC, Profile("p", (-180.0, 180.0), (-120.0, 20.0), (0.0, 1.0))):
        x, y, z = position(Reading(pan, tilt, zoom), profile, ADDRESS)
        again = read_reading(status(x, y, z), profile, ADDRESS)
        assert abs((again.pan - pan + 180.0) % 360.0 - 180.0) < 0.02
        assert abs(again.tilt - tilt) < 0.02
        assert abs(again.zoom - zoom) < 0.02


def test_a_space_in_degrees_is_taken_as_it_is() -> None:
    found = read_reading(status(-30.0, -45.0), Profile("p", (-180.0, 180.0), (-90.0, 10.0), (0.0, 1.0)), ADDRESS)
    assert (found.pan, found.tilt) == (330.0, 45.0)


@pytest.mark.parametrize("x", ["", "nan", "inf", "left"])
def test_a_position_that_is_no_number_is_no_position(x: str) -> None:
    with pytest.raises(Away):
        read_reading(status(x, 0.0), Profile("p", (-1.0, 1.0), (-1.0, 1.0), (0.0, 1.0)), ADDRESS)


@pytest.mark.parametrize(("low", "high"), [("-INF", "INF"), ("0", "INF"), ("NaN", "1"), ("1", "0"), ("", "1")])
def test_a_space_without_an_end_is_the_generic_one(low: str, high: str) -> None:
    ends = "".join(f"<{axis}><Min>{low}</Min><Max>{high}</Max></{axis}>" for axis in ("XRange", "YRange"))
    spaces = f"<AbsolutePanTiltPositionSpace>{ends}</AbsolutePanTiltPositionSpace>"
    node = ElementTree.fromstring(f'<PTZNode xmlns="http://www.onvif.org/ver10/schema">{spaces}</PTZNode>')
    assert read_profile("p", node) == Profile("p", BOUNDS, BOUNDS, (0.0, 1.0))


def status(x: object, y: object, z: object = 0.5) -> ElementTree.Element:
    return ElementTree.fromstring(
        '<a xmlns="http://www.onvif.org/ver10/schema"><Position>'
        f'<PanTilt x="{x}" y="{y}"/><Zoom x="{z}"/></Position><MoveStatus><PanTilt>MOVING</PanTilt></MoveStatus></a>'
    )


def test_a_camera_without_ptz_service_says_so() -> None:
    services = envelope("", '<GetServicesResponse xmlns="http://www.onvif.org/ver10/device/wsdl"/>')
    camera = Onvif(ADDRESS, Gate(), httpx.MockTransport(Device(clock(3), services)))
    with pytest.raises(Refused, match="does not offer"):
        camera.send(Status())


def test_a_preset_has_the_number_of_our_name_and_that_of_its_token() -> None:
    kept = {"1": "Door", "12": "apartment-3", "preset-a": "apartment-4", "preset-b": "Bed", "9" * 5000: "²", "": ""}
    told = "".join(
        f'<Preset xmlns="{PTZ}" token="{token}"><Name xmlns="http://www.onvif.org/ver10/schema">{name}</Name></Preset>'
        for token, name in kept.items()
    )
    found = read_presets(read_envelope(200, envelope("", f"<a>{told}</a>")))
    assert found == {1: "1", 3: "12", 4: "preset-a", 12: "12"}


def services(**where: str) -> bytes:
    told = "".join(
        f"<Service><Namespace>{SPACES[name]}</Namespace><XAddr>{at}</XAddr></Service>" for name, at in where.items()
    )
    return envelope("", f'<GetServicesResponse xmlns="{DEVICE}">{told}</GetServicesResponse>')


@pytest.mark.parametrize(
    "where", ["http://[fe80::1/media", "http://192.0.2.10/med\x7fia", "http://192.0.2.10/" + 70000 * "a"]
)
def test_a_service_at_no_address_is_away_once_it_is_needed(where: str) -> None:
    camera = Onvif(ADDRESS, Gate(), httpx.MockTransport(Device(clock(3), services(events=where))))
    with pytest.raises(Refused, match="does not offer"):
        camera.send(Status())
    camera = Onvif(ADDRESS, Gate(), httpx.MockTransport(Device(clock(3), services(media=where))))
    for _ in range(2):
        with pytest.raises(Away, match="expected an address"):
            camera.send(Status())


def profiles(node: str) -> str:
    motors = f'<PTZConfiguration xmlns="{SCHEMA[1:-1]}"><NodeToken>{node}</NodeToken></PTZConfiguration>'
    return f'<a xmlns="{MEDIA}"><Profiles token="p">{motors}</Profiles></a>'


def test_motors_without_a_name_are_none() -> None:
    answers = clock(3), services(media="http://10.0.0.9/media"), envelope("", profiles(""))
    with pytest.raises(Refused, match="no ONVIF profile with motors"):
        Onvif(ADDRESS, Gate(), httpx.MockTransport(Device(*answers))).send(Status())


@pytest.mark.parametrize(
    ("uri", "told"),
    [
        ("rtsp://10.0.0.9:554/cam?channel=1", "rtsp://192.0.2.10:554/cam?channel=1"),
        ("rtsp://10.0.0.9//[cam/", "rtsp://192.0.2.10:554/[cam/"),
        ("cam:[1", "rtsp://192.0.2.10:554/[1"),
        ("", "rtsp://192.0.2.10:554/"),
        ("rtsp://[10.0.0.9/cam", Away),
    ],
)
def test_the_stream_is_on_the_host_that_is_configured_wherever_the_camera_says(uri: str, told: str | type) -> None:
    at = services(media="http://10.0.0.9/media", ptz="http://10.0.0.9/ptz")
    stream = f'<a><Uri xmlns="{SCHEMA[1:-1]}">{uri}</Uri></a>'
    answers = clock(3), at, *(envelope("", one) for one in (profiles("n"), "<node/>", stream))
    camera = Onvif(ADDRESS, Gate(), httpx.MockTransport(Device(*answers)))
    if isinstance(told, str):
        assert camera.send(FindStream("main")) == StreamAddress(told)
    else:
        with pytest.raises(told, match="expected an address"):
            camera.send(FindStream("main"))


def test_a_number_of_presets_that_is_none_is_none() -> None:
    node = f'<a xmlns="{SCHEMA[1:-1]}"><MaximumNumberOfPresets>²</MaximumNumberOfPresets></a>'
    assert read_capabilities(ElementTree.fromstring(node)).presets == 0
