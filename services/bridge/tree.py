"""Says the tree of frames and the joints as the cameras move and markers are found. What it looks like: `frames.py`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from services import topics
from services.apartment.robot_places import Relation
from services.bridge import frames
from services.bridge.node import Node, Outlet, Ports
from services.bridge.part import Part
from services.bridge.rules import Fields, Heard
from services.bus import Message
from services.errors import BadMessage
from services.payloads import CameraStatus, Position, ScanResult, seconds
from services.vision.frames import Mount

TF, TF_STATIC, JOINTS = "/tf", "/tf_static", "/joint_states"
EVERY_S = 0.1  # who looks a frame up wants one before and one after the time of its picture
LAST_S = 2.0**32  # since 1970, the first time that ROS cannot say
SEEN = ("online", "degraded")  # states of a camera whose position is known


class Tree(Part):
    """`mounts` of the cameras, by name; `apartment`: where it lies in the map. The first camera's joints have the plain
    name."""

    rows = (topics.CAMERA_POSITION, topics.CAMERA_MARKER, topics.CAMERA_STATUS)

    def __init__(self, cameras: tuple[str, ...], mounts: Mapping[str, Mount], apartment: Relation) -> None:
        self._cameras, self._mounts, self._apartment = cameras, mounts, apartment
        self._joints = {cam: JOINTS if cam == cameras[0] else f"/{cam}{JOINTS}" for cam in cameras}
        outlets = [Outlet(TF, "tf2_msgs/TFMessage", queue=100), Outlet(TF_STATIC, "tf2_msgs/TFMessage", latch=True)]
        self.ports = Ports((*outlets, *(Outlet(name, "sensor_msgs/JointState") for name in self._joints.values())))
        self.due = 0.0
        self._positions: dict[str, Position] = {}
        self._markers: dict[int, ScanResult] = {}
        self._away: set[str] = set()
        self._static_is_new = True

    def hear(self, heard: Heard, now: float) -> None:
        """See `Part`."""
        cam, said = heard.levels["cam"], heard.model
        if cam not in self._joints:
            return
        if isinstance(said, Position):
            self._positions[cam] = said
            self.due = now
        elif isinstance(said, CameraStatus):
            (self._away.discard if said.state in SEEN else self._away.add)(cam)
        elif isinstance(said, ScanResult):
            if not 0 <= seconds(said.stamp) < LAST_S:
                raise BadMessage(
                    f"{heard.message.topic}: expected a stamp that ROS can say, 1970 to 2106, got {said.stamp}"
                )
            older = self._markers.get(said.marker)
            if older is None or seconds(older.stamp) <= seconds(said.stamp):
                self._markers[said.marker] = said
                self._static_is_new = True
                self.due = now

    def tick(self, node: Node, now: float) -> Iterable[Message]:
        """See `Part`."""
        if now >= self.due:
            self.due = now + EVERY_S
            if self._static_is_new:
                self._static_is_new = False
                node.publish(TF_STATIC, {"transforms": self._fixed(now)})
            self._say_moving(node, now)
        return ()

    def _say_moving(self, node: Node, now: float) -> None:
        here = {cam: where for cam, where in self._positions.items() if cam not in self._away}
        if moving := [frames.moving(cam, self._mounts[cam], here[cam], now) for cam in here if cam in self._mounts]:
            node.publish(TF, {"transforms": moving})
        for cam, where in here.items():
            node.publish(self._joints[cam], frames.joints(cam, where, now))

    def _fixed(self, now: float) -> list[Fields]:
        x, y, yaw_deg = self._apartment.x, self._apartment.y, self._apartment.yaw_deg
        cameras = [part for cam, mount in self._mounts.items() for part in frames.fixed(cam, mount, now)]
        markers = [found for seen in self._markers.values() if (found := frames.marker(seen)) is not None]
        return [frames.apartment_in_map(x, y, yaw_deg, now), *cameras, *markers]
