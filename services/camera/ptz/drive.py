"""Moves that the camera's firmware makes itself: to a position, to a stored preset, or on by a part of its scale.

Which of them it honours is found out by trying once in the course of a move, and reading back where that led: some
firmware refuses, some ignores tilt, some is two degrees off. It drives all axes at once and ends by itself, without
a late stop. Pure. Who decides when to use it is `move.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from services.camera.device import GotoPreset, MoveTo, Reply
from services.camera.ptz import zoom_drive
from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.glide import Glide
from services.camera.ptz.goal import Limits, Pose
from services.camera.ptz.pace import Seen, Told
from services.camera.ptz.skill import Skill

ABSOLUTE: tuple[Literal["PositionABS", "moveAbsolutely"], ...] = ("PositionABS", "moveAbsolutely")
PRESET_DEG = 2.0  # a preset as near to the goal as that is worth going to
PRESET_LEVELS = 0.5
BESIDE_DEG = 6.0  # farther from what was asked for, it was not honoured
LEAST_DEG = 0.3
NOISE_DEG, NOISE_S = 0.2, 0.03  # of a reading on the way
REST: Pose = (0.0, 0.0, 0.0)
WITHIN_DEG = 0.1  # what is asked for stays so far from an end stop


@dataclass(frozen=True)
class Drive:
    """One such move: what to send, and where that should lead."""

    request: MoveTo | GotoPreset
    to: Pose


@dataclass(frozen=True)
class Begun:
    """One under way: from where, and the answer that it began with.

    `speeds`: how fast pan, tilt and zoom turned then; `ended`: tilt does not go there, but was ended by it and rests
    from then on; 0: it does.
    """

    drive: Drive
    here: Pose
    reply: Reply
    speeds: Pose = REST
    ended: float = 0.0

    def ways(self, skill: Skill) -> tuple[Glide, Glide, Glide]:
        """Of pan, tilt and zoom, as far as is known by now."""
        return ways(skill, self.here, self.drive.to, self.reply.received, self.speeds)

    def arrives(self, skill: Skill) -> float:
        """When it should be there, as far as is known by now."""
        return max(self.ended, *(glide.ends for glide in self.ways(skill)))

    def nears(self, skill: Skill, left: float) -> float:
        """When no more than so many degrees of pan and tilt should be left, and of zoom what a look may leave open."""
        pan, tilt, zoom = self.ways(skill)
        zoomed = zoom.within(zoom_drive.unread(skill, zoom) if left else 0.0)
        return max(self.ended, pan.within(left), tilt.within(left), zoomed)

    def look(self, skill: Skill, reply: Reply, seen: Pose) -> None:
        """What a look tells of its speed, on the axes that do not slow down yet; `seen`: its reading as a pose."""
        timing = skill.timing
        for axis in (PAN, TILT):
            pace, way = skill.drive(axis), self.drive.to[axis] - self.here[axis]
            travel = (seen[axis] - self.here[axis]) * (1 if way > 0 else -1)
            braking = pace.braking(pace.rate(1))
            if LEAST_DEG < travel < abs(way) - 1.5 * braking - 3.0:
                told = [Told(self.reply.received, timing.late(self.reply), 1)]
                pace.learn(told, Seen(reply.sent, timing.late(reply), travel, NOISE_DEG + NOISE_S * pace.rate(1)))
                pace.age()
        zoom_drive.see(skill, self.ways(skill)[ZOOM], reply)


def find(
    pose: Pose, aim: Pose, limits: Limits, skill: Skill, presets: Mapping[int, tuple[float, float, float]]
) -> Drive | None:
    """The firmware's own move to there, or near; None when it has none, or none is worth it.

    It may be asked for the very end of zoom's range, which is the one place where a digital zoom is exact.
    """
    exact = any(skill.honours.get(form) == "yes" for form in ABSOLUTE)
    near = None if exact else _preset(pose, aim, limits, {**presets, **skill.presets})
    return near or _absolute(aim, limits, skill)


def _absolute(aim: Pose, limits: Limits, skill: Skill) -> Drive | None:
    for form in ABSOLUTE:
        if skill.honours.get(form, "unknown") in ("unknown", "yes"):
            pan, tilt = skill.beside.get(form, (0.0, 0.0))
            wanted = [
                min(high - WITHIN_DEG, max(low + WITHIN_DEG, aim[axis] - off))
                for axis, off, (low, high) in zip((PAN, TILT), (pan, tilt), limits.ranges, strict=False)
            ]
            to = (wanted[PAN] + pan, wanted[TILT] + tilt, aim[ZOOM])
            return Drive(MoveTo(wanted[PAN] % 360.0, wanted[TILT], aim[ZOOM], form), to)
    return None


def _preset(pose: Pose, aim: Pose, limits: Limits, presets: Mapping[int, tuple[float, float, float]]) -> Drive | None:
    far = max(abs(aim[axis] - pose[axis]) for axis in (PAN, TILT))
    for number, place in presets.items():
        there = (limits.unwrap(place[PAN]), place[TILT], place[ZOOM])
        off = max(abs(there[axis] - aim[axis]) for axis in (PAN, TILT))
        if off <= PRESET_DEG and far > 2 * PRESET_DEG and abs(there[ZOOM] - aim[ZOOM]) <= PRESET_LEVELS:
            return Drive(GotoPreset(number), there)
    return None


def ways(skill: Skill, here: Pose, there: Pose, began: float, speeds: Pose = REST) -> tuple[Glide, Glide, Glide]:
    """How the firmware drives all axes there, from the speeds that they have."""

    def of(axis: int) -> Glide:
        pace = skill.drive(axis)
        acceleration = pace.rate(1) / pace.change(1)
        return Glide(began, here[axis], speeds[axis], there[axis], pace.rate(1), acceleration, began)

    return of(PAN), of(TILT), of(ZOOM)


def longest(skill: Skill, here: Pose, there: Pose) -> float:
    """How long the firmware needs for all axes, from rest to rest, seconds."""
    return max(glide.ends for glide in ways(skill, here, there, 0.0))


def judge(skill: Skill, here: Pose, drive: Drive, there: Pose) -> None:
    """Where it led: whether the firmware honours this, and how far off it is."""
    match drive.request:
        case GotoPreset(number):
            skill.presets[number] = (there[PAN] % 360.0, there[TILT], there[ZOOM])
        case MoveTo():
            _judge_to(skill, here, drive, drive.request, there)


def _judge_to(skill: Skill, here: Pose, drive: Drive, request: MoveTo, there: Pose) -> None:
    """A first one that asked for hardly any tilt, and stayed there, does not tell whether that is honoured."""
    off = tuple(there[axis] - drive.to[axis] for axis in (PAN, TILT))
    proven, asked = skill.honours.get(request.form) == "yes", abs(drive.to[TILT] - here[TILT])
    stayed = abs(there[TILT] - here[TILT]) < LEAST_DEG / 2
    if max(map(abs, off)) > BESIDE_DEG or (asked > LEAST_DEG and stayed):
        tilt_ignored = abs(off[PAN]) <= BESIDE_DEG and abs(there[TILT] - here[TILT]) < LEAST_DEG
        skill.honours[request.form] = "pan" if tilt_ignored else "no"
    elif proven or not stayed:
        before = skill.beside.get(request.form, (0.0, 0.0))
        skill.honours[request.form] = "yes"
        skill.beside[request.form] = (before[PAN] + off[PAN], before[TILT] + off[TILT])


def refuse(skill: Skill, drive: Drive) -> None:
    """The firmware said no; a preset may be there another time."""
    if isinstance(drive.request, MoveTo):
        skill.honours[drive.request.form] = "no"


def certain(skill: Skill, drive: Drive) -> bool:
    """Whether it is known where this leads, from experience or, of a preset, from the place that has it."""
    match drive.request:
        case GotoPreset():
            return True
        case MoveTo(form=form):
            return skill.honours.get(form) == "yes"
    return False


def honoured(skill: Skill, drive: Drive) -> bool:
    """Whether this was tried before, and worked."""
    if isinstance(drive.request, GotoPreset):
        return drive.request.number in skill.presets
    return skill.honours.get(drive.request.form) == "yes"


def pan_only(skill: Skill) -> bool:
    """Whether the firmware takes a position, but ignores its tilt."""
    return "pan" in skill.honours.values() and "yes" not in skill.honours.values()


def forget_pan_only(skill: Skill) -> None:
    """A position led tilt after all, so where it once stayed it only was where that led: positions are tried anew."""
    skill.honours = {form: honours for form, honours in skill.honours.items() if honours != "pan"}


def to_pan(here: Pose, to: Pose) -> MoveTo:
    """To a pan and a zoom, on such firmware."""
    return MoveTo(to[PAN] % 360.0, round(here[TILT], 1), to[ZOOM], "PositionABS")
