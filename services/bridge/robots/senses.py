"""The process that feels for a robot: a ROS node of its own that hears where the robot is and looks through its camera.

Frames and pictures come by the hundred each second; the bridge hears only what they mean: where the robot stands, and
which markers it sees. And it outlives the bridge by a second: when its pipe closes while a goal is under way, by an
orderly end or by kill -9, it cancels that goal. How it is kept running: `child.py`.
"""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from contextlib import suppress
from math import inf
from multiprocessing.connection import Connection

from services.bridge import definitions, images
from services.bridge.darkroom import LOG_FORMAT
from services.bridge.node import ANY, FROM_ROS, Inlet, Outlet, Ports
from services.bridge.robots import chain, eyes
from services.bridge.robots.chain import Chain
from services.bridge.robots.pipe import Felt, UnderWay, Wanted
from services.bridge.ros import RosNode
from services.bridge.rules import Fields
from services.bus import Message
from services.errors import BadMessage
from services.payloads import stamp
from services.payloads.robot import RobotPose, RobotSeen, SeenMarker
from services.vision.frames import Transform

TF, TF_STATIC = "/tf", "/tf_static"
IDLE_S = 2.0  # between two looks while nobody waits for them
OLD_S = 3.0  # of a picture or pose that is still worth telling
FAREWELL_S = 1.0  # for a cancel to leave before we do
TURN_S = 0.05
COMPRESSED = "/compressed"

log = logging.getLogger(__name__)


