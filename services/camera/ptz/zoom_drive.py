"""Zoom that the firmware drives by itself: its way from rest, what looks show of that, and when it rests.

It is read in coarse steps: a reading tells of it at the edge of a step only, and hardly of its speed. Pure.
"""

from __future__ import annotations

from dataclasses import replace
from math import hypot, inf
from typing import cast

from services.camera.device import Reading, Reply
from services.camera.ptz.course import PAN, ZOOM
from services.camera.ptz.glide import Glide
from services.camera.ptz.pace import READ_LATE, READ_PART, Seen, Told
from services.camera.ptz.skill import Skill

SLOWER = 0.003  # of what fits all looks lasts longer than is waited for
LATER, LATER_S = 1.5, 0.01  # standard deviations of the moment that its looks told of; at most
SURE = 0.4  # of its rate may be in doubt
UNREAD_LEVELS = 0.6  # where it is told in coarse steps
AHEAD_LEVELS, KNOWN = 1.4, 0.03  # where it is known how fast it is: so that no more of its rate is in doubt
EDGE_LEVELS = 0.15  # of where a step of its reading begins, on the way
NOISE_LEVELS = 0.5  # of where it was on its way, at the edge of a step of its reading


def unread(skill: Skill, glide: Glide) -> float:
    """So much of its way, at most, may be left where a look tells that it gets there, levels."""
    if not skill.zoom_grid:
        return 0.0
    left = min(AHEAD_LEVELS, abs(glide.goal - glide.place) - skill.zoom_grid / 2 - 2 * EDGE_LEVELS)
    return max(UNREAD_LEVELS, left if _known(skill) else 0.0)


def comes(skill: Skill, glide: Glide, reading: Reading, when: float) -> bool:
    """Whether a look at a time shows it on its last bit of way, where it is reckoned; it has left where it began."""
    place, _ = glide.at(when)
    step = skill.zoom_grid / 2 + EDGE_LEVELS
    turns = when < glide.ends and not skill.tells_rest(reading.moving)
    last = abs(glide.goal - place) <= skill.zoom_grid
    shown = abs(reading.zoom - place) <= step <= abs(reading.zoom - glide.place)
    return turns and last and shown and _known(skill)


def at_end(skill: Skill, glide: Glide, reading: Reading) -> Reading:
    """The reading as it will be when zoom rests; whether anything moves then nobody has told."""
    return replace(reading, zoom=round(glide.goal / skill.zoom_step) * skill.zoom_step, moving=None)


def _known(skill: Skill) -> bool:
    return skill.zoom_rate.known()[1] <= KNOWN


def see(skill: Skill, glide: Glide, reply: Reply) -> None:
    """What a look shows of it on its way from rest: its speed, or where it has arrived, that it is no slower."""
    pace, way = skill.drive(ZOOM), abs(glide.goal - glide.place)
    seen = abs(cast(Reading, reply.result).zoom - glide.place)
    half = skill.zoom_step / 2
    if way <= half or glide.began >= reply.sent:
        return
    reads, late = skill.paces[PAN], skill.timing.late(reply)
    seconds = reads.seen_at(reply.sent, late) - glide.began
    doubt = hypot(reads.other_doubt(READ_LATE), reads.other_doubt(READ_PART) * late)
    if seconds > 0:
        skill.zoom_rate.see(seconds, seen - half if seen else -inf, seen + half if seen < way else inf, doubt)
    pace.borrow(reads)
    told = [Told(glide.began, 0.0, 1)]
    low, high = seen - half, inf if seen > way - half - NOISE_LEVELS else seen + half
    shown = Seen(reply.sent, late, seen, NOISE_LEVELS)
    expected, _ = pace.expected(told, shown)
    if not low <= expected <= high:
        pace.learn(told, shown._replace(travel=min(high, max(low, expected))))
        pace.age()


def sure(skill: Skill, glide: Glide, now: float) -> bool:
    """Whether nobody needs to look whether it rests: that is over, or it is known well enough how fast it is."""
    return skill.zoom_rate.known()[1] < SURE or rests(skill, glide) <= now


def rests(skill: Skill, glide: Glide) -> float:
    """When it rests at the latest, as far as its speed is known by now; it began at the latest when that was answered.

    All looks may have told of a later moment than is thought: then it takes twice as much longer to get to its speed.
    """
    way, later = abs(glide.goal - glide.place), 2 * LATER * min(LATER_S, skill.paces[PAN].other_doubt(READ_LATE))
    return max(glide.began, glide.answered) + skill.zoom_rate.lasts(way, SLOWER) + later if way else glide.began


def shown(skill: Skill, glide: Glide, sent: float, since: float) -> bool:
    """Whether it rests too where all is read the same since some time; coarse readings alone show that late."""
    return sent >= min(rests(skill, glide), since + skill.step_s)
