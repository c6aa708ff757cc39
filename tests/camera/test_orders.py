"""Every order that a camera takes, given with the public clients of both worlds; its effect is seen in the camera."""

from __future__ import annotations

import json
import os
import subprocess
import wave
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import yaml
from jinja2 import Environment

from services import peers
from services.camera import orders
from services.client import Client
from services.payloads import OrderResult
from tests.camera.trials import apart
from tests.small_flat import Door, SmallFlat, small_flat

pytestmark = [pytest.mark.mosquitto, pytest.mark.ros]
SIMULATOR = {"latency_s": 0.05, "switches": {"boot_s": 3.0, "lens_mask": True}}
CAMERA = {"frames": 1, "discovery": True, "motion": {"hold_s": 2.0}}
HOWS = ("mosquitto_pub", "rostopic pub")


@dataclass
class Here:
    """The apartment, a client that hears everything of the camera, and how orders are given."""

    flat: SmallFlat
    bus: Client
    how: str
    processes: list[subprocess.Popen[bytes]]

    @property
    def door(self) -> Door:
        """What is true of the camera."""
        return self.flat.doors["ip1"]

    def give(self, key: str, value: str) -> None:
        """Gives an order as a person would."""
        if self.how == "mosquitto_pub":
            self.publish("camera/ip1/position/set" if key == "Position" else f"camera/ip1/order/{key}", value)
        elif key == "Position":
            axes = json.loads(value)
            point = {"x": axes["pan"], "y": axes["tilt"], "z": axes["zoom"]}
            self._run("rostopic", "pub", "-1", "/ip_camera_position", "geometry_msgs/Point", json.dumps(point))
        else:
            pair = json.dumps({"key": key, "value": value})
            self._run("rostopic", "pub", "-1", "/ip_camera_order", "diagnostic_msgs/KeyValue", pair)

    def publish(self, topic: str, payload: str) -> None:
        """With mosquitto_pub."""
        self._run("mosquitto_pub", "-p", str(self.flat.broker.port), "-t", topic, "-m", payload)

    def order(self, key: str, value: str, limit_s: float = 40.0) -> list[OrderResult]:
        """Gives it, and returns its answers once there is one that ends it."""
        self.bus.forget()
        self.give(key, value)
        wanted = json.loads(value) if value.startswith("{") else value
        return self.answers(lambda result: (result.key, result.value) == (key, wanted), limit_s)

    def answers(self, ours: Callable[[OrderResult], bool], limit_s: float = 40.0) -> list[OrderResult]:
        """The answers to an order, those that have come already too, once there is one that ends it."""
        found: list[OrderResult] = []

        def ended(result: OrderResult) -> bool:
            found.extend([result] if ours(result) else [])
            return bool(found) and found[-1].final

        self.bus.payload("camera/ip1/order_result", ended, limit_s)
        return found

    def at(self, **axes: float) -> None:
        """Puts the camera there, and waits until the service has seen it."""
        self.door.tell("pose", **axes)

        def seen() -> bool:
            told, true = self.said("position"), self.door.state()["reading"]
            near = all(apart(told[axis], true[axis]) < 0.5 for axis in true)
            return near and not told["moving"]

        self.until(seen, "the position")

    def said(self, topic: str) -> Any:
        """The newest payload there; it waits for the first."""
        self.bus.pump()
        return json.loads(self.bytes(topic))

    def retained(self, topic: str) -> Any:
        """What someone who comes now is told."""
        with self.flat.client(f"camera/ip1/{topic}") as newcomer:
            return json.loads(newcomer.until(lambda message: message.retain, 10.0, topic).payload)

    def bytes(self, topic: str) -> bytes:
        """The same as bytes."""
        name = f"camera/ip1/{topic}"
        self.bus.until(lambda message: message.topic == name, 20.0, name)
        return [message.payload for message in self.bus.seen if message.topic == name][-1]

    def until(self, happened: Callable[[], bool], what: str) -> None:
        """Waits for it."""
        peers.wait_until(happened, what, 15.0)

    def _run(self, program: str, *words: str) -> None:
        """Starts it; `rostopic pub -1` says its word at once and stays for 3 s more."""
        environment = {**os.environ, **(self.flat.ros.env if self.flat.ros else {})}
        command = [peers.program(program, program), *words]
        with (self.flat.folder / "clients.log").open("ab") as log:
            self.processes.append(subprocess.Popen(command, env=environment, stdout=log, stderr=log))


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SmallFlat]:
    try:
        with small_flat(tmp_path_factory.mktemp("flat"), simulator=SIMULATOR, camera=CAMERA, with_ros=True) as running:
            yield running
    except peers.Missing as missing:
        pytest.skip(str(missing))


