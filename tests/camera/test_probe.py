"""`apartment probe` against the simulated camera in every firmware: it finds what the profile says, without harm."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from datetime import datetime
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml
from pydantic import SecretStr

from services.camera.address import Address
from services.camera.brands import amcrest
from services.camera.brands.dahua import ptz
from services.camera.brands.dahua.events import Parser
from services.camera.capabilities import PARTS, Capabilities, GetCapabilities
from services.camera.device import (
    Away,
    BadLogin,
    Direction,
    Event,
    GetPicture,
    Identify,
    Identity,
    Picture,
    Reading,
    Refused,
    Snapshot,
    Start,
    Status,
    Stop,
)
from services.camera.errands import GetClock, GetContrast, GetMotion, GetPrivacy, GetStorage, Storage
from services.camera.probe import anonymous, likeness, paper, show
from services.camera.probe.contact import MOVES, READS, contact
from services.camera.probe.findings import Findings
from services.camera.probe.stream import read_events
from services.camera.probe.wire import Wire
from services.camera.web.gate import Gate
from services.config import load
from services.peers import free_port, wait_until
from services.simulators import camera as simulated
from services.simulators.camera import aims
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.profiles import Profile
from tests.camera.bench import PASSWORD, SHIPPED, simulator
from tests.camera.recorded import Recorded

LATENCY_S = 0.03
AT_ONCE = 4
UNSEEN = {  # switches that cannot be seen from outside, or only by doing harm
    "boot_s", "drowsy_s", "event_listeners", "event_writes", "heartbeat_least_s", "latency_tail",
    "lockout_failures", "lockout_of", "lockout_s",
    "max_connections", "over_limit", "pan_acceleration", "snapshot_drop", "spurious_401",
    "stream_slowdown_s", "tilt_acceleration", "zoom_acceleration", "zoom_speed",
}  # fmt: skip
MEASURED = {  # how far off they may be on a busy machine; of speeds and delays more in `test_probe_stand_ins`
    "latency_s": 0.06, "latency_spread_s": 0.06, "status_lag_s": 0.15, "snapshot_s": 2.0, "tilt_share": 0.06,
}  # fmt: skip
KNOWN = {name: asdict(profile) for name, profile in PROFILES.items()}
NO_DIGEST = {"nonce", "challenge_spacing", "digest_algorithms", "qop", "realm"}  # where Basic is all there is


class Quiet:
    """A Teller that says nothing, and lets something move in front of the camera while events are listened to."""

    def __init__(self, camera: simulated.Simulated) -> None:
        self.camera = camera

    def begin(self, step: str) -> None:
        if step == "Events":
            threading.Timer(1.0, self.move).start()

    def move(self) -> None:
        for action in ("Start", "Stop"):
            httpx.post(f"{self.camera.side_door_url}/event", json={"code": "VideoMotion", "action": action}, timeout=30)

    def detail(self, text: str) -> None:
        pass

    def end(self, step: str, found: Findings) -> None:
        pass


@dataclass
class Meeting:
    """What the probe found, and what the camera says of the probe."""

    found: Findings
    wire: Wire
    files: dict[str, str]
    state: dict[str, Any]
    asked: list[str]
    changes: int


def wire_to(camera: simulated.Simulated, password: str = PASSWORD) -> Wire:
    return Wire(camera.url, "ros", SecretStr(password))


def meet(profile: str, may_move: bool) -> Meeting:
    with simulator(profile=profile, latency_s=LATENCY_S, rtsp_port=None) as camera:
        wire = wire_to(camera)
        try:
            found = contact(wire, Quiet(camera), lambda found: may_move)
        finally:
            wire.close()
        state = httpx.get(f"{camera.side_door_url}/state", timeout=30).json()
        asked = [entry["target"] for entry in httpx.get(f"{camera.side_door_url}/log", timeout=30).json()]
        found.like = likeness.nearest(found.switches, KNOWN)
        files = dict(paper.recorded(found, wire))
        return Meeting(found, wire, files, state, asked, camera.server.device.tables.changes)


@pytest.fixture(scope="module")
def meetings() -> Iterator[dict[str, Future[Meeting]]]:
    """All firmwares, some at once: the probe mostly waits."""
    with ThreadPoolExecutor(AT_ONCE) as pool:
        yield {name: pool.submit(meet, name, True) for name in PROFILES}


@pytest.fixture(params=PROFILES)
def profile(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def meeting(profile: str, meetings: dict[str, Future[Meeting]]) -> Meeting:
    return meetings[profile].result()


def test_every_switch_that_can_be_seen_is_seen_right(profile: str, meeting: Meeting) -> None:
    true, seen = asdict(PROFILES[profile]), paper.switches(meeting.found)
    true["latency_s"] = true["status_lag_s"] = true["latency_spread_s"] = LATENCY_S
    assert len(seen.pop("pan_speeds")) == len(true["pan_speeds"])  # see the test of speeds
    wrong = {
        key: f"{seen[key]!r} is {true[key]!r}" for key in seen
        if (abs(seen[key] - true[key]) > MEASURED[key] if key in MEASURED else seen[key] != true[key])
    }  # fmt: skip
    assert wrong == {}


def test_what_it_leaves_open_cannot_be_seen(profile: str, meeting: Meeting) -> None:
    true = PROFILES[profile]
    allowed = set(UNSEEN)
    allowed |= NO_DIGEST if true.auth == "basic" else set()
    allowed |= {"stale"} if true.nonce == "reusable" else set()
    allowed |= {"move_status"} if true.status_form == "c" else set()
    allowed |= {"unset_preset"} if true.preset_max <= 9 else set()  # all are stored
    allowed |= set() if true.position_abs == "full" else {"position_abs_tilt_off"}
    assert {one.name for one in fields(Profile)} - set(paper.switches(meeting.found)) <= allowed


def test_it_says_which_firmware_it_is(profile: str, meeting: Meeting) -> None:
    like = meeting.found.like
    assert like is not None
    assert (like.name, like.differs, like.known) == (profile, {}, True)
    assert like.compared >= 25
    assert show.likeness(like) == f"{profile}, in all {like.compared} ways that could be compared"
    assert meeting.found.data()["like"]["name"] == profile


def test_what_is_only_read_tells_which_firmware_it_is(profile: str, meeting: Meeting) -> None:
    read = {key: value for key, value in meeting.found.switches.items() if key not in MOVES}
    like = likeness.nearest(read, KNOWN)
    assert like is not None
    assert (like.name, like.differs) == (profile, {})


def test_a_firmware_that_is_not_known_is_told_by_what_differs(profile: str, meeting: Meeting) -> None:
    others = {name: switches for name, switches in KNOWN.items() if name != profile}
    like = likeness.nearest(meeting.found.switches, others)
    assert like is not None
    true = PROFILES[profile]
    for key, (seen, theirs) in like.differs.items():
        assert seen == getattr(true, key) != theirs == getattr(PROFILES[like.name], key)
    shown = show.likeness(like)
    assert shown.startswith("no firmware that is known") is not like.known
    assert like.name in shown
    assert all(f"{key}: " in shown for key in like.differs)


def test_a_family_of_its_own_is_no_firmware_that_is_known() -> None:
    strange = {**KNOWN["sd2a-2023"], "auth": "basic", "realm": "mac"}
    like = likeness.nearest(strange, {name: switches for name, switches in KNOWN.items() if name != "sd2a-2023"})
    assert like is not None
    assert not like.known
    assert likeness.nearest({}, KNOWN) is None
    assert likeness.nearest({"onvif": True}, {}) is None


def test_speeds_are_those_of_the_motors(profile: str, meeting: Meeting) -> None:
    true = PROFILES[profile]
    for one in meeting.found.speeds:
        rate = true.pan_speeds[one.level - 1] * (1.0 if one.axis == "pan" else true.tilt_share)
        assert one.per_s == pytest.approx(rate, rel=0.12, abs=0.3), one
    assert len(meeting.found.speeds) == 6


def test_it_leaves_the_camera_as_it_was(meeting: Meeting) -> None:
    pose = meeting.state["pose"]
    assert not meeting.state["moving"]
    assert abs((pose["pan"] + 180.0) % 360.0 - 180.0) <= 0.7
    assert abs(pose["tilt"] - 20.0) <= 0.7
    assert pose["zoom"] == 0.0
    assert meeting.changes == 0
    assert [
        target for target in meeting.asked if "setConfig" in target or "Preset&" in target.replace("GotoPreset", "")
    ] == []
    assert meeting.state["door"]["wrong"] == 0


@pytest.mark.parametrize(("position_abs", "command"), [("bad-request", "moveAbsolutely"), ("full", "PositionABS")])
def test_a_position_that_leads_elsewhere_is_ended_and_left_open(
    position_abs: str, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Firmware that takes the numbers for something else would turn right round."""

    def far(request: Any, profile: Profile, stand: aims.Stand) -> aims.Drive:
        return aims.Drive(aims.travel(stand.pose._replace(pan=stand.pose.pan + 150.0)))

    monkeypatch.setitem(aims.COMMANDS, command, (lambda profile: True, far))
    with simulator(latency_s=LATENCY_S, switches={"position_abs": position_abs}) as camera:
        wire = wire_to(camera)
        try:
            found = contact(wire, Quiet(camera), lambda found: True)
        finally:
            wire.close()
        state = httpx.get(f"{camera.side_door_url}/state", timeout=30).json()
        motors = camera.server.device.ptz.motors.worked(camera.server.clock())
    assert ("moves" if command == "moveAbsolutely" else "position_abs") in found.unknown
    assert motors.travelled.pan < 150.0  # all speeds, there and back
    assert abs((state["pose"]["pan"] + 180.0) % 360.0 - 180.0) <= 0.7


