"""The bounds that the camera's moves are held to: by the test over all firmware profiles, and printed by the bench."""

from __future__ import annotations

GOALS = 50  # at random in pan, tilt and zoom, on both sides of the dead arc, one after the other from a cold start
OFF_DEG = 0.5  # the truth, when `done` is said
MEDIAN_START_STOP = 2.0  # time over the least time of the motors, where the camera takes only start and stop
MEDIAN_POSITIONS = 1.3  # where it honours an absolute position, or the goal is a place that has a preset
MEDIAN_PAN_ONLY = 2.1  # not 2.0 yet where a position is honoured but for its tilt, and answers take longer
MEDIAN_BESIDE = 2.0  # of start and stop from a preset that is up to PRESET_DEG beside the goal
PRESET_DEG = 2.0
COMMANDS = 12  # for a goal, answers to login challenges not counted
WITHIN_COMMANDS = 0.93  # of the goals at least; a first goal, or one with a late answer or two, takes more