@pytest.fixture(scope="module")
def clients(flat: SmallFlat) -> Iterator[list[subprocess.Popen[bytes]]]:
    """The public clients that were started; all of them end well by themselves."""
    started: list[subprocess.Popen[bytes]] = []
    yield started
    assert [process.wait(20) for process in started] == [0] * len(started), (flat.folder / "clients.log").read_text()


@pytest.fixture(params=HOWS)
def here(request: pytest.FixtureRequest, flat: SmallFlat, clients: list[subprocess.Popen[bytes]]) -> Iterator[Here]:
    with flat.client("camera/ip1/#") as bus:
        yield Here(flat, bus, request.param, clients)


Step = Callable[[Here], None]


@dataclass(frozen=True)
class Case:
    """One order: what it is given with, what was before, and what must be true of the camera afterwards."""

    key: str
    value: str
    effect: Step
    before: Step = lambda here: None
    after: Step = lambda here: None

    def __str__(self) -> str:
        return f"{self.key} {self.value}"[:40]


def looks_at(place: str) -> Step:
    def check(here: Here) -> None:
        pose, wanted = here.door.state()["pose"], positions(here)[place]
        assert apart(pose["pan"], wanted[0]) <= 0.5
        assert abs(pose["tilt"] - wanted[1]) <= 0.5
        assert not here.door.moving

    return check


def positions(here: Here) -> dict[str, list[float]]:
    file: Path = here.flat.folder / "config" / "ip1" / "preset_position.yaml"
    found: dict[str, list[float]] = yaml.safe_load(file.read_text())
    return found


def presets(here: Here) -> set[str]:
    return set(here.door.state()["presets"])


def stands_at(pan: float, tilt: float) -> Step:
    return lambda here: here.at(pan=pan, tilt=tilt, zoom=0.0)


def turned(here: Here) -> None:
    pose = here.door.state()["pose"]
    assert apart(pose["pan"], 60.0) > 1.0
    assert abs(pose["tilt"] - 20.0) < 0.2
    assert not here.door.moving


def turning(here: Here) -> None:
    stands_at(60.0, 20.0)(here)
    here.give("Move", "Right 2 20")
    here.until(lambda: here.door.moving, "the camera to turn")


def still(here: Here) -> None:
    assert not here.door.moving


def zoomed(level: float | None) -> Step:
    def check(here: Here) -> None:
        zoom = here.door.state()["reading"]["zoom"]  # of the true one it tells five levels
        assert zoom > 0 if level is None else zoom == level
        assert not here.door.moving

    return check


def zoomed_in(here: Here) -> None:
    here.at(pan=60.0, tilt=20.0, zoom=8.0)


def wider(here: Here) -> None:
    assert here.door.state()["reading"]["zoom"] < 8
    assert not here.door.moving


def is_saved(here: Here) -> None:
    assert positions(here)["Näher: 1"][0] == pytest.approx(60.0, abs=0.2)
    assert len(presets(here)) == 10
    here.until(lambda: "Näher: 1" in here.retained("places"), "the place")


def is_removed(here: Here) -> None:
    assert "Näher: 1" not in positions(here)
    assert len(presets(here)) == 9
    here.until(lambda: "Näher: 1" not in here.retained("places"), "the place to be gone")


def save(here: Here) -> None:
    stands_at(60.0, 20.0)(here)
    here.order("SaveAs", "Näher: 1")