def test_what_it_writes_down_tells_nothing_of_whose_camera_it_is(meeting: Meeting) -> None:
    assert len(meeting.files) >= 25
    whole = "\n".join(meeting.files.values())
    for secret in (PASSWORD, '"ros"', "Kitchen", "127.0.0.1"):
        assert secret not in whole


def test_without_leave_it_only_reads() -> None:
    meeting = meet("ip4m-1041b", may_move=False)
    actions = {
        part for target in meeting.asked for part in target.partition("?")[2].split("&") if part.startswith("action=")
    }
    assert {action for action in actions if not action.startswith(("action=get", "action=attach"))} == set()
    assert not meeting.found.moved
    assert meeting.found.unknown["position_abs"] == "only a moving camera shows it"


def test_a_wrong_password_is_tried_once() -> None:
    with simulator(latency_s=0) as camera:
        wire = wire_to(camera, "wrong-horse")
        with pytest.raises(BadLogin, match="no more will be"):
            contact(wire, Quiet(camera), lambda found: True)
        wire.close()
        assert httpx.get(f"{camera.side_door_url}/state", timeout=30).json()["door"]["wrong"] == 1


def test_nobody_there_is_told_at_once() -> None:
    wire = Wire(f"http://127.0.0.1:{free_port()}", "ros", SecretStr(PASSWORD))
    with pytest.raises(Away, match="nobody answers"):
        contact(wire, Quiet.__new__(Quiet), lambda found: True)
    wire.close()


