"""What hops by the relative form teach: of its scale, and of the motor that turned before. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np

from services.camera.device import Reading
from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.goal import EDGE_DEG, Limits, Pose
from services.camera.ptz.pace import HALF_CHANGE, Pace, Seen, Told, Vector
from services.camera.ptz.planes import Planes, Scale, Strays
from services.camera.ptz.skill import LEVEL, RelativeForm, Skill

STAYED_DEG = 0.3
FAR_DEG = 3.0  # a shorter way is no measure for how far off it ended
OFF_COUNTS, OFF_MOST = 0.2, 0.25  # of a way: what each chain of hops adds to what is usual, and how far off is too far
READ_DEG, TIME_S = 0.08, 0.003  # of a reading; when a hop took effect that was answered as usual
LEVELS = 0.5  # where zoom is while it turns, beside the doubt of its rate
ZOOMED = 0.4  # of the doubt about where zoom was, for what a hop tells of the scale
KNOWN = 0.08  # of zoom's rate: as well known as that, it is told more exactly by where hops led
ROUGHLY = 0.2  # of a rate
TIMED = 0.5  # of the time that an axis takes to slow down: with less doubt it is known when it rests
FLIES_DEG_S = 2.0  # a hop that begins so fast does so in flight
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
    """Where one began, by which parts and how far it should go, how fast each axis was then, and can be.

    `parts` as the readings count, of pan and tilt; the others in degrees and levels. `turned`: what pan and tilt did
    before, where the hop is the first one; `rested`: how many seconds they had, where another one was before. `zoomed`:
    for so many seconds zoom had been on its way, with the sign of that, 0 at rest; `unsure`: levels that leaves open.
    `moment`: doubt of when it took effect, seconds.
    """

    begun: Pose
    parts: tuple[float, float]
    ways: Pose
    speeds: Pose
    tops: Pose
    turned: tuple[Turned, Turned] | None
    rested: float
    zoomed: float = 0.0
    unsure: float = 0.0
    moment: float = TIME_S


def zooms(form: RelativeForm) -> str:
    """What is honoured where its hops take zoom along."""
    return f"{form} zoom"


def learn(
    skill: Skill,
    form: RelativeForm,
    hops: Sequence[Hop],
    to: Pose,
    limits: Limits,
    reading: Reading,
    read: float = READ_DEG,
) -> None:
    """Where a chain of hops led: whether the form is honoured, with zoom or without, and how large its scale is.

    `read`: standard deviation of the reading, degrees.
    """
    there = limits.pose(reading)
    if skill.honours.get(form) != "yes":
        moved = max(abs(there[axis] - hops[0].begun[axis]) for axis in (PAN, TILT))
        skill.honours[form] = "no" if moved < STAYED_DEG < max(map(abs, hops[0].ways[:ZOOM])) else "yes"
    if zooms(form) not in skill.honours:
        _see_zoom(skill, form, hops[0].begun[ZOOM], to[ZOOM], reading.zoom)
    skill.lead_zoom(reading.zoom, to[ZOOM])
    if skill.honours[form] == "yes":
        wrong = (there[PAN] - to[PAN], there[TILT] - to[TILT])
        _weigh(skill, form, hops, to, wrong, read)
        for axis in (PAN, TILT):
            low, high = limits.ranges[axis]
            if low + EDGE_DEG < there[axis] < high - EDGE_DEG:
                _learn(skill, form, axis, hops, wrong[axis], read)


def _see_zoom(skill: Skill, form: RelativeForm, begun: float, to: float, reading: float) -> None:
    """Whether hops take zoom along, where its coarse readings, of before and of now, tell."""
    asked, came, left = abs(to - begun), abs(reading - begun), abs(reading - to)
    if asked >= 2 * LEVEL and left < came:
        skill.honours[zooms(form)] = "yes"
    elif asked > 3 * LEVEL and came <= LEVEL:
        skill.honours[zooms(form)] = "no"


def strays(scale: Scale, hops: Sequence[Hop]) -> Strays:
    """What experience tells of a chain, by how its last hop began."""
    flies = max(map(abs, hops[-1].speeds[:ZOOM])) > FLIES_DEG_S
    return scale.flying if flies else scale.rested


def unsure(scale: Scale, hops: Sequence[Hop]) -> float:
    """How far from where it should the end of a chain may be, degrees: one standard deviation."""
    return max(hypot(*doubts(scale, hops, axis)) for axis in (PAN, TILT))


def timed(skill: Skill, hops: Sequence[Hop]) -> bool:
    """Whether it was known when a hop that another one followed had ended."""
    known = all(pace.other_doubt(HALF_CHANGE) < TIMED * pace.other(HALF_CHANGE) for pace in skill.paces[:ZOOM])
    return known or len(hops) == 1


def doubts(scale: Scale, hops: Sequence[Hop], axis: int) -> tuple[float, float]:
    """Standard deviations of a chain, degrees: of how far its last hop goes, and of where that begins."""
    whole, last = (_told(scale.planes, axis, chain, 0.0) for chain in (hops, hops[-1:]))
    moment = hops[-1].moment * hops[-1].speeds[axis]
    goes = sqrt(max(0.0, last.doubt**2 + last.noise**2 + last.zoomed**2 - moment**2))
    end = hypot(whole.doubt, whole.noise, whole.zoomed, whole.before)
    return goes, sqrt(max(0.0, end**2 - goes**2))


def _weigh(
    skill: Skill, form: RelativeForm, hops: Sequence[Hop], to: Pose, wrong: tuple[float, float], read: float
) -> None:
    """A form whose hops go on ending where no law would is given up: its parts mean something else."""
    scale, axes = skill.scales[form], (PAN, TILT)
    way = max(abs(to[axis] - hops[0].begun[axis]) for axis in axes)
    off = min(max(_told(law, axis, hops, read).off(wrong[axis]) for axis in axes) for law in scale.laws)
    scale.off += OFF_COUNTS * (min(1.0, off / max(FAR_DEG, way)) - scale.off)
    if scale.off > OFF_MOST:
        skill.honours[form] = "no"


def _learn(skill: Skill, form: RelativeForm, axis: int, hops: Sequence[Hop], wrong: float, read: float) -> None:
    """It ended so far from where it should: by the scale, or by where the first hop began."""
    believed = skill.scales[form].planes
    turned = hops[0].turned
    for planes in skill.scales[form].laws:
        planes.age()
        told = _told(planes, axis, hops, read)
        planes.learn(told.slope, wrong - told.beside, hypot(told.noise, told.before, ZOOMED * told.zoomed))
        pace = skill.paces[axis]
        if planes is believed and turned is not None and _roughly(pace, turned[axis].told):
            travel = hops[0].begun[axis] + wrong - turned[axis].origin
            noise = ALIKE * hypot(told.noise, told.doubt, told.zoomed)
            seen = Seen(turned[axis].answered, turned[axis].late, travel, noise, acts=True)
            pace.learn(turned[axis].told, seen)
        drive = skill.drive(ZOOM)
        if planes is believed and told.zoom and drive.doubt(1) < KNOWN * drive.rate(1):
            noise = ALIKE * hypot(told.noise, told.doubt, told.before)
            drive.correct(1, told.zoom, wrong - told.beside, noise)


def _roughly(pace: Pace, told: Sequence[Told]) -> bool:
    """Whether it was told to turn, with speeds that are known roughly: more is not learnt of them by where hops led."""
    speeds = {abs(one.level) for one in told if one.level}
    return bool(speeds) and all(pace.doubt(speed) < ROUGHLY * pace.rate(speed) for speed in speeds)


@dataclass(frozen=True)
class _Told:
    """What the end of a chain tells of a law: how that changes with the law's numbers, and its noise.

    `doubt`: that of the law; `before`: that of where the first hop began, which is left in it whatever came then;
    `beside`: how far from what was believed the law would have ended. `zoom`: how it changes with zoom's rate, and
    `zoomed`: what the doubt about where zoom was then makes of it.
    """

    slope: Vector
    doubt: float
    noise: float
    before: float
    beside: float
    zoom: float
    zoomed: float

    def off(self, wrong: float) -> float:
        """How far off the law, where what was believed was wrong by so much; degrees that no doubt explains."""
        return max(0.0, abs(wrong - self.beside) - self.before - ALIKE * self.doubt)


def _told(planes: Planes, axis: int, hops: Sequence[Hop], read: float) -> _Told:
    slope, noise, share, counts, beside = np.zeros_like(planes.mean), read, 1.0, 1.0, 0.0
    zoom = zoomed = 0.0
    for hop in reversed(hops):
        share = counts
        way = planes.angle(axis, hop.parts[axis], hop.begun[ZOOM])
        bends = share * planes.bends(way)
        beside += share * (way - hop.ways[axis])
        slope += bends * planes.weights(axis, hop.begun[ZOOM])
        noise = hypot(noise, share * hop.moment * hop.speeds[axis])
        if hop.speeds[ZOOM]:
            grows = bends * planes.growth(hop.begun[ZOOM])
            noise = hypot(noise, LEVELS * grows)
            zoom, zoomed = zoom - hop.zoomed * grows, zoomed + hop.unsure * grows
        counts *= max(0.0, 1.0 - abs(hop.speeds[axis]) / hop.tops[axis])  # in full flight it matters not where to
    before = 0.0 if hops[0].turned is None else ALIKE * hops[0].turned[axis].doubt
    return _Told(slope, planes.doubt(slope), noise, before, beside, zoom, abs(zoomed))