def remove(here: Here) -> None:
    here.order("Remove", "Näher: 1")


def option(key: str, value: str, table: str = "VideoInOptions") -> Step:
    def check(here: Here) -> None:
        assert here.flat.table("ip1", table)[key] == value

    return check


def ordered(key: str, value: str) -> Step:
    def give(here: Here) -> None:
        assert here.order(key, value)[-1].state == "done"

    return give


ONE_PLACE = '{"targets": [582], "places": ["Living room"]}'


def found(here: Here) -> None:
    result = here.said("scan/result")
    assert (result["marker"], result["place"]) == (582, "Living room")
    assert here.said("scan/state")["state"] == "done"
    assert apart(here.door.state()["pose"]["pan"], positions(here)["Living room"][0]) <= 0.5


def scanning(here: Here) -> None:
    here.give("Scan", "True")
    here.until(lambda: here.said("scan/state")["state"] == "running", "the scan")


def cancelled(here: Here) -> None:
    assert here.said("scan/state")["state"] == "cancelled"
    assert not here.door.moving


def shown(here: Here) -> None:
    assert here.order("Scan", ONE_PLACE)[-1].state == "done"
    assert here.bytes("scan/image").startswith(b"\xff\xd8")


def looks_for(*targets: int) -> Step:
    def check(here: Here) -> None:
        scanning(here)
        assert here.said("scan/state")["targets"] == list(targets)
        ordered("Scan", "False")(here)

    return check


def visits(place: str) -> Step:
    def check(here: Here) -> None:
        here.bus.forget()
        here.give("Scan", "True")
        here.until(lambda: here.said("scan/state")["place"] == place, place)
        ordered("Scan", "False")(here)

    return check


def streams(here: Here) -> None:
    here.until(lambda: here.said("stream")["mjpeg"], "the stream to be on")
    with httpx.stream("GET", here.said("stream")["url"], timeout=20.0) as answer:
        assert answer.headers["content-type"].startswith("multipart/x-mixed-replace")
        piece = next(piece for piece in answer.iter_bytes(4096) if b"\xff\xd8" in piece)
    assert b"image/jpeg" in piece


def is_watched(here: Here) -> None:
    frames = here.door.state()["frames_rendered"]
    here.until(lambda: here.door.state()["frames_rendered"] != frames, "a frame that somebody watches")
    assert here.said("stream")["rtsp"]


def stops_watching(here: Here) -> None:
    ordered("RTSP", "False")(here)
    here.until(lambda: not here.retained("stream")["rtsp"], "the stream to be off")


def high_contrast(here: Here) -> None:
    option("VideoInOptions[0].DayNightColor", "2")(here)
    contrast = {key: value for key, value in here.flat.table("ip1", "VideoColor").items() if key.endswith("Contrast")}
    assert contrast
    assert all(int(value) > 50 for value in contrast.values())


def usual_contrast(here: Here) -> None:
    ordered("VideoMode", "color")(here)
    option("VideoColor[0][0].Contrast", "50", "VideoColor")(here)


def hears_the_tone(here: Here) -> None:
    told = here.said("audio")
    with wave.open(str(sounds(here) / told["file"])) as file:
        seconds, samples = file.getnframes() / file.getframerate(), file.readframes(file.getnframes())
    assert seconds == pytest.approx(1.0, abs=0.1)
    heard = np.abs(np.fft.rfft(np.frombuffer(samples, np.int16)))
    assert float(np.argmax(heard)) / seconds == pytest.approx(700.0, abs=5.0)


def a_tone(here: Here) -> None:
    here.door.tell("tone", hertz=700.0)


def a_file(here: Here) -> None:
    """Half a second of sound in the folder of sounds."""
    sounds(here).mkdir(exist_ok=True)
    with wave.open(str(sounds(here) / "ding.wav"), "wb") as file:
        file.setparams((1, 2, 8000, 0, "NONE", ""))
        file.writeframes((8000 * np.sin(np.arange(4000) * 0.5)).astype("<i2").tobytes())


