"""The robot as real ROS nodes: move_base's action server, amcl's pose, tf, and a camera. All in one process and node.

It is registered anew at every new master, as a robot that is started again would be. Not here: how it drives
(`navigation.py`), what its camera shows (`eye.py`), the same robot on the bus (`service.py`).
"""

from __future__ import annotations

import importlib
import importlib.util
import logging
import threading
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from services.errors import Unavailable
from services.ros import master as ros_master
from services.ros import node as ros_node
from services.simulators.robot import eye
from services.simulators.robot.eye import Eye
from services.simulators.robot.navigation import Navigation
from services.simulators.world import World
from services.vision.frames import Transform, quaternion, rotation_z

NODE = "simulated_robot"
POLL_S = 0.5  # of the master
LEAVE_S = 1.0  # a master that hangs must not hold up our end
STEP_S = 0.05  # of its motion and its frames
AMCL_M, AMCL_DEG = 0.05, 5.0  # of motion between two poses of amcl
CONTROL_S = 0.1  # of move_base
BASE_M = 0.0985  # of base_link over the floor
HEAD_M, DOWN_DEG = 1.0, 26.0  # of the camera over the base, and how far its head is bent
BELIEF_M, BELIEF_DEG = 0.01, 0.3  # how far it stands beside where it believes to be, one sigma
IMAGE, INFO, FRAME = "/xtion/rgb/image_raw", "/xtion/rgb/camera_info", "xtion_rgb_optical_frame"
HINDER = f"/{NODE}/hinder"  # std_srvs/Trigger: somebody stands in the way of the next goal

log = logging.getLogger(__name__)


