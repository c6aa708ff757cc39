"""What `apartment calibrate map` is given, prints and writes; the estimate itself is tried with the vision's tests."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner, Result

from services.apartment import robot_places
from services.apartment.robot_places import Relation, with_relation
from services.client import Client, connected
from services.command_line import calibrate
from services.config import BusSettings
from services.errors import ConfigError
from services.mission.both import Both
from services.payloads import Point, ScanResult, stamp
from services.payloads.robot import RobotPose, RobotSeen, SeenMarker
from services.peers.mosquitto import Broker
from services.topics import CAMERA_MARKER, ROBOT_POSE, ROBOT_SEEN, read
from services.vision.calibrate_map import Pair, fit
from tests.trials import virtual_flat

CONFIG = Path(__file__).parents[2] / "config"
TRUTH = Relation(x=1.5, y=-0.8, yaw_deg=12.0)
CORNERS = [(0.0, 0.0), (5.6, 0.4), (5.0, 6.0), (0.3, 5.5)]


def words(*points: tuple[float, float], relation: Relation = TRUTH) -> list[str]:
    there = [relation.to_map(*point) for point in points]
    said = [f"{x},{y}={u},{v}" for (x, y), (u, v) in zip(points, there, strict=True)]
    return [word for one in said for word in ("--pair", one)]


@pytest.fixture
def config(tmp_path: Path) -> Path:
    file = Path(shutil.copytree(CONFIG, tmp_path / "config")) / "simulated.yaml"
    places = file.parent / "tiago/robot_places.yaml"
    places.write_text(places.read_text().replace("{x: 1.5, y: -0.8, yaw_deg: 12.0}", "{x: 0.1, y: 0, yaw_deg: 3}  # m"))
    return file


def calibrated(config: Path, *said: str) -> Result:
    return CliRunner().invoke(calibrate.app, ["map", *said, "--config", str(config)])


def relation(config: Path) -> Relation:
    return robot_places.places(config.parent / "tiago/robot_places.yaml").apartment_to_map


def test_it_is_written_where_mission_and_bridge_read_it_and_the_old_file_kept(config: Path) -> None:
    places = config.parent / "tiago/robot_places.yaml"
    old = places.read_text()
    shown = calibrated(config, *words(*CORNERS), "--yes")
    assert shown.exit_code == 0, shown.output
    assert relation(config) == TRUTH
    changed = [(a, b) for a, b in zip(old.splitlines(), places.read_text().splitlines(), strict=True) if a != b]
    assert [b for _, b in changed] == ["apartment_to_map: {x: 1.5, y: -0.8, yaw_deg: 12.0}  # m"]
    (backup,) = places.parent.glob("*.bak")
    assert backup.read_text() == old
    named = yaml.safe_load(config.read_text())
    assert named["bridge"]["places"] == named["mission"]["robots"]["tiago"]["places"] == "tiago/robot_places.yaml"
    assert "there already" in calibrated(config, *words(*CORNERS)).output


def test_a_diff_changes_nothing_and_nobody_to_ask_is_told(config: Path) -> None:
    before = relation(config)
    shown = calibrated(config, *words(*CORNERS), "--diff")
    assert shown.exit_code == 0
    assert "-apartment_to_map: {x: 0.1, y: 0, yaw_deg: 3}" in shown.output
    assert "+apartment_to_map: {x: 1.5, y: -0.8, yaw_deg: 12.0}" in shown.output
    shown = calibrated(config, *words(*CORNERS))
    assert isinstance(shown.exception, ConfigError)
    assert "--yes: expected it where nobody can be asked" in str(shown.exception)
    assert relation(config) == before


def test_a_pair_that_cannot_be_right_is_named_and_may_be_left_out(config: Path) -> None:
    wrong = [*words(*CORNERS), "--pair", "2.0,3.0=9.0,9.0", "--yes"]
    shown = calibrated(config, *wrong)
    assert shown.exit_code == 1
    assert "2.0,3.0 is " in shown.output
    assert "nothing is written" in shown.output
    assert relation(config) != TRUTH
    assert calibrated(config, *wrong, "--leave-out", "2.0,3.0").exit_code == 0
    assert relation(config) == TRUTH


def test_two_points_whose_distances_differ_are_not_believed(config: Path) -> None:
    shown = calibrated(config, "--pair", "0,0=0,0", "--pair", "5,0=5.5,0", "--yes")
    assert shown.exit_code == 1
    assert "up to 0.25 m off where 0.03 m" in shown.output


def test_pairs_come_from_a_file_too(config: Path, tmp_path: Path) -> None:
    file = tmp_path / "points.yaml"
    pairs = [{"name": str(i), "apartment": list(p), "map": list(TRUTH.to_map(*p))} for i, p in enumerate(CORNERS)]
    file.write_text(yaml.safe_dump({"pairs": pairs}))
    assert calibrated(config, "--pairs", str(file), "--yes").exit_code == 0
    assert relation(config) == TRUTH


@pytest.mark.parametrize(
    ("said", "why"),
    [
        (words(CORNERS[0]), "pairs: expected 2 pairs of points or more, got 1"),
        (["--pair", "1,2"], "--pair: expected X,Y=X,Y in metres"),
        ([*words(*CORNERS), "--leave-out", "door"], "--leave-out: expected one of 0.0,0.0, "),
        ([*words(*CORNERS), "--robot", "rosie"], "mission.robots: expected one of tiago, got 'rosie'"),
        ([*words(*CORNERS), "--pairs", "{}"], "points.yaml:1: pairs[0].map[0]: expected "),
    ],
)
def test_wrong_usage_is_told(config: Path, tmp_path: Path, said: list[str], why: str) -> None:
    file = tmp_path / "points.yaml"
    file.write_text("pairs: [{name: door, apartment: [1, 2], map: [nowhere]}]\n")
    shown = calibrated(config, *(str(file) if word == "{}" else word for word in said))
    assert isinstance(shown.exception, ConfigError)
    assert why in str(shown.exception)


@given(
    st.sampled_from(["", "map: map.yaml\n", "# first\nmap: map.yaml # the map\nradius: 0.3"]),
    st.sampled_from(
        ["", "apartment_to_map: {x: 1, y: 2}\n", "apartment_to_map:  # where\n  x: 1\n  # and\n  y: 2\n",
         "apartment_to_map:\n    {x: 1,\n     y: 2}\n", "apartment_to_map:\n"]
    ),
    st.sampled_from(["", "points:\n  Door: {x: 1, y: 2}\n", "\n# points\npoints: {}\n"]),
)  # fmt: skip
def test_the_files_text_keeps_all_but_the_relation(before: str, entry: str, after: str) -> None:
    head = before if before.endswith("\n") or not before else f"{before}\n"
    changed = with_relation(head + entry + after, TRUTH)
    assert yaml.safe_load(changed) == {
        **(yaml.safe_load(head + after) or {}), "apartment_to_map": TRUTH.model_dump(),
    }  # fmt: skip
    for line in (head + after).splitlines():
        assert line in changed.splitlines()


def test_what_robot_and_house_both_see_gives_the_relation(tmp_path: Path) -> None:
    def with_its_size(config: Path) -> None:
        config.write_text(config.read_text().replace("{17: 0.10}}", "{100: 0.12}}\n    frames: 1"))

    both = Both()
    with virtual_flat(tmp_path, with_its_size) as flat:
        assert flat.order("ip1", "Scan", '{"targets": [582, 100]}') is not None
        for message in flat.client.seen:
            if message.topic.startswith("camera/ip1/marker/"):
                both.hears(read(message, flat.now).payload)
        for point in ("Living room", "TV"):
            flat.client.say("robot/tiago/goto", f'{{"point": "{point}"}}')
            flat.until(lambda: False, 25.0)
            for message in flat.client.pump():
                if message.topic in ("robot/tiago/pose", "robot/tiago/seen"):
                    both.hears(read(message, flat.now).payload)
    pairs = [Pair(str(marker), *points) for marker, points in both.pairs().items()]
    assert len(pairs) >= 2
    found = fit(pairs, 0.02)
    for corner in CORNERS:
        there = Relation(x=found.x, y=found.y, yaw_deg=found.yaw_deg).to_map(*corner)
        assert there == pytest.approx(TRUTH.to_map(*corner), abs=0.05)


@pytest.mark.mosquitto
def test_what_is_measured_on_the_bus_is_kept_and_used(
    config: Path, tmp_path: Path, mosquitto_broker: Broker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("APARTMENT_BROKER_PORT", str(mosquitto_broker.port))
    monkeypatch.setenv("BUS_OPERATOR_PASSWORD", mosquitto_broker.passwords["operator"])
    points = str(tmp_path / "points.yaml")
    with connected(BusSettings(port=mosquitto_broker.port)) as bus, robot_that_sees(bus):
        shown = calibrated(config, "--here", "0,0", "--pairs", points, "--yes")
        assert "got 1: one point tells no direction" in str(shown.exception)
        shown = calibrated(config, "--seen", "4", "--pairs", points, "--yes")
    assert shown.exit_code == 0, shown.output
    found = relation(config)
    assert (found.x, found.y, found.yaw_deg) == pytest.approx((1.5, -0.8, 12.0), abs=1e-3)
    assert [one["name"] for one in yaml.safe_load(Path(points).read_text())["pairs"]] == [
        "robot at 0,0", "marker 17", "marker 582"
    ]  # fmt: skip


@contextmanager
def robot_that_sees(bus: Client) -> Iterator[None]:
    """Stands on the apartment's origin, and says again and again that it sees two markers that a camera has found."""
    at = {582: (3.9, 4.5), 17: (1.8, 4.1)}
    x, y = TRUTH.to_map(0, 0)
    pose = ROBOT_POSE.message(RobotPose(x=x, y=y, yaw_deg=90, stamp=stamp(0)), robot="tiago")
    there = {marker: TRUTH.to_map(*here) for marker, here in at.items()}
    markers = [SeenMarker(marker=marker, position=Point(x=u, y=v, z=0.5)) for marker, (u, v) in there.items()]
    seen = ROBOT_SEEN.message(RobotSeen(markers=markers, stamp=stamp(0)), robot="tiago")
    found = [CAMERA_MARKER.message(result(marker, *here), cam="ip1", marker=str(marker)) for marker, here in at.items()]
    stopping = Event()

    def speak() -> None:
        while not stopping.wait(0.05):
            for message in (pose, seen, *found):
                bus.publish(message)

    thread = Thread(target=speak)
    thread.start()
    try:
        yield
    finally:
        stopping.set()
        thread.join()


def result(marker: int, x: float, y: float) -> ScanResult:
    return ScanResult(
        camera="ip1", marker=marker, dictionary="DICT_5X5_1000", place="Sofa", position=Point(x=x, y=y, z=0.5),
        covariance=[[1e-6, 0, 0], [0, 1e-6, 0], [0, 0, 1e-6]], orientation=None, orientations=[], distance=3.0, zoom=0,
        frames=1, mode="bw", first_seen=stamp(0), stamp=stamp(0), scan="s",
    )  # fmt: skip


def test_what_a_robot_sees_while_it_moves_does_not_count() -> None:
    both = Both()
    for x in (0.0, 0.1, 0.2):
        both.hears(RobotPose(x=x, y=0, yaw_deg=0, stamp=stamp(0)))
        both.hears(RobotSeen(markers=[SeenMarker(marker=1, position=Point(x=1, y=2, z=0))], stamp=stamp(0)))
    assert not both.robot
    both.hears(RobotPose(x=0.2, y=0, yaw_deg=0, stamp=stamp(0)))
    both.hears(RobotSeen(markers=[SeenMarker(marker=1, position=Point(x=1, y=2, z=0))], stamp=stamp(0)))
    assert both.robot == {1: [(1.0, 2.0)]}