def is_played(here: Here) -> None:
    played = httpx.get(f"{here.door.url}/played", timeout=30).json()
    assert played[-1]["seconds"] == pytest.approx(0.5, abs=0.05)


def sounds(here: Here) -> Path:
    """The audio folder."""
    return here.flat.folder / "config" / "audio"


def rebooted(here: Here) -> None:
    assert any("action=reboot" in entry["target"] for entry in here.door.log())
    assert not here.door.state()["booting"]
    here.until(lambda: here.said("status")["state"] == "online", "the camera to be back")


CASES = (
    Case("Goto", "Kitchen", looks_at("Kitchen"), stands_at(262.0, 22.0)),
    Case(
        "Position", '{"pan": 70.0, "tilt": 25.0, "zoom": 0.0}', lambda here: near(here, 70.0, 25.0), stands_at(60, 20)
    ),
    Case("SaveAs", "Näher: 1", is_saved, stands_at(60.0, 20.0), remove),
    Case("Remove", "Näher: 1", is_removed, save),
    Case("Move", "Left 3 0.5", turned, stands_at(60.0, 20.0)),
    Case("Move", "Stop", still, turning),
    Case("Zoom", "In", zoomed(None), stands_at(60.0, 20.0)),
    Case("Zoom", "Out", wider, zoomed_in),
    Case("Zoom", "4", zoomed(4.0), stands_at(60.0, 20.0)),
    Case("RTSP", "1", is_watched, after=stops_watching),
    Case("MJPEG", "ON", streams, after=ordered("MJPEG", "OFF")),
    Case("Mirror", "False", option("VideoInOptions[0].Mirror", "false"), after=ordered("Mirror", "True")),
    Case("Flip", "0", option("VideoInOptions[0].Flip", "false"), after=ordered("Flip", "1")),
    Case("Privacy", "ON", option("LeLensMask[0].Enable", "true", "LeLensMask"), after=ordered("Privacy", "OFF")),
    Case("AudioRec", "1", hears_the_tone, a_tone),
    Case("AudioPlay", "ding.wav", is_played, a_file),
    Case("VideoMode", "bw", option("VideoInOptions[0].DayNightColor", "2")),
    Case("VideoMode", "auto", option("VideoInOptions[0].DayNightColor", "1")),
    Case("VideoMode", "color", option("VideoInOptions[0].DayNightColor", "0"), ordered("VideoMode", "bw")),
    Case("VideoMode", "scan", high_contrast, after=usual_contrast),
    Case("Scan", ONE_PLACE, found, stands_at(320.0, 36.0)),
    Case("Scan", "False", cancelled, scanning),
    Case("ScanImgPub", "ON", shown, stands_at(320.0, 36.0), ordered("ScanImgPub", "OFF")),
    Case("SetTarget", "582,17", looks_for(582, 17), after=ordered("SetTarget", "582")),
    Case("AddTarget", "100", looks_for(582, 100), after=ordered("SetTarget", "582")),
    Case("RemoveTarget", "582", looks_for(17), ordered("SetTarget", "582,17"), ordered("SetTarget", "582")),
    Case("SetRoutine", "Desk,Hall", visits("Desk"), after=ordered("SetRoutine", "auto")),
    Case("Reboot", "True", rebooted),
)


def near(here: Here, pan: float, tilt: float) -> None:
    pose = here.door.state()["pose"]
    assert apart(pose["pan"], pan) <= 0.5
    assert abs(pose["tilt"] - tilt) <= 0.5


@pytest.mark.parametrize("case", CASES, ids=str)
def test_an_order_does_what_it_says_and_is_answered_step_by_step(case: Case, here: Here) -> None:
    case.before(here)
    answers = here.order(case.key, case.value)
    assert [answer.state for answer in answers] == ["accepted", "running", "done"], answers[-1].error
    assert len({answer.id for answer in answers}) == 1
    case.effect(here)
    case.after(here)


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("Position", '{"pan": 400.0, "tilt": 20.0, "zoom": 0.0}', "0 to 360"),
        ("Position", '{"pan": 60.0, "tilt": -90.5, "zoom": 0.0}', "-10 to 108"),
        ("Zoom", "9", "0 to 8"),
        ("AudioRec", "601", "0 to 600"),
    ],
)
def test_what_is_out_of_range_is_refused_naming_it(here: Here, key: str, value: str, allowed: str) -> None:
    answers = here.order(key, value)
    assert [answer.state for answer in answers] == ["refused"]
    assert allowed in str(answers[0].error)


