"""The bounds that the issues name: of moves, markers and places. Tests hold to them, bench and soak print them.

Those of moves are held against a camera that was calibrated, as the docs have it done first. `COLD_`: our own, of one
that never was and learns its motors in these moves; the bench prints the others beside it all the same.
"""

from __future__ import annotations

GOALS = 50  # at random in pan, tilt and zoom, on both sides of the dead arc, one after the other
OFF_DEG = 0.5  # the truth, when `done` is said
MEDIAN_START_STOP = 2.0  # time over the least time of the motors, where the camera takes only start and stop
MEDIAN_POSITIONS = 1.3  # where it honours a position, absolute or relative, or a preset is within NEAR_DEG of the goal
COLD_MEDIAN_RELATIVE = 1.42  # not 1.3 where only one within the picture is
NEAR_DEG = 0.35  # in pan and in tilt: a preset so near is the end of a move, whatever its readings do
MEDIAN_BESIDE = 2.0  # of start and stop from a preset that is up to BESIDE_DEG beside the goal: a leg follows
BESIDE_DEG = 2.0
COMMANDS = 12  # for a goal, answers to login challenges not counted
CORRECTION = 3  # more at the very most of many times GOALS: two late answers in one move may cost one more leg
CALIBRATED_WITHIN_COMMANDS = 0.995  # of those
COLD_WITHIN_COMMANDS = 0.95  # of the goals at least; a first goal, or one with a late answer or two, takes more

SCAN_OVER_LEAST = 1.3  # a full scan (both picture modes, K = 8) over the least time of motors, frames and one switch
SCAN_QUICKER = 3.5  # than the report's scan of the same places
SIGHTING_SHARE = 0.25  # of the report's time until a target at a random place was seen
# Where a marker of 0.14 m is, 2 to 6 m away, from eight frames of one place: median and 95 in 100, mm.
EXACT_MM = (10.0, 30.0)  # with exact readings
NOISY_MM = (15.0, 45.0)  # with readings that are off by READ_NOISE_DEG (one standard deviation)
READ_NOISE_DEG = 0.1
MAGNIFICATION = 0.002  # share, median
FLIPPED = 0.02  # of the orientations that are said to be certain
INSIDE, INSIDE_BY = 0.90, 0.05  # of the errors in the 90 % ellipsoid
CALIBRATED_FOCAL = 0.005  # share by which a calibrated level's focal length is off at most
LENS = 0.005  # share by which a calibrated lens's focal lengths are off at most
MOUNT_M, MOUNT_DEG = 0.010, 0.3  # a calibrated mount, median, from five markers that were put a centimetre beside

# Markers in pictures.
RECALL = 0.985  # of the markers, for each side from SMALLEST_PX on, blur 1 and noise 5
SMALLEST_PX = 19
DARK_RECALL = 0.95  # of markers of 21 px in eight frames, grey levels 60 and 25, noise 6
CORNER_PX = 0.10  # mean error of a corner at 30 px
PER_MEGAPIXEL_MS = 35.0
PLACE_MS = 150.0  # eight frames of 2304x1296 with the target in them, on two cores
