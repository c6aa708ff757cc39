"""How large the scale of the relative form is: the tangent of its end, a point of the picture's plane. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan, degrees, exp, hypot, log, radians, tan

from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.goal import Limits, Pose
from services.camera.ptz.skill import Skill
from services.camera.requests import Reading

FORM = "Position"
ZOOMS = "Position zoom"  # whether a hop takes zoom along
PLANE_TAN = (1.0, 0.56)  # of the whole scale at the widest zoom, a guess to begin with
STAYED_DEG = 0.3
LEVEL = 1.0  # zoom is read in coarse steps
LEAST_DEG, MOST_DEG = 3.0, 80.0  # hops that tell about the scale
READ_DEG, TIME_S, ZOOM_DOUBT = 0.15, 0.02, 0.05  # of a reading; when a hop took effect; of a level's magnification
DOUBT, LEVEL_DOUBT, FIRST_DOUBT = 0.015, 0.06, 0.5  # about the scale; at a level, or at all, before any was seen


@dataclass(frozen=True)
class Hop:
    """Where one began, how far it should go, and how fast each axis was then; degrees, levels."""

    begun: Pose
    ways: Pose
    speeds: Pose


def plane(zoom: float, skill: Skill) -> tuple[float, float]:
    """The tangents of the whole scale at a zoom: from what was seen at the nearest, or a guess."""
    known = min(skill.planes, key=lambda other: abs(other - zoom), default=None)
    pan, tilt = PLANE_TAN if known is None else skill.planes[known]
    grown = larger(known or 0.0) / larger(zoom)
    return pan * grown, tilt * grown


def larger(zoom: float) -> float:
    """How much the picture grows with zoom, about."""
    return 1.0 + zoom / 4.0


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
    for axis in (PAN, TILT):
        _learn(skill, axis, _telling(hops, axis), there[axis] - to[axis], limits)


def _telling(hops: Sequence[Hop], axis: int) -> Hop:
    """The longest of those that led there: a hop that another one followed in flight did not."""
    led = [hops[-1]]
    for hop in hops[-2::-1]:
        if any(led[-1].speeds[:ZOOM]):
            break
        led.append(hop)
    return max(led, key=lambda hop: abs(hop.ways[axis]))


def _learn(skill: Skill, axis: int, hop: Hop, wrong: float, limits: Limits) -> None:
    """It ended so far from where it should: by the scale, or by when it took effect, as far as each is in doubt."""
    way = hop.ways[axis]
    moved = abs(way) + (wrong if way > 0 else -wrong)
    if hop.speeds[ZOOM] or abs(way) < LEAST_DEG or not 1.0 < moved < MOST_DEG:
        return
    noise = (READ_DEG + TIME_S * abs(hop.speeds[axis])) / abs(way)
    noise += 0.0 if hop.begun[ZOOM] in limits.zoom else ZOOM_DOUBT
    level = float(round(hop.begun[ZOOM]))
    doubt = DOUBT if level in skill.planes else LEVEL_DOUBT if skill.planes else FIRST_DOUBT
    known = list(plane(hop.begun[ZOOM], skill))
    grown = log(tan(radians(moved)) / tan(radians(abs(way))))
    most = 2 * hypot(doubt, noise)
    known[axis] *= exp(min(most, max(-most, grown)) * doubt**2 / (doubt**2 + noise**2))
    there = larger(hop.begun[ZOOM]) / larger(level)
    skill.planes[level] = (known[PAN] * there, known[TILT] * there)