@contextmanager
def without_cgi(camera: simulated.Simulated) -> Iterator[str]:
    """The same camera without its own API, as some newer models are: ONVIF and its picture are all there is."""

    class Visit(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            if "/onvif/" not in self.path and "snapshot" not in self.path:
                return self.answer(httpx.Response(404))
            kept = {
                key: value for key, value in self.headers.items() if key.lower() in ("authorization", "content-type")
            }
            there = camera.url + self.path
            return self.answer(httpx.request(self.command, there, content=body, headers=kept, timeout=30.0))

        do_POST = do_GET  # noqa: N815 (the base class looks for these names)

        def answer(self, answer: httpx.Response) -> None:
            self.send_response(answer.status_code)
            for key in ("www-authenticate", "content-type"):
                for value in answer.headers.get_list(key):
                    self.send_header(key, value)
            self.send_header("Content-Length", str(len(answer.content)))
            self.end_headers()
            self.wfile.write(answer.content)

        def log_message(self, format: str, *args: Any) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Visit) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.05,))
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()
            thread.join()


def test_a_camera_without_dahuas_api_is_met_over_onvif(tmp_path: Path) -> None:
    with simulator(latency_s=0) as camera, without_cgi(camera) as url:
        done = command(tmp_path, "ip9", "--url", url, "--user", "ros", "--yes-move", CAMERA_IP9_PASSWORD=PASSWORD)
        assert done.returncode == 0, done.stderr
        assert not [entry for entry in camera.server.log if "action=start" in entry["target"]]
    assert "IP3M-941W" in done.stdout
    section = yaml.safe_load((tmp_path / "probe-ip9" / "ip9.yaml").read_text())["cameras"]["ip9"]
    assert (section["brand"], section["url"]) == ("onvif", url)


