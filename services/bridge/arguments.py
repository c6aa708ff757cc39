"""The arguments that roslaunch and people of ROS put behind a command: `__name:=`, `topic:=other`, `_param:=`.

They are taken out before our own command line is read, travel to the bridge's process in its environment, and are
given to rospy there as if they had stood behind its own command.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import MutableMapping

REMAP = ":="
VARIABLE = "APARTMENT_ROS_ARGUMENTS"


def take(arguments: list[str], environment: MutableMapping[str, str] = os.environ) -> list[str]:
    """The arguments without those of ROS, which are kept for the bridge."""
    ours = [one for one in arguments if REMAP not in one]
    if len(ours) < len(arguments):
        environment[VARIABLE] = json.dumps([one for one in arguments if REMAP in one])
    return ours


def given(environment: MutableMapping[str, str] = os.environ) -> list[str]:
    """Those of ROS."""
    return [str(one) for one in json.loads(environment.get(VARIABLE, "[]"))]


def name(default: str) -> str:
    """What the node is to be called: `__name:=` goes before the configuration."""
    named = [one.removeprefix(f"__name{REMAP}") for one in given() if one.startswith(f"__name{REMAP}")]
    return named[-1] if named else default


def hand_to_rospy(node: str) -> None:
    """Puts them where rospy looks, before it is imported; the name is `node`, whatever they say."""
    others = [one for one in given() if not one.startswith(f"__name{REMAP}")]
    sys.argv += [*(one for one in others if one not in sys.argv), f"__name{REMAP}{node}"]
