"""A robot with packages that are not installed here: PAL's server of named points, and aruco_detect.

Their types are made of definitions, as if by somebody else; both are plain topics. What was asked of the server is
printed as JSON lines. It has reached every point as soon as it has been named twice, and aborts at `Moon`.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import rospy
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from genpy.dynamic import generate_dynamic
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from services.bridge.robots import actions
from tests.bridge.test_definitions import ARRAY, FIDUCIALS

POI = "/poi_navigation_server/go_to_poi"
GOAL = actions.go_to_poi(POI)
RESULT = "pal_navigation_msgs/GoToPOIActionResult"
RESULT_TEXT = (
    "Header header\nactionlib_msgs/GoalStatus status\nGoToPOIResult result\n"
    f"{actions.RULE}{actions.HEADER}{actions.RULE}{actions.GOAL_ID}"
    f"{actions.RULE}actionlib_msgs/GoalStatus\nactionlib_msgs/GoalID goal_id\nuint8 status\nstring text\n"
    f"{actions.RULE}pal_navigation_msgs/GoToPOIResult\n\n"
)


class Foreign:
    """Both."""

    def __init__(self) -> None:
        goal = generate_dynamic(GOAL.type, GOAL.definition)[GOAL.type]
        self.fiducials = generate_dynamic(ARRAY, FIDUCIALS)
        self.result = generate_dynamic(RESULT, RESULT_TEXT)[RESULT]
        self.goal: tuple[str, str] | None = None
        self.named = 0
        self.status_to = rospy.Publisher(GOAL.status, GoalStatusArray, queue_size=5)
        self.result_to = rospy.Publisher(GOAL.result, self.result, queue_size=5)
        self.seen_to = rospy.Publisher("/fiducial_transforms", self.fiducials[ARRAY], queue_size=5)
        self.tf_to = rospy.Publisher("/tf", TFMessage, queue_size=5)
        rospy.Subscriber(GOAL.goal, goal, self.asked)
        rospy.Subscriber(GOAL.cancel, GoalID, lambda one: tell(cancel=one.id))

    def asked(self, message: Any) -> None:
        tell(goal=message.goal_id.id, poi=message.goal.poi.data)
        self.goal, self.named = (message.goal_id.id, message.goal.poi.data), 0

    def turn(self) -> None:
        self.see()
        array = GoalStatusArray()
        if self.goal is not None:
            name, point = self.goal
            self.named += 1
            ended = GoalStatus.ABORTED if point == "Moon" else GoalStatus.SUCCEEDED
            array.status_list = [GoalStatus(GoalID(id=name), GoalStatus.ACTIVE, "")]
            if self.named > 2:
                result = self.result()
                result.status = GoalStatus(GoalID(id=name), ended, "so it is")
                self.result_to.publish(result)
                array.status_list, self.goal = [result.status], None
        self.status_to.publish(array)

    def see(self) -> None:
        """The robot stands at (1, 2) and looks along x; a marker is 2 m before it, 0.5 m to the right."""
        stamp = rospy.Time.from_sec(time.time())
        base, eye = TransformStamped(), TransformStamped()
        base.header.frame_id, base.child_frame_id = "map", "base_footprint"
        base.transform.translation.x, base.transform.translation.y, base.transform.rotation.w = 1.0, 2.0, 1.0
        eye.header.frame_id, eye.child_frame_id = "/base_footprint", "/eye"
        eye.transform.translation.z = 1.0
        turned = eye.transform.rotation
        turned.x, turned.y, turned.z, turned.w = -0.5, 0.5, -0.5, 0.5
        for one in (base, eye):
            one.header.stamp = stamp
        self.tf_to.publish(TFMessage([base, eye]))
        seen = self.fiducials[ARRAY]()
        seen.header.frame_id, seen.header.stamp = "eye", stamp
        one = self.fiducials["fiducial_msgs/FiducialTransform"]()
        one.fiducial_id = 582
        one.transform.translation.x, one.transform.translation.z, one.transform.rotation.w = 0.5, 2.0, 1.0
        seen.transforms = [one]
        self.seen_to.publish(seen)


def tell(**said: str) -> None:
    sys.stdout.write(json.dumps(said) + "\n")
    sys.stdout.flush()


def main() -> None:
    rospy.init_node("foreign", disable_rosout=True)
    foreign = Foreign()
    rate = rospy.Rate(10)
    while not rospy.is_shutdown():
        foreign.turn()
        rate.sleep()


if __name__ == "__main__":
    main()
