"""The Amcrest driver: what is sent byte for byte, and every form of answer that firmware gives."""

from __future__ import annotations

import hashlib
from collections.abc import Callable

import httpx
import pytest
from pydantic import SecretStr

from services.camera.address import Address
from services.camera.brands import amcrest
from services.camera.device import (
    Away,
    BadLogin,
    Direction,
    GetPicture,
    GotoPreset,
    Identify,
    Identity,
    Locked,
    Picture,
    Reading,
    Reboot,
    Refused,
    Request,
    SavePreset,
    SetPicture,
    Snapshot,
    Start,
    Status,
    Stop,
)
from services.camera.errands import GetPresets, GetStorage
from services.camera.web.connection import lost
from services.camera.web.digest import Challenge, authorization, read_challenge
from services.camera.web.gate import Gate

NEWER = (
    "status.Action=Preset\r\nstatus.MoveStatus=Idle\r\nstatus.PTS=0\r\nstatus.Postion[0]=91.600000\r\n"
    "status.Postion[1]=-2.600000\r\nstatus.Postion[2]=1.000000\r\nstatus.ZoomStatus=Idle\r\n"
)
SHORT = "status.Postion[0]=29.5\r\nstatus.Postion[1]=13.6\r\nstatus.Zoom=2\r\nstatus.ZoomValue=0\r\n"
SPELLED = NEWER.replace("Postion", "Position").replace("MoveStatus=Idle", "MoveStatus=Moving")


class Web:
    """The camera's side: answers by the target, remembers what it was asked."""

    def __init__(self, **answers: str) -> None:
        self.asked: list[str] = []
        self.headers: list[httpx.Headers] = []
        self.answer: Callable[[str], httpx.Response] = lambda target: httpx.Response(200, text="OK\r\n")

    def __call__(self, request: httpx.Request) -> httpx.Response:
        target = request.url.raw_path.decode()
        self.asked.append(target)
        self.headers.append(request.headers.copy())
        return self.answer(target)


def camera(web: Web, channel: int | None = 1) -> amcrest.Amcrest:
    address = Address("http://192.0.2.10", "admin", SecretStr("secret123"), channel=channel)
    return amcrest.Amcrest(address, httpx.MockTransport(web), Gate(pause=lambda seconds: None))


@pytest.mark.parametrize(
    ("request_", "target"),
    [
        (Start(Direction.LEFT, 3), "ptz.cgi?action=start&channel=1&code=Left&arg1=0&arg2=3&arg3=0"),
        (Start(Direction.UP, 9), "ptz.cgi?action=start&channel=1&code=Up&arg1=0&arg2=8&arg3=0"),
        (Start(Direction.LEFT_UP, 3, 5), "ptz.cgi?action=start&channel=1&code=LeftUp&arg1=5&arg2=3&arg3=0"),
        (Start(Direction.RIGHT_DOWN, 0), "ptz.cgi?action=start&channel=1&code=RightDown&arg1=1&arg2=1&arg3=0"),
        (Start(Direction.ZOOM_IN, 4), "ptz.cgi?action=start&channel=1&code=ZoomTele&arg1=0&arg2=0&arg3=0"),
        (Start(Direction.ZOOM_OUT), "ptz.cgi?action=start&channel=1&code=ZoomWide&arg1=0&arg2=0&arg3=0"),
        (GotoPreset(7), "ptz.cgi?action=start&channel=1&code=GotoPreset&arg1=0&arg2=7&arg3=0"),
        (SavePreset(7), "ptz.cgi?action=start&channel=1&code=SetPreset&arg1=0&arg2=7&arg3=0"),
        (GetPresets(), "ptz.cgi?action=getPresets&channel=1"),
        (Reboot(), "magicBox.cgi?action=reboot"),
    ],
)
def test_each_request_is_one_target(request_: Request, target: str) -> None:
    web = Web()
    web.answer = lambda target: httpx.Response(200, text="" if "getPresets" in target else "OK\r\n")
    camera(web).send(request_)
    assert web.asked == [f"/cgi-bin/{target}"]