def test_a_wrong_password_is_tried_once_over_onvif_too() -> None:
    with simulator(latency_s=0) as camera, without_cgi(camera) as url:
        wire = Wire(url, "ros", SecretStr("wrong-horse"))
        with pytest.raises(BadLogin, match="no more will be"):
            contact(wire, Quiet(camera), lambda found: True)
        wire.close()
        tried = [entry for entry in camera.server.log if entry["target"] == "/onvif/device_service"]
        assert len(tried) == 4  # is there ONVIF, the time, the login, the time again


class Interrupted(BaseException):
    """Ctrl-C, as far as the probe can tell."""


def test_ctrl_c_in_the_middle_of_a_motion_stops_the_camera() -> None:
    with simulator(latency_s=LATENCY_S) as camera:
        wire = wire_to(camera)

        def pause(seconds: float) -> None:
            if camera.server.device.motion(camera.server.clock())[1].pan:
                raise Interrupted
            threading.Event().wait(seconds)

        wire.pause = pause
        with pytest.raises(Interrupted):
            contact(wire, Quiet(camera), lambda found: True)
        wire.close()
        wait_until(lambda: not any(camera.server.device.motion(camera.server.clock())[1]), "the stop", 2.0)


def test_its_section_is_one_that_the_configuration_takes(tmp_path: Path, meetings: dict[str, Future[Meeting]]) -> None:
    for name, met in meetings.items():
        found = met.result().found
        file = tmp_path / f"{name}.yaml"
        home = f"home: {SHIPPED / 'home.yaml'}\n"
        file.write_text(home + paper.section(found, "ip9", "ros"))
        apartment = load(file, environment={"CAMERA_IP9_PASSWORD": PASSWORD}, deep=True)
        settings: Any = apartment.instances["camera-ip9"].config
        assert settings.url == found.url
        assert settings.channel in PROFILES[name].ptz_channels
        assert settings.picture.flip


def test_its_profile_makes_a_simulated_camera_of_the_same_ways(meetings: dict[str, Future[Meeting]]) -> None:
    for name, met in meetings.items():
        found = met.result().found
        section = yaml.safe_load(paper.profile(found))["simulators"]["camera"]
        again = simulated.Config.model_validate({"folder": SHIPPED, **section}).switches
        same = (
            {one.name for one in fields(Profile)} - UNSEEN - {"pan_speeds", *MEASURED} - set(found.unknown) - NO_DIGEST
        )
        true = PROFILES[name]
        if true.position_abs != "full":
            same.discard("position_abs_tilt_off")
        if true.preset_max <= 9:
            same.discard("unset_preset")
        assert {key: getattr(again, key) for key in same} == {key: getattr(true, key) for key in same}


@pytest.mark.parametrize(("tail", "blank"), [(b"", 0), (b"\r\n", 1), (b"\r\n\r\n", 2)], ids=["none", "one", "two"])
@pytest.mark.parametrize("part", [b"Heartbeat", b"Code=VideoMotion;action=Start;index=0;data={\n}\n"])
def test_blank_lines_between_parts_are_counted(part: bytes, tail: bytes, blank: int) -> None:
    whole = b"--myboundary\r\nContent-Length:9\r\n\r\n" + part + b"\r\n\r\n" + tail
    header = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=myboundary\r\n\r\n"
    assert read_events(whole + whole)["event_blank_lines"] == blank
    assert read_events(header + whole + whole)["event_blank_lines"] == blank


