"""What a robot's frames and pictures mean: places in its map, and nothing where something is missing."""

from __future__ import annotations

import time
from dataclasses import replace
from math import inf, nan
from typing import Any

import numpy as np
import pytest

from services.bridge.node import FROM_ROS, LINK, Link
from services.bridge.robots import eyes
from services.bridge.robots.chain import Chain, transform, yaw_deg
from services.bridge.robots.pipe import Wanted
from services.bridge.robots.senses import OLD_S, Senses, ports
from services.bus import Message
from services.errors import BadMessage
from services.payloads.robot import RobotPose, RobotSeen
from services.simulators.robot import eye
from services.simulators.world import load
from services.vision.detect import detect
from services.vision.frames import Transform, quaternion, rotation_z
from tests.bridge.test_service import CONFIG

WALL = 1_000_000.0
UPRIGHT = Transform(np.eye(3), np.zeros(3))
BOMB = b"P6 60000 60000 255\n" + bytes(100)  # a picture of three thousand million pixels, so it says
IMAGE, INFO, FIDUCIALS = "/eye/image_raw", "/eye/camera_info", "/fiducial_transforms"


def frame(parent: str, child: str, where: Transform, stamp: float = WALL) -> dict[str, Any]:
    x, y, z = (float(part) for part in where.translation)
    rotation = dict(zip("xyzw", quaternion(where.rotation), strict=True))
    there = {"translation": {"x": x, "y": y, "z": z}, "rotation": rotation}
    return {"header": {"stamp": stamp, "frame_id": parent}, "child_frame_id": child, "transform": there}


def at(x: float, y: float, yaw: float = 0.0, z: float = 0.0) -> Transform:
    return Transform(rotation_z(yaw), np.array([x, y, z]))


def test_a_place_is_the_chain_of_all_that_were_said() -> None:
    chain = Chain()
    chain.note([frame("map", "odom", at(1.0, 0.0, 90.0)), frame("/odom", "/base_link", at(2.0, 0.0, 45.0))])
    found = chain.between("map", "base_link")
    assert found is not None
    assert found.translation == pytest.approx([1.0, 2.0, 0.0])
    assert yaw_deg(found) == pytest.approx(135.0)
    assert chain.between("map", "arm") is None
    assert chain.between("odom", "map") is None


def test_a_picture_is_placed_by_the_frames_of_its_own_time() -> None:
    chain = Chain()
    for step in range(100):
        chain.note([frame("map", "base_link", at(step / 10, 0.0), WALL + step / 20)])
    newest, then = chain.between("map", "base_link"), chain.between("map", "base_link", WALL + 4.0)
    assert newest is not None
    assert then is not None
    assert (newest.translation[0], then.translation[0]) == (9.9, 8.0)


def test_frames_that_make_a_ring_and_a_turn_that_is_none_do_no_harm() -> None:
    chain = Chain()
    chain.note([frame("a", "b", UPRIGHT), frame("b", "a", UPRIGHT)], fixed=True)
    assert chain.between("map", "b") is None
    nothing = {"position": dict.fromkeys("xyz", 1.0), "orientation": dict.fromkeys("xyzw", 0.0)}
    assert np.array_equal(transform(nothing).rotation, np.eye(3))


class Sensing:
    """The senses, and what comes to them."""

    def __init__(self, **wanted: Any) -> None:
        self.senses = Senses(Wanted("n", None, (), base_frame="base_link", **wanted))

    def says(self, topic: str, fields: Any) -> None:
        self.senses.hear(Message(FROM_ROS + topic, value=fields))

    def turn(self, seconds: float = 0.0) -> list[RobotPose | RobotSeen]:
        return self.senses.turn(time.monotonic() + seconds, WALL)

    def seen(self) -> list[Any]:
        return [one.markers for one in self.turn() if isinstance(one, RobotSeen)]


def test_tf_goes_before_amcl_and_both_are_said_at_their_pace() -> None:
    sensing = Sensing(amcl_pose="/amcl_pose", pose_every_s=10.0)
    assert sensing.turn() == []
    pose = {"position": {"x": 5.0, "y": 6.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 1.0, "w": 0.0}}
    sensing.says("/amcl_pose", {"pose": {"pose": pose}})
    (said,) = sensing.turn()
    assert isinstance(said, RobotPose)
    assert (said.x, said.y, abs(said.yaw_deg)) == (5.0, 6.0, 180.0)
    sensing.says("/tf", {"transforms": [frame("map", "base_link", at(1.0, 2.0))]})
    assert sensing.turn() == []
    (later,) = sensing.turn(11.0)
    assert isinstance(later, RobotPose)
    assert (later.x, later.y) == (1.0, 2.0)
    assert sensing.senses.felt().picture_age_s == inf