@pytest.mark.parametrize(
    ("body", "numbers"),
    [
        ("presets[0].Index=1\r\npresets[0].Name=Kitchen\r\npresets[1].Index=12\r\npresets[1].Name=Sofa\r\n", {1, 12}),
        (
            "presets[0].Index=7\r\npresets[0].Name=a.Index=3\r\npresets[0].Position=[900,-900,5]\r\npresets[0].Type=0",
            {7},
        ),
        ("", set()),
        ("\r\n", set()),
    ],
)
def test_presets_are_told_by_their_numbers_and_not_by_their_place_in_the_list(body: str, numbers: set[int]) -> None:
    web = Web()
    web.answer = lambda target: httpx.Response(200, text=body)
    assert camera(web).send(GetPresets()) == numbers


@pytest.mark.parametrize(
    "body",
    ["OK\r\n", "<html><body>Please log in</body></html>", "presets[0].Name=Sofa\r\n", "presets[0].Index=one\r\n",
     "presets[0].Index=1\r\npresets[1].Na=\r\n", f"presets[0].Index={'9' * 5000}\r\n", "status.Postion[0]=1\r\n"],
)  # fmt: skip
def test_a_list_of_presets_that_makes_no_sense_is_not_taken_for_one(body: str) -> None:
    web = Web()
    web.answer = lambda target: httpx.Response(200, text=body)
    with pytest.raises(Refused, match="does not tell"):
        camera(web).send(GetPresets())


def test_a_stop_carries_the_code_that_was_started() -> None:
    web = Web()
    device = camera(web)
    device.send(Start(Direction.RIGHT_UP, 3, 2))
    device.send(Stop())
    assert web.asked[1] == "/cgi-bin/ptz.cgi?action=stop&channel=1&code=RightUp&arg1=0&arg2=0&arg3=0"


def test_a_stop_of_unknown_motion_stops_every_code_although_some_are_refused() -> None:
    web = Web()
    web.answer = lambda target: httpx.Response(200, text="OK\r\n" if "code=Left&" in target else "Error\r\n")
    camera(web).send(Stop())
    assert len(web.asked) == len(Direction)


def test_a_stop_gets_through_where_it_takes_long_to_be_let_in_and_waits_shortly_until_that_is_likely() -> None:
    waits: list[float] = []
    way_s = float("inf")

    def far(request: httpx.Request) -> httpx.Response:
        waits.append(request.extensions["timeout"]["connect"])
        if waits[-1] < way_s:
            raise httpx.ConnectTimeout("timed out", request=request)
        return httpx.Response(200, text="OK\r\n")

    address = Address("http://192.0.2.10", "admin", SecretStr("secret123"), channel=1)
    device = amcrest.Amcrest(address, httpx.MockTransport(far), Gate(pause=lambda seconds: None))
    device.running = "Left"
    for _ in range(40):
        with pytest.raises(Away):
            device.send(Stop())
    assert waits[:20] == [0.45] * 20  # a network that is back within 10 s is met at once
    assert max(waits) < 1.0  # and any other within 1 s
    way_s = 0.7
    for _ in range(3):
        with pytest.raises(Away):
            device.send(Stop())
    device.send(Stop())
    way_s, waits[:] = 0.0, []
    device.send(Stop())
    assert waits == [0.45]


def test_where_firmware_refuses_plain_brackets_they_are_encoded_from_then_on() -> None:
    web = Web()
    table = "table.VideoInOptions[0].DayNightColor=1\r\ntable.VideoInOptions[0].Flip=true\r\n"
    table += "table.VideoInOptions[0].Mirror=false\r\n"

    def answer(target: str) -> httpx.Response:
        if "[" in target:
            return httpx.Response(400, text="Error\r\nBad Request!\r\n")
        return httpx.Response(200, text=table if "getConfig" in target else "OK\r\n")

    web.answer = answer
    client = camera(web)
    assert client.send(SetPicture(flip=True)) == Picture(True, False, "auto", ("auto", "", ""))
    assert ["[" in target for target in web.asked[:2]] == [True, False]
    before = len(web.asked)
    client.send(SetPicture(flip=True))
    assert not any("[" in target for target in web.asked[before:])