def test_names_and_addresses_are_taken_out() -> None:
    clean = anonymous.cleaner("AMC018NP69LM4VM2VY", "Bedroom", "grandma")
    text = (
        'realm="Login to AMC018NP69LM4VM2VY" grandma 192.168.1.20 version=2.420.0.1.R "9C:8E:CD:01:02:03"\r\n'
        "name=Bedroom\r\npresets[0].Index=4\r\npresets[0].Name=Under the bed\r\n"
    )
    left = clean(text)
    for secret in ("018NP69", "grandma", "192.168", "9C:8E", "Bedroom", "Under"):
        assert secret not in left
    assert "presets[0].Index=4" in left


@pytest.mark.parametrize(
    ("body", "form"),
    [
        (b"--b\r\nContent-Length:37\r\n\r\nCode=VideoMotion;action=Start;index=0\r\n\r\n", "B"),
        (b"--b\r\nContent-Length: 78\r\n\r\nCode=VideoMotion;action=Start;index=0;data={\n}\n", "A"),
    ],
)
def test_the_form_of_an_event_is_read_from_the_stream(body: bytes, form: str) -> None:
    assert read_events(body)["event_form"] == form
    assert read_events(b"HTTP/1.1 200 OK\r\n\r\n" + body)["event_header_twice"]


def command(folder: Path, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "services", "probe", *words], cwd=folder, capture_output=True, text=True, timeout=120,
        stdin=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": str(SHIPPED.parent), **environment},
    )  # fmt: skip


def test_the_command_tells_each_step_and_leaves_its_papers(tmp_path: Path) -> None:
    with simulator(latency_s=0.01) as camera:
        done = command(tmp_path, "ip9", "--url", camera.url, "--user", "ros", CAMERA_IP9_PASSWORD=PASSWORD)
    assert done.returncode == 0, done.stderr
    steps = [line for line in done.stdout.splitlines() if f"/{len(READS) + 1}]" in line]
    assert [line[1:3].strip() for line in steps] == [str(number) for number in range(1, len(READS) + 1)]
    assert "may be used again" in done.stdout
    assert "ip3m-941w-2019" in done.stdout
    assert json.loads((tmp_path / "probe-ip9" / "report.json").read_text())["like"]["name"] == "ip3m-941w-2019"
    files = [file for file in (tmp_path / "probe-ip9").rglob("*") if file.is_file()]
    assert {"ip9.yaml", "profile.yaml", "report.json"} <= {file.name for file in files}
    assert [file for file in files if PASSWORD in file.read_text()] == []
    assert PASSWORD not in done.stdout + done.stderr


def test_on_a_terminal_it_asks_before_anything_moves(tmp_path: Path) -> None:
    with simulator(latency_s=0.01) as camera:
        words = [sys.executable, "-m", "services", "probe", "ip9", "--url", camera.url, "--user", "ros"]
        environment = {
            **os.environ,
            "PYTHONPATH": str(SHIPPED.parent),
            "CAMERA_IP9_PASSWORD": PASSWORD,
            "TERM": "xterm",
        }
        ours, theirs = os.openpty()
        with subprocess.Popen(
            words, cwd=tmp_path, stdin=theirs, stdout=theirs, stderr=theirs, env=environment
        ) as process:
            os.close(theirs)
            shown = ""
            while "May it move now?" not in shown:
                shown += os.read(ours, 65536).decode()
            os.write(ours, b"n\n")
            while process.poll() is None:
                shown += read_all(ours)
        os.close(ours)
        assert process.returncode == 0, shown
        assert not [entry for entry in camera.server.log if "action=start" in entry["target"]]
    assert "only a moving camera shows it" in shown
    assert PASSWORD not in shown


def read_all(terminal: int) -> str:
    """What there is to read of a terminal; nothing when its other side is closed."""
    try:
        return os.read(terminal, 65536).decode(errors="replace")
    except OSError:
        return ""


