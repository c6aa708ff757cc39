"""The mission as a state machine: robot and house find a marker together. Theory of operation.

A mission follows *leads*, one after the other. A lead is a belief of where the marker may be, with the *stands* from
which the robot could see it, best first. There are four sources of leads, used in this order:

1. `here`: where the robot stands now, turning on the spot. It costs nothing to look first.
2. What a camera of the house saw lately; a sighting that is old is not believed without a new one.
3. A scan by every camera of the house that can be used.
4. The points of the robot's own map in turn, where the house knows nothing: robot and house also live apart.

At each stand the robot *goes* there and *looks*. Seen often enough in one look, the marker is *found*. A stand that
cannot be reached is tried again, then left for the next stand, then for the next lead. When a camera's sighting leads
to a place where the marker is not, it was carried away: the house is asked to scan once more. When a camera sees it
elsewhere while the robot drives, the robot turns round at once. When all leads are used up the mission ends with the
reason: `not_found` when it was looked for, `failed` when it was not possible to look.

    idle --Begin--> look (here) --seen--> found
                      | not seen, no lead left          scan --every camera ended--> go | look | not_found
                      v                                  ^
                     scan ------------------------------/
    go --Arrived--> look        go --NotReached, Late--> go (again, next stand, next lead) | scan
    look --Late--> go (next stand, next lead) | scan | not_found | failed
    any --Cancel--> cancelled   any --Resumed--> the same step once more, with a new goal or scan

Everything else that comes in a step is not in the table and changes nothing: an answer to an older goal, a scan that
somebody else started. Nothing here waits, sends or reads a clock; `advance` says what is to be done. Not here: which
stands a lead has (`standing.py`), what was seen when (`memory.py`), messages (`service.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import dist

from services.mission.events import (
    Action,
    Arrived,
    Begin,
    Cancel,
    Event,
    Go,
    Halt,
    Late,
    NotReached,
    Resumed,
    Scan,
    ScanEnded,
    Seen,
    Sighted,
    StopScan,
)  # fmt: skip
from services.mission.moment import Moment
from services.mission.state import HERE, ROUND, Around, Mission
from services.payloads.robot import MissionStep

Turn = tuple[Mission, list[Action]]


def advance(mission: Mission, event: Event, now: float, around: Around) -> Turn:
    """What becomes of the mission by an event, and what is to be done for it. An event that is not in the table for
    the step changes nothing."""
    act = ANYWHERE.get(type(event)) or TABLE.get((mission.step, type(event)))
    if mission.over or act is None:
        return mission, []
    moment = Moment(mission, now, around)
    act(moment, event)
    return moment.mission, moment.actions


def _begin(at: Moment, _: Event) -> None:
    at.change(leads=(at.around.here,) if at.around.here is not None else ())
    _try(at) if at.mission.leads else _next_lead(at)


def _try(at: Moment) -> None:
    """Goes to the stand that is next, or looks at once where it stands there."""
    mission, lead = at.mission, at.mission.leads[0]
    stand = lead.stands[mission.stand]
    if not stand.away:
        return _look(at, "looks from where it stands")
    at.change(goal=mission.goal + 1, tries=mission.tries + 1)
    why = {HERE: "turns to look", ROUND: "goes round"}.get(lead.by, f"seen by {lead.by}")
    at.do(Go(at.mission.goal, stand))
    at.enter("go", f"to {lead.place or stand}: {why}", at.around.rules.drive_s)


def _look(at: Moment, text: str, *, passing: bool = False) -> None:
    at.change(views=0, blanks=0, heard=False, passing=passing, looked=at.mission.looked or not passing)
    at.enter("look", text, at.around.rules.look_s)


def _arrived(at: Moment, event: Event) -> None:
    assert isinstance(event, Arrived)
    if event.goal == at.mission.goal:
        _look(at, f"looks at {at.mission.place}")


def _not_reached(at: Moment, event: Event) -> None:
    assert isinstance(event, NotReached)
    if event.goal == at.mission.goal:
        _hindered(at, event.reason)


def _drives_too_long(at: Moment, _: Event) -> None:
    at.do(Halt(at.mission.goal))
    _hindered(at, f"not there after {at.around.rules.drive_s:.0f} s")


def _hindered(at: Moment, reason: str) -> None:
    at.change(obstacle=reason)
    if at.mission.tries < at.around.rules.tries:
        _try(at)
    else:
        _next_stand(at)


def _next_stand(at: Moment) -> None:
    at.change(stand=at.mission.stand + 1, tries=0)
    if at.mission.stand < len(at.mission.leads[0].stands):
        _try(at)
    else:
        _next_lead(at)


def _next_lead(at: Moment) -> None:
    """The next lead; when there is none, the next source of leads; when there is none, the end."""
    mission, lead = at.mission, at.mission.lead
    if lead is not None and lead.by_house:
        at.change(missed=mission.looked, unreached="" if mission.looked else f"{lead.by} saw it at {mission.place}")
    at.change(leads=mission.leads[1:], stand=0, tries=0, looked=False)
    if not at.mission.leads and not mission.known_used:
        at.change(leads=at.around.known(), known_used=True)
    if at.mission.leads:
        return _try(at)
    if at.around.cameras and (mission.scan == 0 or (at.mission.missed and mission.scan < at.around.rules.scans)):
        return _scan(at)
    if not mission.round_used:
        at.change(leads=at.around.round(), round_used=True)
        return _try(at) if at.mission.leads else _give_up(at)
    _give_up(at)


def _scan(at: Moment) -> None:
    cameras = at.around.cameras
    at.change(scan=at.mission.scan + 1, scanning=cameras, missed=False)
    for camera in cameras:
        at.do(Scan(camera, at.mission.scan))
    at.enter("scan", f"asks the house: {', '.join(cameras)}", at.around.rules.scan_s)


def _give_up(at: Moment) -> None:
    mission = at.mission
    if mission.looks == 0:
        return at.enter("failed", mission.obstacle or "the robot's camera says nothing")
    if mission.unreached:
        return at.enter("failed", f"{mission.unreached}, and the robot did not get there: {mission.obstacle}")
    unable = "" if at.around.cameras else "; no camera of the house can be used"
    hindered = f"; not everywhere was reached: {mission.obstacle}" if mission.obstacle else ""
    at.enter("not_found", f"marker {mission.marker} was seen nowhere{unable}{hindered}")


def _seen_in_look(at: Moment, event: Event) -> None:
    assert isinstance(event, Seen)
    first = not at.mission.heard
    at.change(heard=True, looks=at.mission.looks + first)
    if event.marker:
        at.change(views=at.mission.views + 1, position=event.position or at.mission.position)
    else:
        at.change(blanks=at.mission.blanks + 1)
    if at.mission.views >= at.around.rules.sure:
        at.enter("found", f"the robot sees it at {at.mission.place or 'its place'}")
    elif at.mission.blanks >= at.around.rules.blank:
        _looked(at, event)


def _looked(at: Moment, _: Event) -> None:
    """Nothing was seen for long enough. A look on the way was worth a halt, and the way goes on."""
    if at.mission.passing:
        at.change(passing=False, tries=at.mission.tries - 1)
        return _try(at)
    _next_stand(at)


def _seen_on_the_way(at: Moment, event: Event) -> None:
    assert isinstance(event, Seen)
    if event.marker and at.mission.glimpses < at.around.rules.glimpses:
        at.do(Halt(at.mission.goal))
        at.change(glimpses=at.mission.glimpses + 1)
        _look(at, "sees it on the way", passing=True)
        _seen_in_look(at, event)


def _sighted(at: Moment, event: Event) -> None:
    """A camera sees it while the robot is on its way or looks: elsewhere than it was believed?"""
    assert isinstance(event, Sighted)
    mission, lead = at.mission, event.lead
    old = mission.lead
    if old is None or not lead.stands or lead.stamp <= max(old.stamp, mission.began):
        return
    same = old.by_house and old.position is not None and lead.position is not None
    if same and dist(old.position or (), lead.position or ()) <= at.around.rules.moved_m:
        return
    if mission.step == "go":
        at.do(Halt(mission.goal))
    at.change(leads=(lead, *(one for one in mission.leads if not one.by_house)), stand=0, tries=0)
    at.change(position=lead.position or mission.position)
    _try(at)


def _noted(at: Moment, event: Event) -> None:
    """A camera's scan found it: the best position comes first, one lead a camera."""
    assert isinstance(event, Sighted)
    if event.lead.stands and event.lead.stamp >= at.mission.since:
        others = tuple(one for one in at.mission.leads if one.by != event.lead.by)
        leads = sorted((*others, event.lead), key=lambda lead: lead.position is None)
        at.change(leads=tuple(leads), position=event.lead.position or at.mission.position)