def test_each_diagonal_turns_both_ways_at_once(here: Here) -> None:
    """To the right of the picture the pan grows, downwards the tilt."""
    stands_at(60.0, 20.0)(here)
    for way, right, down in (("LeftUp", -1, -1), ("RightDown", 1, 1), ("RightUp", 1, -1), ("LeftDown", -1, 1)):
        before = here.door.state()["pose"]
        assert here.order("Move", f"{way} 3 0.5")[-1].state == "done"
        pose = here.door.state()["pose"]
        assert right * (pose["pan"] - before["pan"]) > 1.0, way
        assert down * (pose["tilt"] - before["tilt"]) > 0.5, way
        assert not here.door.moving


def ours(order_id: str) -> Callable[[OrderResult], bool]:
    return lambda result: result.id == order_id


def test_every_answer_to_an_order_in_json_carries_its_id(here: Here) -> None:
    stands_at(60.0, 20.0)(here)
    here.bus.forget()
    name = f"mine, by {here.how}"
    here.give("Move", json.dumps({"value": "Left 3 0.5", "id": name, "by": "human"}))
    answers = here.answers(lambda result: result.key == "Move")
    assert [(one.id, one.value, one.state) for one in answers] == [
        (name, "Left 3 0.5", state) for state in ("accepted", "running", "done")
    ]
    turned(here)


@pytest.fixture
def both(flat: SmallFlat, clients: list[subprocess.Popen[bytes]]) -> Iterator[tuple[Here, Here]]:
    """Two people who hear the same: one gives orders with mosquitto_pub, one with rostopic pub."""
    with flat.client("camera/ip1/#") as bus:
        yield Here(flat, bus, HOWS[0], clients), Here(flat, bus, HOWS[1], clients)


def test_the_same_move_again_prolongs_it_whoever_gives_it(both: tuple[Here, Here]) -> None:
    one, other = both
    stands_at(60.0, 20.0)(one)
    one.bus.forget()
    met = len(one.door.log())
    other.give("Move", "Left 2 2")
    one.until(lambda: apart(one.door.state()["pose"]["pan"], 60.0) > 2, "the camera to turn")
    one.give("Move", "Left 2 2")
    answers: list[OrderResult] = []
    one.answers(lambda result: answers.append(result) or len([each for each in answers if each.final]) == 2)
    by_id = [[each.state for each in answers if each.id == name] for name in {each.id for each in answers}]
    assert by_id == [["accepted", "running", "done"]] * 2
    sent = [entry for entry in one.door.log()[met:] if "code=Left&" in entry["target"] and entry["status"] == 200]
    starts, stops = ([e["time"] for e in sent if f"action={how}" in e["target"]] for how in ("start", "stop"))
    assert len(starts) == 1
    assert stops[0] - starts[0] > 2.5  # 2 s of the first, and that again after 2 of its 6 degrees
    assert not one.door.moving


def test_a_person_s_goto_ends_a_scan(both: tuple[Here, Here]) -> None:
    one, other = both
    one.bus.forget()
    other.give("Scan", json.dumps({"value": True, "id": "scan", "by": "human"}))
    one.until(lambda: one.said("scan/state")["state"] == "running" and one.door.moving, "the scan")
    one.give("Goto", json.dumps({"value": "Desk", "id": "goto", "by": "human"}))
    assert one.answers(ours("goto"))[-1].state == "done"
    lost = one.answers(ours("scan"))[-1]
    assert (lost.state, lost.error) == ("cancelled", "the human's order Goto goes first")
    looks_at("Desk")(one)
    cancelled(one)


