"""The bounds that the camera's moves are held to: by the test over all firmware profiles, and printed by the bench."""

from __future__ import annotations

GOALS = 50  # at random in pan, tilt and zoom, on both sides of the dead arc, one after the other from a cold start
OFF_DEG = 0.5  # the truth, when `done` is said
MEDIAN_START_STOP = 2.0  # time over the least time of the motors, where the camera takes only start and stop
MEDIAN_POSITIONS = 1.3  # where it honours an absolute position
COMMANDS = 12  # for a goal, answers to login challenges not counted
WITHIN_COMMANDS = 0.9  # of the goals at least; a first goal, or one with a late answer or two, takes more

SCAN_OVER_LEAST = 1.3  # a full scan (both picture modes, K = 8) over the least time of motors, frames and one switch
SCAN_QUICKER = 3.5  # than the report's scan of the same places
SIGHTING_SHARE = 0.25  # of the report's time until a target at a random place was seen