def _scan_ended(at: Moment, event: Event) -> None:
    assert isinstance(event, ScanEnded)
    if event.scan != at.mission.scan or event.camera not in at.mission.scanning:
        return
    at.change(scanning=tuple(one for one in at.mission.scanning if one != event.camera))
    if event.reason:
        at.enter("scan", f"{event.camera}: {event.reason}", at.mission.deadline - at.now)
    if not at.mission.scanning:
        _follow(at)


def _scan_late(at: Moment, _: Event) -> None:
    _stop_scans(at)
    _follow(at)


def _follow(at: Moment) -> None:
    """The scans are over: the leads that they gave, or what comes without."""
    if at.mission.leads:
        at.change(stand=0, tries=0)
        _try(at)
    else:
        _next_lead(at)


def _seen_while_scanning(at: Moment, event: Event) -> None:
    assert isinstance(event, Seen)
    if event.marker and at.around.here is not None:
        _stop_scans(at)
        here = replace(at.around.here, stands=at.around.here.stands[:1])
        at.change(leads=(here, *at.mission.leads), stand=0, tries=0)
        _look(at, "sees it itself meanwhile")
        _seen_in_look(at, event)


def _stop_scans(at: Moment) -> None:
    for camera in at.mission.scanning:
        at.do(StopScan(camera, at.mission.scan))
    at.change(scanning=())


