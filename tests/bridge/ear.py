"""A subscriber as a program of its own: rospy's node exists once per process, and ours must not hear it think.

Arguments: topics with their types, `/a=std_msgs/String`. Each message becomes a JSON line: topic, when it came
(monotonic), stamp and frame of its header, and for pictures the number that they show (see `patterns.py`).
"""

from __future__ import annotations

import hashlib
import json
import sys
import time
from typing import Any

import numpy as np
import rospy

from services.bridge.messages import message_class
from tests.bridge.patterns import shown


def main() -> None:
    rospy.init_node("ear", anonymous=True, disable_rosout=True)
    for argument in sys.argv[1:]:
        topic, _, kind = argument.partition("=")
        rospy.Subscriber(topic, message_class(kind), heard, callback_args=topic, tcp_nodelay=True, buff_size=2**24)
    rospy.spin()


def heard(message: Any, topic: str) -> None:
    told: dict[str, Any] = {"topic": topic, "at": time.monotonic()}
    if hasattr(message, "header"):
        told |= {"stamp": message.header.stamp.to_nsec(), "frame": message.header.frame_id}
    if hasattr(message, "encoding"):
        pixels = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)
        told |= {"number": shown(pixels), "size": [message.width, message.height], "encoding": message.encoding}
    elif hasattr(message, "format"):
        told |= {"format": message.format, "digest": hashlib.sha256(message.data).hexdigest()}
    elif hasattr(message, "K"):
        told |= {"size": [message.width, message.height], "K": list(message.K), "D": list(message.D)}
    elif hasattr(message, "info"):
        told["cells"] = list(message.data)
    elif hasattr(message, "status"):
        told["levels"] = {one.name: one.level for one in message.status}
        told["status"] = {one.name: {pair.key: pair.value for pair in one.values} for one in message.status}
    sys.stdout.write(json.dumps(told) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