def test_a_mission_s_order_loses_against_a_person_s_that_runs_and_gives_way_to_one(both: tuple[Here, Here]) -> None:
    mission, person = both
    stands_at(60.0, 20.0)(mission)
    mission.bus.forget()
    person.give("Move", json.dumps({"value": "Right 1 20", "id": "first", "by": "human"}))
    mission.until(lambda: mission.door.moving, "the camera to turn")
    mission.give("Goto", json.dumps({"value": "Desk", "id": "loses", "by": "mission"}))
    lost = mission.answers(ours("loses"))
    assert [one.state for one in lost] == ["accepted", "cancelled"]
    assert lost[-1].error == "the human's order Move goes first"
    assert mission.door.moving
    mission.give("Move", json.dumps({"value": "Stop", "id": "stop", "by": "human"}))
    mission.answers(ours("stop"))
    mission.give("Goto", json.dumps({"value": "Desk", "id": "way", "by": "mission"}))
    mission.bus.payload("camera/ip1/order_result", lambda one: (one.id, one.state) == ("way", "running"), 20.0)
    mission.give("Position", '{"pan": 70.0, "tilt": 25.0, "zoom": 0.0, "id": "last"}')
    assert mission.answers(ours("last"))[-1].state == "done"
    assert mission.answers(ours("way"))[-1].error == "the human's order Position goes first"
    near(mission, 70.0, 25.0)


def test_a_place_that_is_written_by_hand_can_be_gone_to_and_a_broken_file_changes_nothing(
    both: tuple[Here, Here],
) -> None:
    here, _ = both
    file, log = here.flat.folder / "config" / "ip1" / "preset_position.yaml", here.flat.folder / "run.log"
    before, line = file.read_text(), "the places stay as they were"
    told = log.read_text().count(line)
    try:
        file.write_text(f"{before}Nook: [70.0, 25.0, 0]\n")
        here.until(lambda: "Nook" in here.retained("places"), "the new place")
        assert here.order("Goto", "Nook")[-1].state == "done"
        near(here, 70.0, 25.0)
        places = here.retained("places")
        file.write_text(f"{before}Nook: [10.0, 25.0, 0]\nHole: [1, 2\n")
        here.until(lambda: log.read_text().count(line) > told, "a line in the log")
        faulty = f"{file.name}:{len(before.splitlines()) + 3}:"
        assert [line in one and faulty in one for one in log.read_text().splitlines() if line in one][told:] == [True]
        stands_at(60.0, 20.0)(here)
        assert here.order("Goto", "Nook")[-1].state == "done"
        near(here, 70.0, 25.0)
        assert here.retained("places") == places
        assert log.read_text().count(line) == told + 1
    finally:
        file.write_text(before)
    here.until(lambda: "Nook" not in here.retained("places"), "the place to be gone")


def test_calibrating_turns_the_camera_and_a_stop_ends_it(here: Here) -> None:
    """The whole of it takes most of a minute; it is tried in virtual time."""
    stands_at(60.0, 20.0)(here)
    here.give("CalibratePtz", "True")
    here.until(lambda: here.door.moving, "the camera to turn")
    here.give("Move", "Stop")
    here.bus.payload("camera/ip1/order_result", lambda result: (result.key, result.state) == ("Move", "done"), 20.0)
    said = [OrderResult.model_validate_json(one.payload) for one in here.bus.seen if one.topic.endswith("order_result")]
    assert [one.state for one in said if one.key == "CalibratePtz"] == ["accepted", "running", "cancelled"]
    assert not here.door.moving


def test_a_lens_calibration_looks_at_pictures_meanwhile_and_a_stop_ends_it(here: Here) -> None:
    """What a person and a board, or markers, make of it is tried in virtual time."""
    here.give("CalibrateLens", "True")
    here.bus.payload("camera/ip1/calibration", lambda told: told.said == "no board is seen yet", 30.0)
    here.give("Move", "Stop")
    here.bus.payload("camera/ip1/calibration", lambda told: told.state == "cancelled", 20.0)