def test_what_is_refused_with_brackets_either_way_is_refused() -> None:
    web = Web()
    web.answer = lambda target: httpx.Response(400, text="Error\r\nBad Request!\r\n")
    client = camera(web)
    for _ in range(2):
        with pytest.raises(Refused, match="400"):
            client.send(SetPicture(flip=True))
    assert ["[" in target for target in web.asked] == [True, False, True, False]


def test_brackets_go_out_as_they_are() -> None:
    web = Web()
    with pytest.raises(Refused):
        camera(web).send(SetPicture(flip=True))
    assert "VideoInOptions[0].Flip=true&VideoInOptions[0].NightOptions.Flip=true" in web.asked[0]


@pytest.mark.parametrize(
    ("body", "reading"),
    [
        (NEWER, Reading(91.6, -2.6, 1.0, False)),
        (SPELLED, Reading(91.6, -2.6, 1.0, True)),
        (SHORT, Reading(29.5, 13.6, 2.0, None)),
        (NEWER + "status.ZoomStatus=Zooming\r\n", Reading(91.6, -2.6, 1.0, True)),
    ],
)
def test_every_form_of_status_is_read(body: str, reading: Reading) -> None:
    web = Web()
    web.answer = lambda target: httpx.Response(200, text=body)
    assert camera(web).send(Status()) == reading


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e999"])
@pytest.mark.parametrize("was", ["=91.6", "=-2.6", "=1.0", "=29.5", "Zoom=2"])
def test_a_position_that_is_no_number_is_none(was: str, value: str) -> None:
    web = Web()
    body = NEWER if was in NEWER else SHORT
    web.answer = lambda target: httpx.Response(200, text=body.replace(was, f"{was.partition('=')[0]}={value}\r\n"))
    with pytest.raises(Away, match="expected a position"):
        camera(web).send(Status())


REFUSAL = (400, "Error\r\nBad Request!\r\n")
NO_POSITION = (200, "\r\n")


def answered(status: int, body: str) -> httpx.Response:
    return httpx.Response(status, text=body)


@pytest.mark.parametrize("works", [1, 0])
@pytest.mark.parametrize("bad", [REFUSAL, NO_POSITION])
def test_the_channel_is_found_by_asking_for_the_status_with_1_then_0(works: int, bad: tuple[int, str]) -> None:
    web = Web()
    web.answer = lambda target: answered(*((200, NEWER) if f"channel={works}" in target else bad))
    device = camera(web, channel=None)
    device.send(Status())
    device.send(Status())
    assert [target[-1] for target in web.asked] == (["1", "1"] if works else ["1", "0", "0"])


@pytest.mark.parametrize(
    ("one", "zero", "error"),
    [
        (REFUSAL, REFUSAL, Refused),
        (NO_POSITION, NO_POSITION, Away),  # a camera that starts may answer so
        (REFUSAL, NO_POSITION, Away),
        (NO_POSITION, REFUSAL, Away),
    ],
)
def test_a_position_on_neither_channel_is_final_where_both_are_refused(
    one: tuple[int, str], zero: tuple[int, str], error: type[Exception]
) -> None:
    web = Web()
    web.answer = lambda target: answered(*(one if "channel=1" in target else zero))
    with pytest.raises(error, match="position"):
        camera(web, channel=None).send(Status())
    assert [target[-1] for target in web.asked] == ["1", "0"]


def test_a_camera_that_is_lost_while_its_channel_is_looked_for_is_away_at_once() -> None:
    web = Web()
    web.answer = lambda target: httpx.Response(500)
    with pytest.raises(Away, match="500"):
        camera(web, channel=None).send(Status())
    assert len(web.asked) == 1