class Nodes:
    """All of it, in threads that end with `close`. `navigation` holds the body that drives where it believes to be."""

    def __init__(self, world: World, navigation: Navigation, seed: int, fps: float) -> None:
        self.navigation = navigation
        self.lock = threading.Lock()
        self._world, self._fps, self._eye = world, fps, Eye(world, seed)
        draw = np.random.default_rng(seed)
        off = Transform(rotation_z(draw.normal(0, BELIEF_DEG)), np.array([*draw.normal(0, BELIEF_M, 2), 0.0]))
        self._to_apartment = world.map.apartment_to_map.transform.inverse() @ off
        self._camera = eye.in_base(HEAD_M, DOWN_DEG)
        self._start = self._believed()
        self._said: tuple[float, float, float] | None = None  # the newest pose of amcl
        self._stopping = threading.Event()
        self._publishers: dict[str, Any] = {}
        self._server: Any = None
        self._end: tuple[bool, str] | None = None  # of the goal under way
        self._threads = [threading.Thread(target=self._live, name="robot", daemon=True)]
        self._threads[0].start()

    def close(self) -> None:
        """Leaves the ROS graph."""
        self._stopping.set()
        for thread in self._threads:
            thread.join(LEAVE_S)
        rospy = ros_node.rospy()
        leaving = threading.Thread(target=rospy.signal_shutdown, args=("the robot is switched off",), daemon=True)
        leaving.start()
        leaving.join(LEAVE_S)

    # Threads.

    def _live(self) -> None:
        """Waits for a master, opens everything, then moves and says its frames; registers at every new master."""
        rosgraph = importlib.import_module("rosgraph")
        master = ros_master.Master(rosgraph.get_master_uri() or "http://localhost:11311", f"/{NODE}")
        known: int | None = None
        look_at = 0.0
        before = time.monotonic()
        while not self._stopping.wait(STEP_S):
            now = time.monotonic()
            if now >= look_at:
                look_at = now + POLL_S
                known = self._registered(master, known)
            if self._server is not None:
                self._move(now - before)
            before = now

    def _registered(self, master: ros_master.Master, known: int | None) -> int | None:
        try:
            pid = master.pid()
            if not self._publishers:
                self._open()
            if self._server is None:
                self._server = self._serve()
            if pid != known:
                ros_master.register(master, ros_node.registrations({}))
        except Unavailable as error:
            if known is not None:
                log.warning("no ROS master: %s", error)
            return None
        return pid

    def _open(self) -> None:
        """Makes the node and its topics; rospy waits there for a master that goes meanwhile."""
        ros_node.begin(NODE)
        rospy = ros_node.rospy()
        for topic, kind, latch in (
            ("/tf", "tf2_msgs/TFMessage", False),
            ("/tf_static", "tf2_msgs/TFMessage", True),
            ("/amcl_pose", "geometry_msgs/PoseWithCovarianceStamped", True),
            (IMAGE, "sensor_msgs/Image", False),
            (f"{IMAGE}/compressed", "sensor_msgs/CompressedImage", False),
            (INFO, "sensor_msgs/CameraInfo", False),
        ):
            self._publishers[topic] = rospy.Publisher(topic, _kind(kind), queue_size=5, latch=latch)
        rospy.Service(HINDER, importlib.import_module("std_srvs.srv").Trigger, self._hindered)
        self._feedback = importlib.import_module("move_base_msgs.msg").MoveBaseFeedback
        self._say_fixed()
        camera = threading.Thread(target=self._film, name="camera", daemon=True)
        self._threads.append(camera)
        camera.start()

    def _serve(self) -> Any:
        """Starts move_base's server; Unavailable when the master goes meanwhile: actionlib asks it for parameters."""
        action = importlib.import_module("move_base_msgs.msg").MoveBaseAction
        server = importlib.import_module("actionlib").SimpleActionServer("/move_base", action, self._go, False)
        try:
            server.start()
        except ros_master.FAULTS as error:  # one that has not started takes no goals; the next one will
            raise Unavailable(f"actionlib: {error or type(error).__name__}") from error
        return server

    def _move(self, seconds: float) -> None:
        with self.lock:
            self._end = self.navigation.advance(seconds) or self._end
        where, stamp = self._believed(), time.time()
        base = self._start.inverse() @ where
        self._say("/tf", transforms=[_frame("map", "odom", self._start, stamp),
                                     _frame("odom", "base_footprint", base, stamp)])  # fmt: skip
        body = self.navigation.body
        here = (body.x, body.y, body.yaw_deg)
        if self._said is None or np.hypot(here[0] - self._said[0], here[1] - self._said[1]) > AMCL_M or (
            abs((here[2] - self._said[2] + 180) % 360 - 180) > AMCL_DEG
        ):  # fmt: skip
            self._said = here
            pose = {"pose": _pose(where), "covariance": [0.0] * 36}
            self._say("/amcl_pose", header={"stamp": stamp, "frame_id": "map"}, pose=pose)

    def _film(self) -> None:
        """The camera's thread: pictures as long as somebody looks."""
        while not self._stopping.wait(1 / self._fps):
            raw, small = (self._publishers[one].get_num_connections() for one in (IMAGE, f"{IMAGE}/compressed"))
            if not raw and not small:
                continue
            stamp, where = time.time(), self._believed()
            header = {"stamp": stamp, "frame_id": FRAME}
            lens_at = self._to_apartment @ where @ Transform(np.eye(3), np.array([0.0, 0.0, BASE_M])) @ self._camera
            image = self._eye.picture(lens_at)
            self._say(INFO, header=header, **eye.camera_info())
            if raw:
                height, width = image.shape[:2]
                self._say(IMAGE, header=header, height=height, width=width, encoding="bgr8", step=3 * width,
                          data=image.tobytes())  # fmt: skip
            if small:
                self._say(
                    f"{IMAGE}/compressed", header=header, format="bgr8; jpeg compressed bgr8", data=eye.jpeg(image)
                )

    # What ROS asks for.

    def _go(self, goal: Any) -> None:
        """One goal of move_base's, on its own thread: until it has ended, or another one came."""
        target, server = goal.target_pose.pose, self._server
        turned = np.array([getattr(target.orientation, name) for name in "xyzw"])
        if abs(np.linalg.norm(turned) - 1) > 0.1:
            server.set_aborted(None, "Aborting on goal because it was sent with an invalid quaternion")
            return
        yaw = float(np.degrees(np.arctan2(2 * turned[3] * turned[2], 1 - 2 * turned[2] ** 2)))
        with self.lock:
            self._end = None
            self.navigation.begin((target.position.x, target.position.y), yaw)
        while (end := self._end) is None:
            if server.is_preempt_requested() or self._stopping.wait(CONTROL_S):
                with self.lock:
                    self.navigation.stop()
                server.set_preempted()
                return
            server.publish_feedback(_filled(self._feedback(), {"base_position": {"pose": _pose(self._believed())}}))
        (server.set_succeeded if end[0] else server.set_aborted)(None, end[1])

    def _hindered(self, _: Any) -> Any:
        with self.lock:
            self.navigation.fails += 1
        return importlib.import_module("std_srvs.srv").TriggerResponse(True, "somebody stands in its way")

    # What it says.

    def _believed(self) -> Transform:
        """base_footprint in the map, as the robot believes."""
        body = self.navigation.body
        return Transform(rotation_z(body.yaw_deg), np.array([body.x, body.y, 0.0]))

    def _say_fixed(self) -> None:
        stamp = time.time()
        base = Transform(np.eye(3), np.array([0.0, 0.0, BASE_M]))
        self._say("/tf_static", transforms=[_frame("base_footprint", "base_link", base, stamp),
                                            _frame("base_link", FRAME, self._camera, stamp)])  # fmt: skip

    def _say(self, topic: str, **fields: Any) -> None:
        publisher = self._publishers[topic]
        publisher.publish(_filled(publisher.data_class(), fields))


def _kind(name: str) -> Any:
    package, _, short = name.partition("/")
    return getattr(importlib.import_module(f"{package}.msg"), short)


def _filled(message: Any, fields: Mapping[str, Any]) -> Any:
    """Plain values to a message's fields; lists of transforms and times as they are wanted there."""
    for name, value in fields.items():
        if name == "stamp":
            value = ros_node.rospy().Time.from_sec(value)
        elif name == "transforms":
            value = [_filled(_kind("geometry_msgs/TransformStamped")(), one) for one in value]
        elif isinstance(value, Mapping):
            value = _filled(getattr(message, name), value)
        setattr(message, name, value)
    return message


def _frame(parent: str, child: str, where: Transform, stamp: float) -> dict[str, Any]:
    moved = _pose(where)
    return {
        "header": {"stamp": stamp, "frame_id": parent},
        "child_frame_id": child,
        "transform": {"translation": moved["position"], "rotation": moved["orientation"]},
    }


def _pose(where: Transform) -> dict[str, Any]:
    at, turned = (float(part) for part in where.translation), quaternion(where.rotation)
    return {"position": dict(zip("xyz", at, strict=True)), "orientation": dict(zip("xyzw", turned, strict=True))}


def installed() -> bool:
    """Whether ROS and the packages of a robot are here."""
    return all(importlib.util.find_spec(name) for name in ("rospy", "actionlib", "move_base_msgs"))
