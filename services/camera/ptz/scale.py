"""What hops by the relative form teach: of its scale, and of the motor that turned before. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan, degrees, hypot, radians, sin

import numpy as np

from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.goal import EDGE_DEG, Limits, Pose
from services.camera.ptz.pace import Seen, Told
from services.camera.ptz.planes import growth
from services.camera.ptz.skill import Skill
from services.camera.requests import Reading

FORM = "Position"
ZOOMS = "Position zoom"  # whether a hop takes zoom along
STAYED_DEG = 0.3
FAR_DEG = 3.0  # a shorter way is no measure for how far off it ended
OFF_COUNTS, OFF_MOST = 0.2, 0.25  # of a way: what each chain of hops adds to what is usual, and how far off is too far
LEVEL = 1.0  # zoom is read in coarse steps
READ_DEG, TIME_S = 0.1, 0.003  # of a reading; when a hop took effect
LEVELS = 0.5  # where zoom is while it turns
SHARE = 0.8  # of the way that the first hop of a chain went; less tells little of the motor before it
ALIKE = 2.0  # what each of two takes from one reading, the other took too: so often more doubt is left to both


@dataclass(frozen=True)
class Turned:
    """How an axis was told to turn before a hop: from where, how far its place was in doubt, when that was over."""

    told: tuple[Told, ...]
    origin: float
    doubt: float
    answered: float
    late: float  # how much later than usual it was answered


@dataclass(frozen=True)
class Hop:
    """Where one began, how far it should go, how fast each axis was then, and can be; degrees, levels.

    `turned`: what pan and tilt did before, where the hop is the first one.
    """

    begun: Pose
    ways: Pose
    speeds: Pose
    tops: Pose
    turned: tuple[Turned, Turned] | None


def angle(part: float, whole: float) -> float:
    """How far a part of the scale goes, degrees."""
    return degrees(atan(part * whole))


def learn(skill: Skill, hops: Sequence[Hop], to: Pose, limits: Limits, reading: Reading) -> None:
    """Where a chain of hops led: whether the form is honoured, with zoom or without, and how large its scale is."""
    there = limits.pose(reading)
    if skill.honours.get(FORM) != "yes":
        moved = max(abs(there[axis] - hops[0].begun[axis]) for axis in (PAN, TILT))
        skill.honours[FORM] = "no" if moved < STAYED_DEG < max(map(abs, hops[0].ways[:ZOOM])) else "yes"
    zoomed = abs(reading.zoom - to[ZOOM]) <= LEVEL
    if ZOOMS not in skill.honours and max(abs(hop.ways[ZOOM]) for hop in hops) >= LEVEL:
        skill.honours[ZOOMS] = "yes" if zoomed else "no"
    skill.zoomed = (reading.zoom, to[ZOOM]) if zoomed else None
    if skill.honours[FORM] == "yes":
        _weigh(skill, hops, to, there)
        for axis in (PAN, TILT):
            low, high = limits.ranges[axis]
            if low + EDGE_DEG < there[axis] < high - EDGE_DEG:
                _learn(skill, axis, hops, there[axis] - to[axis])


def _weigh(skill: Skill, hops: Sequence[Hop], to: Pose, there: Pose) -> None:
    """A form whose hops go on ending elsewhere means something else by its parts: it is given up."""
    way = max(abs(to[axis] - hops[0].begun[axis]) for axis in (PAN, TILT))
    off = max(abs(there[axis] - to[axis]) for axis in (PAN, TILT))
    skill.hops_off += OFF_COUNTS * (min(1.0, off / max(FAR_DEG, way)) - skill.hops_off)
    if skill.hops_off > OFF_MOST:
        skill.honours[FORM] = "no"


def _learn(skill: Skill, axis: int, hops: Sequence[Hop], wrong: float) -> None:
    """It ended so far from where it should: by the scale, or by where the first hop began."""
    skill.planes.age()
    slope, noise, share, counts = np.zeros_like(skill.planes.mean), READ_DEG, 1.0, 1.0
    for hop in reversed(hops):
        share = counts
        bends = share * degrees(sin(2 * radians(hop.ways[axis]))) / 2  # degrees, for a change of the logarithm by 1
        slope += bends * skill.planes.weights(axis, hop.begun[ZOOM])
        noise = hypot(noise, share * TIME_S * hop.speeds[axis])
        if hop.speeds[ZOOM]:
            noise = hypot(noise, bends * LEVELS * growth(hop.begun[ZOOM]))
        counts *= max(0.0, 1.0 - abs(hop.speeds[axis]) / hop.tops[axis])  # in full flight it matters not where to
    turned, scale = hops[0].turned, skill.planes.doubt(slope)
    if turned is None:
        skill.planes.learn(slope, wrong, noise)
        return
    skill.planes.learn(slope, wrong, hypot(noise, ALIKE * share * turned[axis].doubt))
    if turned[axis].told and share > SHARE:
        travel = hops[0].begun[axis] + wrong / share - turned[axis].origin
        seen = Seen(turned[axis].answered, turned[axis].late, travel, ALIKE * hypot(noise, scale) / share, acts=True)
        skill.paces[axis].learn(turned[axis].told, seen)