@pytest.mark.parametrize(
    ("body", "version"),
    [
        ("version=2.420.AC00.15.R\r\nBuildDate=2016-09-08\r\n", "2.420.AC00.15.R 2016-09-08"),
        ("version=2.800.0000016.0.R,build:2020-06-05\r\n", "2.800.0000016.0.R 2020-06-05"),
    ],
)
def test_both_forms_of_the_version_are_read(body: str, version: str) -> None:
    web = Web()
    bodies = {"getDeviceType": "type=IP3M-941W\r\n", "getSerialNo": "sn=AMC0000000000001\r\n"}
    web.answer = lambda target: httpx.Response(200, text=bodies.get(target.split("action=")[1], body))
    assert camera(web).send(Identify()) == Identity("IP3M-941W", "AMC0000000000001", version)


@pytest.mark.parametrize(
    ("status", "body", "error"),
    [
        (200, "Error\r\n", Refused),
        (200, "Error\r\nBad Request!\r\n", Refused),
        (400, "Error\r\nBad Request!\r\n", Refused),
        (501, "Error\r\nNot Implemented!\r\n", Refused),
        (200, "name=ok-error\r\n", Refused),
        (401, "Error\r\nInvalid Authority!\r\n", Refused),
        (401, "", Away),
        (401, "Error\r\nUser Locked! 1700 s\r\n", Locked),
        (500, "anything", Away),
    ],
)
def test_an_answer_is_judged_by_status_and_body(status: int, body: str, error: type[Exception]) -> None:
    web = Web()
    web.answer = lambda target: httpx.Response(status, text=body)
    with pytest.raises(error):
        camera(web).send(Start(Direction.LEFT))


@pytest.mark.parametrize(("status", "answered"), [(500, True), (503, True), (401, False)])
def test_a_fault_of_the_cameras_own_is_an_answer(status: int, answered: bool) -> None:
    web = Web()
    web.answer = lambda target: httpx.Response(status, text="anything")
    with pytest.raises(Away) as error:
        camera(web).send(GetStorage())
    assert error.value.answered == answered


def test_no_answer_means_away() -> None:
    def refuse(request: httpx.Request) -> httpx.Response:
        raise httpx.ConnectError("refused")

    device = amcrest.Amcrest(Address("http://192.0.2.10", "a", SecretStr("b")), httpx.MockTransport(refuse))
    with pytest.raises(Away, match="no answer"):
        device.send(Status())


def test_a_snapshot_that_is_no_jpeg_is_an_error_although_the_status_is_200() -> None:
    web = Web()
    web.answer = lambda target: httpx.Response(200, text="Error: busy")
    with pytest.raises((Away, Refused)):
        camera(web).send(Snapshot())


def test_the_mode_is_written_where_the_firmware_keeps_it() -> None:
    web = Web()
    bodies = {
        "name=VideoInOptions": "table.VideoInOptions[0].Flip=true\r\ntable.VideoInOptions[0].Mirror=false\r\n",
        "name=VideoInDayNight": "table.VideoInDayNight[0][0].Mode=BlackWhite\r\n",
    }
    web.answer = lambda target: httpx.Response(200, text=bodies.get(target.split("&")[-1], "OK\r\n"))
    device = camera(web)
    assert device.send(GetPicture()) == Picture(True, False, "bw", ("bw", "", ""))
    device.send(SetPicture(mode="bw"))
    assert any("VideoInDayNight[0][2].Mode=BlackWhite" in target for target in web.asked)


@pytest.mark.parametrize(
    ("options", "mode"),
    [("DayNightColor=2", "DayNightColor=2"), ("", "VideoInDayNight[0][2].Mode=BlackWhite")],
)
def test_mode_and_contrast_are_written_at_once(options: str, mode: str) -> None:
    web = Web()
    bodies = {
        "name=VideoInOptions": "\r\n".join(
            f"table.VideoInOptions[0].{one}" for one in ("Flip=true", "Mirror=false", options)
        ),
        "name=VideoInDayNight": "table.VideoInDayNight[0][0].Mode=BlackWhite\r\n",
    }
    web.answer = lambda target: httpx.Response(200, text=bodies.get(target.split("&")[-1], "OK\r\n"))
    picture = camera(web).send(SetPicture(mode="bw", contrast=(80, 70, 60)))
    assert picture == Picture(True, False, "bw", ("bw", "", ""))
    (written,) = (target for target in web.asked if "setConfig" in target)
    assert mode in written
    assert written.endswith("VideoColor[0][0].Contrast=80&VideoColor[0][1].Contrast=70&VideoColor[0][2].Contrast=60")


