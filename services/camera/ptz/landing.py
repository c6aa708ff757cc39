"""Where an axis that the firmware drives will rest, told by a look on the last part of its way. Pure.

A look tells of the moment when it was asked for and is answered a while later: asked for at rest it costs that time,
asked for while the camera brakes the camera rests when the answer comes. Where it will rest is then reckoned, from how
far off its course the look shows it: its last hop began beside where it should, or goes farther than it should (two
unknowns, one measurement: a Kalman filter's update). Not here: the looks and hops themselves (`hopping.py`), how far
off the end of a chain of hops may be (`scale.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot, sqrt
from typing import Literal, cast

from services.camera.device import Reading, Reply
from services.camera.ptz import scale, zoom_drive
from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.glide import Glide
from services.camera.ptz.goal import Limits, Pose
from services.camera.ptz.pace import HALF_CHANGE, READ_LATE, READ_PART
from services.camera.ptz.planes import Strays
from services.camera.ptz.scale import Hop
from services.camera.ptz.skill import NEAR_DEG, RelativeForm, Skill

# When to look.
LEFT_DEG = (3.0, 2.0, 1.5, 1.0, 0.7, 0.5, 0.3, 0.2, 0.1)  # of the way, the most that tells enough
EXPECTED_DOUBT_DEG = 0.15  # a look tells enough that should leave no more doubt than this
EXPECTED_NOISE_DEG = 0.4  # and whose own noise is no more
STAYS_DEG = 0.3  # an axis that should go farther has to be seen on its way
LATER = 0.1  # of the spread of answers: so much later, since a quick one is before its time

# What is known without a look, and how exact one is; standard deviations.
LEAST_DEG = 0.05  # of where hops lead
FARTHER, FARTHEST_DEG = 0.1, 0.5  # of its way: a hop may go so much farther than by all that is learnt; at most
BEFORE = 2.0  # of the doubt of where it began, not shown before it brakes: the hop before may not have ended
ENDED = 2.0  # deviations: when the hop ended whose place another one took
FAR = 2.0  # such deviations of the time: what rests by now need not have rested a moment before
READ_DEG = 0.06  # of a reading
LEAST_S = 0.004  # of the moment that a look tells of
STEP_DEG = 0.05  # of the goal: what it would change of a look
BENT = 0.05  # of how far off it is seen: the reckoning of its end may be wrong by so much

# What follows from it.
SURE = 1.75  # standard deviations that it may end farther off than is likeliest, to have arrived
MISSED = 1.25  # and nearer, for a hop to go on from there: one too many does little harm
OUTLIER = 2.0  # of them; a look farther off its course than that is of something else
ARRIVES_DEG = 0.45  # it ends at its goal if it ends so near at the worst: 0.5 is promised
RESTED_S = 0.02  # after it is reckoned to rest: what still moves then does not go as was reckoned
GO_ON_DEG = 0.25  # doubt of where it ends, up to which a hop goes on from there
TEACHES = 0.7  # of the doubt before it: a look that leaves less tells how far hops went

Verdict = Literal["there", "beside", "unsure"]


@dataclass(frozen=True)
class Doubts:
    """What is not known of an axis on its way, standard deviations.

    `goal`: how far its last hop goes, degrees; `place`: where that began, degrees, and then all of its way is beside;
    `read`: a reading, degrees; `time`: the moment that it tells of, seconds; `change`: its acceleration, a share;
    `start`: seconds that a hop in flight was sooner or later on its way. `share`: what experience left of all that.
    """

    goal: float
    place: float
    read: float
    time: float
    change: float
    start: float = 0.0
    share: float = 1.0

    @property
    def end(self) -> float:
        """Where it will rest, degrees."""
        return hypot(self.goal, self.place)


@dataclass(frozen=True)
class End:
    """Where an axis will rest, degrees.

    `doubt`: standard deviation of `at`, and `before`: what that was before the look; `seen`: where it will rest by the
    look alone, and `noise`: standard deviation of that; `odd`: the look is too far off for a motion as was reckoned;
    `familiar`: such motions mostly go as is reckoned.
    """

    at: float
    doubt: float
    before: float
    seen: float
    noise: float
    odd: bool = False


def doubts(skill: Skill, form: RelativeForm, hops: Sequence[Hop], place: float) -> tuple[Doubts, Doubts]:
    """Those of pan and tilt on the way of a chain of hops; `place`: of where it began, beside what the hops tell."""
    share = scale.strays(skill.scales[form], hops).share
    time = _time(skill, skill.timing.spread / 2, share)

    def of(axis: int) -> Doubts:
        goes, begins = scale.doubts(skill.scales[form], hops, axis)
        change = skill.paces[axis].other_doubt(HALF_CHANGE) / skill.paces[axis].other(HALF_CHANGE)
        goal = share * hypot(goes, _farther(hops[-1].ways[axis]))
        start = _start(skill, hops, axis, share * change, share * hops[-1].moment)
        began = hypot(share * begins, place)
        return Doubts(hypot(goal, LEAST_DEG), began, READ_DEG, time, share * change, start, share)

    return of(PAN), of(TILT)


def _start(skill: Skill, hops: Sequence[Hop], axis: int, change: float, moment: float) -> float:
    """How much sooner or later than is reckoned the last hop is where it should be, seconds.

    It may take longer itself, and the one whose place it took may not have ended when it acted; `change`: doubt of the
    acceleration, a share; `moment`: of when it acted, seconds.
    """
    before = ENDED * max(0.0, _lasts(skill, hops[-2], axis, change) - hops[-1].rested) if len(hops) > 1 else 0.0
    return hypot(before, _lasts(skill, hops[-1], axis, change), moment)


def _lasts(skill: Skill, hop: Hop, axis: int, change: float) -> float:
    """How much longer a hop may take, or less: by its acceleration, and by its top speed as long as it has that."""
    pace, way, top = skill.paces[axis], abs(hop.ways[axis]), hop.tops[axis]
    fast = max(0.0, way / top - top * pace.slow)
    return hypot(change * min(top * pace.slow, sqrt(way * pace.slow)), fast * pace.doubt(pace.speeds[-1]) / top)


def stray(strays: Strays, glides: Sequence[Glide], known: Sequence[Doubts], told: Sequence[End]) -> None:
    """Takes in how far off a look shows pan and tilt, over how far they might be: so experience leaves less doubt."""
    for glide, doubts, end in zip(glides, known, told, strict=False):
        noise = hypot(doubts.read, sqrt(max(0.0, end.noise**2 - doubts.read**2)) / doubts.share)
        strays.add((end.seen - glide.goal) / hypot(end.before / doubts.share, noise))


def _time(skill: Skill, late: float, share: float) -> float:
    """Doubt of the moment that a look tells of which is answered so much later than usual, or sooner."""
    reads = skill.paces[PAN]
    return hypot(share * reads.other_doubt(READ_LATE), share * reads.other_doubt(READ_PART) * late, LEAST_S)


def sight(skill: Skill, glides: Sequence[Glide], known: Sequence[Doubts]) -> float | None:
    """When to ask for a look that tells where pan and tilt will rest, the earliest; None: no look would."""
    turning = glides[:ZOOM]
    zoomed = glides[ZOOM].within(zoom_drive.unread(skill, glides[ZOOM]))
    for left in LEFT_DEG:
        when = max(zoomed, *(glide.within(left) for glide in turning))
        told = [foretell(glide, when, glide.at(when)[0], known[axis]) for axis, glide in enumerate(turning)]
        enough = all(end.doubt <= EXPECTED_DOUBT_DEG and end.noise <= EXPECTED_NOISE_DEG for end in told)
        if enough and all(_shows_moving(glide, when, known[axis]) for axis, glide in enumerate(turning)):
            return when - skill.read_late + LATER * skill.timing.spread
    return None


def _shows_moving(glide: Glide, when: float, known: Doubts) -> bool:
    """Whether a look at a time would show if it stayed where it was, so far from its goal that it matters."""
    return abs(glide.goal - glide.place) <= STAYS_DEG or foretell(glide, when, glide.place, known).odd


def foretell(glide: Glide, seen: float, place: float, known: Doubts) -> End:
    """The end of a glide that was seen at a place, at a time: the likeliest, by where it began and how far it goes."""
    reckoned, shown = glide.at(seen)[0], _shown(glide, seen)
    moved = glide.at(seen - FAR * hypot(known.time, known.start))[0] - reckoned
    bends = known.change * (glide.goal - reckoned)
    hidden = (1.0 - shown) * BEFORE * known.share * known.place
    noise, wrong = hypot(known.read, moved / FAR, bends, hidden), place - reckoned
    spread = hypot(known.place, shown * known.goal, noise)
    tells = (known.place**2 + shown * known.goal**2) / spread
    doubt = hypot(sqrt(max(0.0, known.end**2 - tells**2)), BENT * wrong)
    at, seen_at = glide.goal + tells / spread * wrong, glide.goal + wrong
    unseen = (1.0 - shown) * _farther(glide.goal - glide.place)  # whatever experience says
    alone, odd = hypot(noise, (1.0 - shown) * known.goal, unseen), abs(wrong) > OUTLIER * spread
    return End(at, doubt, known.end, seen_at, alone, odd)


def _farther(way: float) -> float:
    """How much farther than its way a hop may go, degrees: now and then one does after many exact ones."""
    return min(FARTHEST_DEG, FARTHER * abs(way))


def _shown(glide: Glide, seen: float) -> float:
    """How much of a change of its goal a look at a time shows: nothing before it brakes, all of it at rest."""
    other = replace(glide, goal=glide.goal + (STEP_DEG if glide.goal >= glide.at(seen)[0] else -STEP_DEG))
    return min(1.0, abs(other.at(seen)[0] - glide.at(seen)[0]) / STEP_DEG)


def late(known: Sequence[Doubts]) -> float:
    """How much later than is reckoned pan and tilt may rest, seconds: what experience left of it is not counted on."""
    return max(one.start / one.share for one in known)


def read(place: float, known: Doubts) -> End:
    """The end of an axis that was read at rest."""
    return End(place, known.read, known.end, place, known.read)


def ends(skill: Skill, glides: Sequence[Glide], known: Sequence[Doubts], reply: Reply, pose: Pose) -> list[End]:
    """The ends of pan and tilt by the answer to a look that reads `pose`; odd where it rests too soon, or too late."""
    late = skill.timing.late(reply)
    seen = skill.paces[PAN].seen_at(reply.sent, late)
    known = [replace(one, time=_time(skill, late, one.share)) for one in known]
    moving, over = cast(Reading, reply.result).moving, seen - max(glide.ends for glide in glides)
    if skill.tells_rest(moving) and over >= 0.0:
        return [read(pose[axis], known[axis]) for axis in (PAN, TILT)]
    told = [foretell(glides[axis], seen, pose[axis], known[axis]) for axis in (PAN, TILT)]
    odd = skill.tells_rest(moving) or (skill.tells_motion(moving) and over > RESTED_S)
    return [replace(end, odd=end.odd or odd) for end in told]


def judge(aim: Pose, near: float, told: Sequence[End]) -> Verdict:
    """Whether pan and tilt will surely rest at the goal, or surely beside it, farther off than `near`."""
    off = [abs(aim[axis] - end.at) for axis, end in enumerate(told)]
    most = max(one + SURE * end.doubt for one, end in zip(off, told, strict=True))
    least = max(one - MISSED * end.doubt for one, end in zip(off, told, strict=True))
    if any(end.odd for end in told):
        return "unsure"
    if most <= ARRIVES_DEG and all(_shows(aim[axis], end) for axis, end in enumerate(told)):
        return "there"
    if least > near and all(end.doubt < GO_ON_DEG for end in told):
        return "beside"
    return "unsure"


def _shows(aim: float, end: End) -> bool:
    """Whether the look by itself speaks for an end at the goal."""
    return abs(aim - end.seen) <= max(NEAR_DEG, end.noise)


def learn(
    skill: Skill,
    form: RelativeForm,
    hops: Sequence[Hop],
    glides: Sequence[Glide],
    limits: Limits,
    reading: Reading,
    told: Sequence[End],
) -> None:
    """What is foretold teaches, too, where the look tells how far hops went, and not only that it went as reckoned."""
    pan, tilt, zoom = (glide.goal for glide in glides)
    if all(end.doubt < TEACHES * end.before for end in told):
        there = replace(reading, pan=told[PAN].seen, tilt=told[TILT].seen)
        noise = max(scale.READ_DEG, *(end.noise for end in told))
        scale.learn(skill, form, hops, (pan, tilt, zoom), limits, there, noise)
    else:
        skill.lead_zoom(reading.zoom, zoom)


def at_end(reading: Reading, told: Sequence[End]) -> Reading:
    """The reading as it will be at rest; whether it moves then nobody has told."""
    return replace(reading, pan=round(told[PAN].at % 360.0, 2), tilt=round(told[TILT].at, 2), moving=None)