@pytest.mark.parametrize("number", [nan, inf, -1e308])
def test_a_frame_that_is_nowhere_is_left_out_as_tf_does_it(number: float) -> None:
    sensing = Sensing(amcl_pose="/amcl_pose")
    nowhere = frame("map", "base_link", at(number, 2.0))
    sensing.says("/tf", {"transforms": [nowhere, frame("odom", "other", UPRIGHT)]})
    pose = {"position": dict.fromkeys("xyz", number), "orientation": dict.fromkeys("xyzw", 0.0)}
    sensing.says("/amcl_pose", {"pose": {"pose": pose}})
    assert sensing.turn() == []
    sensing.says("/tf", {"transforms": [nowhere, frame("map", "base_link", at(1.0, 2.0))]})
    (said,) = sensing.turn()
    assert isinstance(said, RobotPose)
    assert (said.x, said.y) == (1.0, 2.0)


@pytest.mark.parametrize("change", [{"K": [nan] * 9}, {"K": [1e308] * 9}, {"D": [inf] * 5}, {"D": [1e300] * 5},
                                    {"K": [1e-300, 0, 0, 0, 1e-300, 0, 0, 0, 1]}])  # fmt: skip
def test_a_lens_that_is_none_shows_which_marker_it_is_but_not_where(change: Any) -> None:
    world = load(CONFIG / "world.yaml")
    marker = world.marker(582).pose.translation
    camera = at(float(marker[0]) - 0.1, float(marker[1]) - 1.2, 85.0) @ eye.in_base(1.1, 22.0)
    lens = eyes.lens({**eye.camera_info(), **change})
    seen = eyes.look(eye.Eye(world, 1).picture(camera), "DICT_5X5_1000", lens, camera, {}, 0.14)
    assert [one.position for one in seen if one.marker == 582] == [None]


def test_a_marker_in_its_picture_is_where_it_is_in_the_map() -> None:
    """The picture of the simulated robot's camera, from a place where marker 582 is before it."""
    world = load(CONFIG / "world.yaml")
    relation = world.map.apartment_to_map.transform
    marker = relation.apply(world.marker(582).pose.translation)
    base = at(float(marker[0]) - 0.1, float(marker[1]) - 1.2, 85.0)
    camera = base @ eye.in_base(1.1, 22.0)
    pixels = eye.Eye(world, 1).picture(relation.inverse() @ camera)
    sensing = Sensing(image=IMAGE, camera_info=INFO)
    sensing.says("/tf", {"transforms": [frame("map", "base_link", base)]})
    sensing.says("/tf_static", {"transforms": [frame("base_link", "eye", base.inverse() @ camera)]})
    header = {"stamp": WALL, "frame_id": "eye"}
    height, width = pixels.shape[:2]
    image = {"header": header, "height": height, "width": width, "step": 3 * width, "encoding": "bgr8"}
    sensing.says(INFO, {"header": header, **eye.camera_info()})
    sensing.says(IMAGE, {**image, "data": pixels.tobytes()})
    (markers,) = sensing.seen()
    (found,) = [one for one in markers if one.marker == 582]
    assert [found.position.x, found.position.y, found.position.z] == pytest.approx(marker, abs=0.03)
    assert sensing.seen() == [], "a picture is looked at once"


def test_a_marker_that_the_picture_cuts_off_is_seen_but_not_where() -> None:
    world = load(CONFIG / "world.yaml")
    marker = world.marker(582).pose.translation
    camera = at(float(marker[0]) - 0.1, float(marker[1]) - 1.2, 85.0) @ eye.in_base(1.1, 22.0)
    pixels, lens = eye.Eye(world, 1).picture(camera), eyes.lens(eye.camera_info())
    assert lens is not None
    (there,) = (one.corners for one in detect(pixels, "DICT_5X5_1000", [582]))

    def placed(last: float) -> list[bool]:
        part = np.ascontiguousarray(pixels[:, : round(last)])
        seen = eyes.look(part, "DICT_5X5_1000", replace(lens, width=part.shape[1]), camera, {}, 0.14)
        return [one.position is not None for one in seen if one.marker == 582]

    assert placed(there[:, 0].max() + 20) == [True]
    assert placed(there[:, 0].max() - 1) == [False]