OF_OPTIONS = ("[0].DayNightColor=1", "[0].NightOptions.DayNightColor=2", "[0].NormalOptions.DayNightColor=3")
OF_DAY_NIGHT = ("[0][0].Mode=Brightness", "[0][1].Mode=BlackWhite", "[0][2].Mode=Gain")


@pytest.mark.parametrize(
    ("name", "lines", "unknown", "colour"),
    [("VideoInOptions", OF_OPTIONS, "3", "0"), ("VideoInDayNight", OF_DAY_NIGHT, "Gain", "Color")],
)
def test_each_profile_has_a_mode_of_its_own_that_is_written_back_as_it_was(
    name: str, lines: tuple[str, ...], unknown: str, colour: str
) -> None:
    web, tables = Web(), {"VideoInOptions": ["[0].Flip=true", "[0].Mirror=false"]}
    tables[name] = [*tables.get(name, []), *lines]
    bodies = {f"name={one}": "".join(f"table.{one}{line}\r\n" for line in tables[one]) for one in tables}
    web.answer = lambda target: httpx.Response(200, text=bodies.get(target.split("&")[-1], "OK\r\n"))
    device = camera(web)
    assert device.send(GetPicture()) == Picture(True, False, "auto", ("auto", "bw", unknown))
    device.send(SetPicture(modes=("auto", "bw", unknown)))
    device.send(SetPicture(modes=("color", "", "")))
    written = [target.partition("&")[2] for target in web.asked if "setConfig" in target]
    first = f"{name}{lines[0].partition('=')[0]}={colour}"
    assert written == ["&".join(f"{name}{line}" for line in lines), first], "nothing where no mode is told"


def test_the_digest_is_the_one_computed_by_hand() -> None:
    challenge = Challenge(
        "digest", "Login to AMC0000000000001", "1083253606", "720000000000000000000007a9", "auth", count=1
    )
    uri = "/cgi-bin/magicBox.cgi?action=getDeviceType"
    header = authorization(challenge, "admin", "secret123", "GET", uri, "0a4f113b")
    assert 'response="d0800548eff4f05c60eec55986965032"' in header
    assert "qop=auth, nc=00000001" in header


@pytest.mark.parametrize(
    ("header", "nonce", "opaque", "qop"),
    [
        ('Digest realm="Login to A",qop="auth",nonce="1",opaque="7"', "1", "7", "auth"),
        ('Digest realm="DH_0, x", nonce="2", stale=FALSE, qop="auth,auth-int"', "2", None, "auth"),
        ('Digest realm="Login to B", nonce="3"', "3", None, None),
    ],
)
def test_challenges_of_every_firmware_are_read(header: str, nonce: str, opaque: str | None, qop: str | None) -> None:
    challenge = read_challenge([header])
    assert challenge is not None
    assert (challenge.nonce, challenge.opaque, challenge.qop) == (nonce, opaque, qop)