def _cancel(at: Moment, event: Event) -> None:
    assert isinstance(event, Cancel)
    if at.mission.step == "go":
        at.do(Halt(at.mission.goal))
    _stop_scans(at)
    at.enter("cancelled", event.reason)


def _resume(at: Moment, event: Event) -> None:
    """What was under way may have ended unheard: it is done again."""
    if at.mission.step == "go":
        at.change(tries=max(0, at.mission.tries - 1))
        _try(at)
    elif at.mission.step == "look":
        _look(at, "looks again after a restart")
    elif at.mission.step == "scan":
        _stop_scans(at)
        at.change(scan=at.mission.scan - 1)
        _scan(at) if at.around.cameras else _follow(at)
    else:
        _begin(at, event)


Act = Callable[[Moment, Event], None]
TABLE: dict[tuple[MissionStep, type], Act] = {
    ("idle", Begin): _begin,
    ("go", Arrived): _arrived,
    ("go", NotReached): _not_reached,
    ("go", Late): _drives_too_long,
    ("go", Seen): _seen_on_the_way,
    ("go", Sighted): _sighted,
    ("look", Seen): _seen_in_look,
    ("look", Late): _looked,
    ("look", Sighted): _sighted,
    ("scan", Sighted): _noted,
    ("scan", ScanEnded): _scan_ended,
    ("scan", Late): _scan_late,
    ("scan", Seen): _seen_while_scanning,
}
ANYWHERE: dict[type, Act] = {Cancel: _cancel, Resumed: _resume}