def run(wanted: Wanted, connection: Connection, every_s: float) -> None:
    """The whole life of the process: until the bridge closes its end, or dies."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)  # they are meant for the bridge; we end after it
    logging.basicConfig(level=logging.INFO, format=LOG_FORMAT, datefmt="%Y-%m-%dT%H:%M:%S")
    images.one_thread()
    senses = Senses(wanted)
    node = RosNode(wanted.node, wanted.master_uri, ports(wanted), senses.hear)
    goal: tuple[str, str] | None = None
    report_at = 0.0
    try:
        while True:
            if connection.poll(TURN_S) and isinstance(told := connection.recv(), UnderWay):
                goal = told.goal
                senses.hurry(mission=told.mission)
            for said in senses.turn(time.monotonic(), time.time()):
                connection.send(said)
            if time.monotonic() >= report_at:
                report_at = time.monotonic() + every_s
                connection.send(senses.felt())
            if senses.ended:
                log.error("%s: %s", wanted.node, senses.link)
                os._exit(1)  # the bridge starts another
    except (EOFError, OSError):  # the bridge has ended
        _farewell(node, goal)
    definitions.tidy()
    os._exit(0)  # threads of rospy would hold up the end


def _farewell(node: RosNode, goal: tuple[str, str] | None) -> None:
    if goal is not None:
        log.warning("the bridge is gone: %s is cancelled", goal[1])
        node.publish(goal[0], {"id": goal[1]})
        node.flush()
        time.sleep(FAREWELL_S)  # rospy's threads send it
    leaving = threading.Thread(target=node.close, daemon=True)
    leaving.start()
    leaving.join(FAREWELL_S)


def ports(wanted: Wanted) -> Ports:
    """What the node has."""
    inlets = [Inlet(TF, "tf2_msgs/TFMessage"), Inlet(TF_STATIC, "tf2_msgs/TFMessage")]
    if wanted.amcl_pose:
        inlets.append(Inlet(wanted.amcl_pose, "geometry_msgs/PoseWithCovarianceStamped"))
    if wanted.fiducials:
        inlets.append(Inlet(wanted.fiducials, ANY))
    if wanted.image:
        kind = "CompressedImage" if wanted.image.endswith(COMPRESSED) else "Image"
        inlets.append(Inlet(wanted.image, f"sensor_msgs/{kind}", newest=True))
    if wanted.camera_info:
        inlets.append(Inlet(wanted.camera_info, "sensor_msgs/CameraInfo", newest=True))
    return Ports(tuple(Outlet(topic, "actionlib_msgs/GoalID") for topic in wanted.cancels), tuple(inlets))


class Senses:
    """What was heard, and what it means. `hear` is called on threads of rospy, `turn` on one thread of its own."""

    def __init__(self, wanted: Wanted) -> None:
        self._wanted = wanted
        self._lock = threading.Lock()
        self._chain = Chain()
        self._amcl: tuple[float, Transform] | None = None
        self._newest: dict[str, tuple[float, Fields]] = {}  # pictures and lenses: when they came, and what
        self._pose_due = self._look_due = 0.0
        self._pose_at = self._picture_at = -inf
        self._look_every_s = max(IDLE_S, wanted.look_every_s)
        self.link, self.up, self.ended = "not yet", False, False

    def hear(self, message: Message) -> None:
        """Takes what ROS says."""
        fields, topic, now = message.value, message.topic.removeprefix(FROM_ROS), time.monotonic()
        if not isinstance(fields, dict):  # news of the link
            self.link, self.up = str(getattr(fields, "text", "")), bool(getattr(fields, "up", False))
            self.ended = bool(getattr(fields, "ended", False))
            return
        with self._lock:
            if topic in (TF, TF_STATIC):
                self._chain.note(fields["transforms"], fixed=topic == TF_STATIC)
            elif topic == self._wanted.amcl_pose:
                with suppress(ValueError):
                    self._amcl = now, chain.transform(fields["pose"]["pose"])
            else:
                self._newest[topic] = now, fields

    def hurry(self, *, mission: bool) -> None:
        """On a mission it looks as often as it is told to, else now and then."""
        self._look_every_s = self._wanted.look_every_s if mission else max(IDLE_S, self._wanted.look_every_s)
        self._look_due = 0.0

    def turn(self, now: float, wall: float) -> list[RobotPose | RobotSeen]:
        """What is to be told now: `now` of the monotonic clock, `wall` seconds since 1970."""
        said: list[RobotPose | RobotSeen] = []
        if now >= self._pose_due and (where := self._where()) is not None:
            self._pose_due, self._pose_at = now + self._wanted.pose_every_s, now
            said.append(_pose(where, wall))
        if now >= self._look_due and (seen := self._look(now)) is not None:
            self._look_due, self._picture_at = now + self._look_every_s, now
            said.append(RobotSeen(markers=seen, stamp=stamp(wall)))
        return said

    def felt(self) -> Felt:
        """How it does."""
        now = time.monotonic()
        return Felt(self.link, self.up, now - self._pose_at, now - self._picture_at)

    def _where(self) -> Transform | None:
        """By tf, which is newer; by amcl where there is no tf."""
        with self._lock:
            found = self._chain.between(self._wanted.map_frame, self._wanted.base_frame)
        return found or (self._amcl[1] if self._amcl else None)

    def _look(self, now: float) -> list[SeenMarker] | None:
        """What the newest picture shows, or what aruco_detect says; None when there is nothing new."""
        for topic in (self._wanted.image, self._wanted.fiducials):
            with self._lock:
                came, fields = self._newest.pop(topic, (-inf, {})) if topic else (-inf, {})
            if now - came > OLD_S:
                continue
            try:
                return self._told(fields) if topic == self._wanted.fiducials else self._pictured(fields)
            except BadMessage as error:
                log.warning("%s: %s", topic, error)
        return None

    def _camera(self, header: Fields) -> Transform | None:
        with self._lock:
            return self._chain.between(self._wanted.map_frame, str(header["frame_id"]), float(header["stamp"]))

    def _told(self, fields: Fields) -> list[SeenMarker]:
        try:
            camera = self._camera(fields["header"])
        except (KeyError, TypeError, ValueError) as error:
            raise BadMessage("expected a fiducial_msgs/FiducialTransformArray, without a header") from error
        return eyes.told(fields, camera)

    def _pictured(self, fields: Fields) -> list[SeenMarker]:
        wanted = self._wanted
        with self._lock:
            _, info = self._newest.get(wanted.camera_info or "", (0.0, None))
        lens, camera = eyes.lens(info) if info else None, self._camera(fields["header"])
        return eyes.look(eyes.picture(fields), wanted.dictionary, lens, camera, wanted.sizes, wanted.size)


def _pose(where: Transform, wall: float) -> RobotPose:
    x, y = (round(float(part), 3) for part in where.translation[:2])
    return RobotPose(x=x, y=y, yaw_deg=round(chain.yaw_deg(where), 2), stamp=stamp(wall))