def test_the_command_gives_data_and_takes_a_configured_camera(tmp_path: Path) -> None:
    with simulator(latency_s=0.01) as camera:
        config = tmp_path / "apartment.yaml"
        section = f"  ip1: {{url: '{camera.url}', user: ros, password: '${{CAMERA_IP1_PASSWORD}}'}}\n"
        config.write_text(f"home: {SHIPPED / 'home.yaml'}\ncameras:\n{section}")
        done = command(tmp_path, "ip1", "--json", "--config", str(config), CAMERA_IP1_PASSWORD=PASSWORD)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["model"] == "IP3M-941W"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("ip9", "--url", "http://ros:secret@192.0.2.9"), "without a password"),
        (("Bad Name", "--url", "http://192.0.2.9"), "expected a name like ip1"),
        (("ip9", "--url", "http://192.0.2.9"), "expected the camera's password in the environment"),
    ],
)
def test_wrong_usage_is_told(tmp_path: Path, words: tuple[str, ...], told: str) -> None:
    done = command(tmp_path, *words)
    assert done.returncode == 2
    assert told in done.stderr


def client_of(replies: Recorded) -> amcrest.Amcrest:
    address = Address("http://camera", "ros", SecretStr(PASSWORD))
    return amcrest.Amcrest(address, replies, Gate(pause=lambda seconds: None))


def test_recorded_answers_are_fixtures_that_the_client_understands(
    profile: str, meeting: Meeting, tmp_path: Path
) -> None:
    paper.write(tmp_path, meeting.found, meeting.wire, "ip9")
    replies, true = Recorded(tmp_path / "replies"), PROFILES[profile]
    client = client_of(replies)
    assert client.send(Identify()) == Identity(true.model, anonymous.SERIAL, f"{true.firmware} {true.built}")
    reading = client.send(Status())
    assert isinstance(reading, Reading)
    assert (reading.pan, reading.tilt, reading.zoom) == pytest.approx(meeting.found.pose, abs=0.2)
    assert client.send(GetPicture()) == Picture(flip=True, mirror=True, mode="auto", modes=("auto", "bw", "auto"))
    assert client.send(Snapshot()) == anonymous.PICTURE
    assert isinstance(client.send(GetClock()), datetime)
    assert client.send(GetContrast()) == (50, 50, 50)
    assert client.send(GetMotion()) in (True, False)
    assert client.send(GetStorage()) == Storage("Success", 31_902_400_512.0, 12_582_912_000.0)
    if true.lens_mask:
        assert client.send(GetPrivacy()) is False
    else:
        with pytest.raises(Refused):
            client.send(GetPrivacy())


def test_recorded_answers_tell_the_client_what_the_camera_can_do(
    profile: str, meeting: Meeting, tmp_path: Path
) -> None:
    paper.write(tmp_path, meeting.found, meeting.wire, "ip9")
    replies, true = Recorded(tmp_path / "replies"), PROFILES[profile]
    told = {part: client_of(replies).send(GetCapabilities(part)) for part in PARTS}
    seen = {part: one for part, one in told.items() if isinstance(one, Capabilities)}
    assert set(seen) == set(PARTS)
    assert (seen["status"].status_form, seen["status"].channel) == (true.status_form, true.ptz_channels[-1])
    assert (seen["motors"].presets, seen["motors"].zoom) == (true.preset_max, True)
    assert (seen["audio_in"].audio_in, seen["audio_out"].audio_out) == (1, 1)
    assert seen["privacy"].privacy is true.lens_mask
    assert true.daynight in (seen["picture"].day_night, seen["day_night"].day_night)
    assert "VideoMotion" in seen["events"].events


def test_recorded_events_and_motions_are_understood(profile: str, meeting: Meeting, tmp_path: Path) -> None:
    paper.write(tmp_path, meeting.found, meeting.wire, "ip9")
    replies, true = Recorded(tmp_path / "replies"), PROFILES[profile]
    heard = Parser().feed(replies.events)
    assert Event("VideoMotion", "Start") in heard
    assert (Event("", "Heartbeat") in heard) is true.heartbeat
    codes = "|".join(ptz.CODES.values())
    started = re.findall(rf"action=start&channel=\d&code=({codes})&arg1=0&arg2=(\d)", " ".join(replies.answers))
    code, speed = started[0]
    client, direction = client_of(replies), next(one for one, theirs in ptz.CODES.items() if theirs == code)
    assert client.send(Start(direction, int(speed))) is None
    assert client.send(Stop(direction)) is None
    with pytest.raises(Refused):
        client.send(Start(Direction.LEFT_UP, 7))  # nobody has asked for that: it is refused in the firmware's own way