@pytest.mark.parametrize("encoding", sorted(eyes.PIXELS))
def test_pictures_of_all_encodings_are_read(encoding: str) -> None:
    size = eyes.PIXELS[encoding]
    row = [*range(2 * size), 99]  # rows may be longer than their pixels
    image = eyes.picture({"encoding": encoding, "height": 1, "width": 2, "step": len(row), "data": bytes(row)})
    first = np.atleast_1d(image[0, 0]).tolist()
    wanted = [0] if size == 1 else [2, 1, 0] if encoding.startswith("rgb") else [0, 1, 2]
    assert first == wanted


@pytest.mark.parametrize(
    "fields",
    [
        {"encoding": "bayer_rggb8", "height": 1, "width": 1, "step": 1, "data": b"x"},
        {"encoding": "mono8", "height": 2, "width": 2, "step": 2, "data": b"x"},
        {"encoding": "mono8", "height": 0, "width": 0, "step": 0, "data": b""},
        {"encoding": "bgr8", "height": 2, "width": 0, "step": 1, "data": b"xx"},
        {"data": b"no picture"},
        {"data": BOMB},
        {"data": b""},
    ],
)
def test_a_picture_that_is_none_is_refused(fields: Any) -> None:
    with pytest.raises(BadMessage):
        eyes.picture(fields)


def test_what_aruco_detect_says_is_taken_as_it_is_and_rubbish_is_not() -> None:
    sensing = Sensing(fiducials=FIDUCIALS)
    one = {"fiducial_id": 7, "transform": frame("", "", at(0.0, 0.0, z=2.0))["transform"]}
    header = {"stamp": WALL, "frame_id": "eye"}
    sensing.says(FIDUCIALS, {"header": header, "transforms": [one]})
    ((found,),) = sensing.seen()
    assert (found.marker, found.position, found.distance) == (7, None, 2.0), "no frames yet: seen, but not where"
    nowhere = {**one["transform"], "translation": dict.fromkeys("xyz", nan)}
    for rubbish in (
        {"data": 3}, {"header": header}, {"header": header, "transforms": [{"id": 3}]}, {"header": 3, "transforms": []},
        {"header": {"stamp": "now", "frame_id": "eye"}, "transforms": []},
        {"header": header, "transforms": [{**one, "transform": nowhere}]}, {"header": header, "transforms": 3},
    ):  # fmt: skip
        sensing.senses._look_due = 0.0
        sensing.says(FIDUCIALS, rubbish)
        assert sensing.seen() == []


def test_without_a_mission_it_looks_now_and_then() -> None:
    sensing = Sensing(fiducials=FIDUCIALS)
    nothing = {"header": {"stamp": WALL, "frame_id": "eye"}, "transforms": []}
    counts, base = [], time.monotonic()
    for mission in (False, True):
        sensing.senses.hurry(mission=mission)
        looks = 0
        for step in range(20):
            sensing.says(FIDUCIALS, nothing)
            looks += len(sensing.senses.turn(base + 0.13 * step, WALL))
        counts.append(looks)
    assert counts == [2, 5], "in two and a half seconds"


def test_a_picture_that_is_old_is_not_told() -> None:
    sensing = Sensing(fiducials=FIDUCIALS)
    sensing.says(FIDUCIALS, {"header": {"stamp": WALL, "frame_id": "eye"}, "transforms": []})
    assert sensing.turn(OLD_S + 1) == []


def test_its_ports_are_those_of_its_settings() -> None:
    topics = [inlet.topic for inlet in ports(Wanted("n", None, ("/a/cancel",), image=f"{IMAGE}/compressed")).inlets]
    assert topics == ["/tf", "/tf_static", f"{IMAGE}/compressed"]
    sensing = Sensing()
    sensing.senses.hear(Message(LINK, value=Link(up=False, text="gone", ended=True)))
    assert (sensing.senses.up, sensing.senses.ended, sensing.senses.felt().link) == (False, True, "gone")