def test_every_order_is_tried() -> None:
    in_virtual_time = {"CalibratePtz", "CalibrateLens", "CalibrateMount", "CalibrateZoom", "SetCameraInfo"}
    tried = {case.key for case in CASES} | in_virtual_time
    assert tried == {name for name, _ in orders.KEYS.values()} | {"Position"}


@pytest.fixture
def panel(flat: SmallFlat, clients: list[subprocess.Popen[bytes]]) -> Iterator[Panel]:
    with flat.client("camera/ip1/#", "homeassistant/#") as bus:
        yield Panel(Here(flat, bus, "mosquitto_pub", clients))


class Panel:
    """Home Assistant, as far as it publishes: what it was told of an entity decides topic and payload."""

    def __init__(self, here: Here) -> None:
        self.here = here

    def entity(self, kind: str) -> dict[str, Any]:
        topic = f"homeassistant/{kind.replace('.', '/ip1/')}/config"
        found: dict[str, Any] = json.loads(self.here.bus.until(lambda one: one.topic == topic, 10.0, topic).payload)
        return found

    def press(self, kind: str, value: str) -> None:
        """Publishes what Home Assistant would for this value (an option, or the entity's own word for it)."""
        entity = self.entity(kind)
        word = entity.get(value, value)
        payload = Environment().from_string(entity.get("command_template", "{{ value }}")).render(value=word)
        self.here.publish(entity["command_topic"], payload)

    def ends(self, key: str, state: str) -> None:
        """Waits for the end of an order that is not older than the last `forget`."""
        self.here.bus.payload(
            "camera/ip1/order_result", lambda result: (result.key, result.state) == (key, state), 40.0
        )


def test_what_home_assistant_sends_is_carried_out(panel: Panel) -> None:
    here = panel.here
    assert set(panel.entity("select.place")["options"]) == set(positions(here))
    panel.press("select.place", "Desk")
    panel.ends("Goto", "done")
    looks_at("Desk")(here)
    panel.press("switch.privacy", "payload_on")
    panel.ends("Privacy", "done")
    assert here.flat.table("ip1", "LeLensMask")["LeLensMask[0].Enable"] == "true"
    here.bus.seen[:] = [one for one in here.bus.seen if one.topic.startswith("homeassistant/")]
    panel.press("switch.privacy", "payload_off")
    panel.ends("Privacy", "done")
    panel.press("switch.mjpeg", "payload_on")
    panel.ends("MJPEG", "done")
    here.until(lambda: here.retained("stream")["mjpeg"], "the stream")
    panel.press("switch.mjpeg", "payload_off")
    panel.press("button.take_snapshot", "payload_press")
    topic = panel.entity("camera.snapshot")["topic"]
    assert here.bus.until(lambda one: one.topic == topic, 20.0, topic).payload.startswith(b"\xff\xd8")
    panel.press("button.scan", "payload_press")
    here.until(lambda: here.said("scan/state")["state"] == "running", "the scan")
    panel.press("button.stop", "payload_press")
    panel.ends("Scan", "cancelled")
    panel.ends("Move", "done")
    assert not here.door.moving


def test_home_assistant_sees_motion_and_its_reboot_button_reboots(panel: Panel) -> None:
    here = panel.here
    sensor = panel.entity("binary_sensor.motion")

    def shows(word: str) -> Callable[[], bool]:
        def seen() -> bool:
            value = here.said(sensor["state_topic"].removeprefix("camera/ip1/"))
            return Environment().from_string(sensor["value_template"]).render(value_json=value) == word

        return seen

    def somebody_walks() -> bool:
        here.door.tell("event", code="VideoMotion", action="Start")  # soon after its own motion that counts for nothing
        return shows("ON")()

    here.until(shows("OFF"), "no motion")
    here.until(somebody_walks, "motion")
    here.door.tell("event", code="VideoMotion", action="Stop")
    here.until(shows("OFF"), "the end of it")
    here.bus.seen[:] = [one for one in here.bus.seen if one.topic.startswith("homeassistant/")]
    panel.press("button.reboot", "payload_press")
    here.until(lambda: here.door.state()["booting"], "the camera to be down")
    panel.ends("Reboot", "done")
    rebooted(here)