class Guarded(Web):
    """A camera that checks Digest; each nonce may be used `uses` times."""

    def __init__(self, password: str = "secret123", uses: int = 1000) -> None:
        super().__init__()
        self.password, self.uses, self.nonce, self.used = password, uses, 0, 0
        self.refused = 0
        self.down = False

    def __call__(self, request: httpx.Request) -> httpx.Response:
        self.used += 1
        if self.down:
            raise httpx.ConnectError("[Errno 111] Connection refused", request=request)
        response = super().__call__(request)
        given = request.headers.get("authorization", "")
        uri = request.url.raw_path.decode()
        good = f'response="{self._expected(uri)}"' in given and self.used <= self.uses
        if good and f"nc={self.used:08x}" in given:
            return response
        self.refused += 1
        self.nonce, self.used = self.nonce + 1, 0
        challenge = f'Digest realm="Login to A",qop="auth",nonce="{self.nonce}",opaque=""'
        return httpx.Response(401, headers={"WWW-Authenticate": challenge})

    def _expected(self, uri: str) -> str:
        def digest(text: str) -> str:
            return hashlib.md5(text.encode()).hexdigest()

        first, second = digest(f"admin:Login to A:{self.password}"), digest(f"GET:{uri}")
        return digest(f"{first}:{self.nonce}:{self.used:08x}:c:auth:{second}")


def guarded(web: Guarded) -> amcrest.Amcrest:
    device = camera(web)
    device.login.cnonce = lambda: "c"
    return device


def test_a_nonce_is_used_again_with_the_next_count() -> None:
    web = Guarded()
    device = guarded(web)
    for _ in range(20):
        device.send(Reboot())
    assert (len(web.asked), web.refused) == (21, 1)


@pytest.mark.parametrize(
    ("before", "uses", "another_nonce", "remembers"),
    [(20, 1000, True, False), (20, 1000, False, True), (5, 1000, True, None), (20, 1, True, None)],
)
def test_who_it_is_says_whether_it_knew_the_login_after_it_was_away(
    before: int, uses: int, another_nonce: bool, remembers: bool | None
) -> None:
    web = Guarded(uses=uses)
    device = guarded(web)
    for _ in range(before):
        device.send(Reboot())
    assert identity(device).remembers is None
    web.down = True
    for _ in range(3):
        with pytest.raises(Away) as caught:
            device.send(Reboot())
        assert caught.value.turned_away
    web.down = False
    web.nonce += another_nonce
    device.send(Reboot())
    assert identity(device).remembers is remembers
    assert identity(device).remembers is None


def identity(device: amcrest.Amcrest) -> Identity:
    told = device.send(Identify())
    assert isinstance(told, Identity)
    return told


@pytest.mark.parametrize(
    ("error", "turned_away"),
    [
        (httpx.ConnectError("[Errno 111] Connection refused"), True),
        (httpx.ReadError("[Errno 104] Connection reset by peer"), True),
        (httpx.RemoteProtocolError("Server disconnected without sending a response."), True),
        (httpx.ConnectError("[Errno 113] No route to host"), False),
        (httpx.ConnectTimeout("timed out"), False),
        (httpx.ReadTimeout("timed out"), False),
    ],
)
def test_a_camera_that_turns_connections_away_is_told_from_one_that_is_not_reached(
    error: httpx.HTTPError, turned_away: bool
) -> None:
    assert lost(error).turned_away is turned_away


def test_a_camera_that_takes_each_nonce_once_is_answered_with_one_repeat_and_soon_without_a_vain_login() -> None:
    web = Guarded(uses=1)
    device = guarded(web)
    for _ in range(20):
        device.send(Reboot())
    assert len(web.asked) == 40
    vain = sum("authorization" in headers for headers in web.headers) - 20
    assert 0 < vain < 5


def test_a_wrong_password_is_tried_again_once_and_told_without_the_password() -> None:
    web = Guarded(password="another")
    with pytest.raises(BadLogin) as caught:
        guarded(web).send(Reboot())
    assert ["authorization" in headers for headers in web.headers] == [False, True, True]
    assert "secret123" not in str(caught.value)
    assert "secret123" not in repr(Address("http://192.0.2.10", "admin", SecretStr("secret123")))


def test_a_camera_that_only_takes_basic_gets_basic() -> None:
    web = Web()
    plain = httpx.Response(401, headers={"WWW-Authenticate": 'Basic realm="camera"'})
    web.answer = lambda target: httpx.Response(200, text="OK") if "authorization" in web.headers[-1] else plain
    camera(web).send(Reboot())
    assert web.headers[-1]["authorization"].startswith("Basic ")
