"""The marker scan as a plan: from place to place, frames at each, and a second turn in another picture mode.

The camera moves on as soon as the frames of a place have been exposed; they arrive and are looked at meanwhile. The
scan stays at the widest zoom: the camera's zoom is digital, so it adds nothing to a full-size picture.
Not here: the order of the places (`route.py`), where frames come from (`source.py`), what came out (`findings.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, cast

from services.camera.device import Away, GetPicture, Picture, Reading, Refused, Stop
from services.camera.plan import Plan, attempt, wait
from services.camera.ptz.goal import Limits
from services.camera.ptz.move import goto
from services.camera.ptz.skill import Skill
from services.camera.ptz.zooming import widest
from services.camera.scan.findings import Findings, Frame
from services.camera.scan.modes import Modes
from services.camera.scan.route import detours
from services.camera.scan.source import Source, Spot
from services.errors import DeviceError
from services.payloads import Place, ScanState

ANALYSE_S = 30.0  # longest wait for the next frame to be looked at
LIGHT_S = 1.5  # after a change of the picture's mode it exposes anew: 1 to 2 s
BACK_S = 180.0  # a camera that went away may be restarting: 40 to 105 s were seen
PATIENCE = 3  # times that it may go away in one scan
VISITS = 3  # of a place in one mode of the picture: what is missing then does not come
RESTORED_S = 5.0
STEP_S = 0.05

SecondTurn = Literal["missed", "always", "never"]
Look = Callable[[Frame, bytes], None]


@dataclass
class Scan:
    """One scan: the plan that drives it. `routine`: the places in their order; `second`: when there is a second turn.

    `likely` is the place that showed a target last; `near` where the camera looks, if that is known; `slack` tells how
    many degrees beside a place saved at a zoom will do.
    """

    name: str
    findings: Findings
    routine: Mapping[str, Place]
    limits: Limits
    skill: Skill
    began: float
    source: Source
    modes: Modes
    stop_early: bool = True
    second: SecondTurn = "missed"
    mode: str = "color"  # as the picture is
    move_timeout_s: float = 60.0
    likely: str | None = None
    near: Reading | None = None
    place: str | None = None
    turn: int = 1
    trouble: str = ""  # what it waits for
    spots: list[Spot] = field(default_factory=list)
    looks: Look = lambda frame, jpeg: None
    slack: Callable[[float], float] = lambda zoom: 0.0
    _lost: int = 0
    _settles: float = 0.0  # when the picture's light has settled after a change of its mode
    _far: float = 0.0

    def plan(self, look: Look) -> Plan[None]:
        """Visits the places; `look` is handed every frame. Ends when all frames have been looked at.

        With `stop_early`, places that can add nothing any more are left out.
        """
        self.looks = look
        now = yield from self._unchanged(self.began)
        now = yield from self.source.begin(now)
        now = yield from self._tour(dict(self.routine), now)
        if self.second == "always" or (self.second == "missed" and (yield from self._missing(now))):
            visited = dict.fromkeys(spot.place for spot in self.spots)
            backwards = {place: self.routine[place] for place in reversed(visited)}
            if (now := (yield from self._switch(now))) and self.turn == 2:
                now = yield from self._tour(backwards, now)
                now = yield from self._mended(now)  # while the mode is on
                now = yield from self._first_mode(now)  # while the last frames are on their way
        now = yield from self._all_there(now)
        now = yield from self._again(now)
        self._check()
        self.place = None

    def gather(self) -> None:
        """Hands on the frames that have come."""
        for spot, at, jpeg in self.source.collect():
            self.looks(self.findings.take(spot, at), jpeg)

    def state(
        self, state: Literal["running", "done", "cancelled", "failed"], now: float, reason: str = ""
    ) -> ScanState:
        """How far it is; while it runs, what was seen in one frame only is not found yet."""
        found = [one for one in self.findings.seen if state != "running" or self.findings.found(one)]
        return ScanState(
            state=state,
            running=state == "running",
            scan=self.name,
            targets=list(self.findings.targets),
            found=sorted(found),
            turn=self.turn,
            place=self.place,
            progress=1.0 if state == "done" else self._progress(),
            frames_taken=len(self.findings.taken),
            frames_analysed=self.findings.analysed,
            elapsed_s=round(max(0.0, now - self.began), 3),
            reason=reason or self.trouble,
        )

    def _progress(self) -> float:
        turns = 2 if self.second == "always" or self.turn == 2 else 1
        whole = max(1, len(self.routine) * self.findings.frames * turns)
        done = (len(self.findings.taken) + self.findings.analysed) / (2 * whole)
        self._far = max(self._far, round(min(1.0, done), 3))
        return self._far

    def _tour(self, left: dict[str, Place], now: float) -> Plan[float]:
        while left:
            name = next(iter(left))
            now = yield from self._visit(name, left.pop(name), now)
            if self.stop_early and name == self.likely:
                now = yield from self._all_there(now)  # this place may be all
            if self.stop_early:
                left = {name: place for name, place in left.items() if self.findings.worth(place)}
            now = yield from self._mended(now, [self.routine[name], *left.values()])
        return now

    def _visit(self, name: str, place: Place, now: float, wanted: int | None = None) -> Plan[float]:
        """One place; a camera that goes away in between is awaited, and the place is visited once more."""
        while True:
            try:
                return (yield from self._stay(name, place, now, wanted or self.findings.frames))
            except Away as error:
                now = yield from self._back(error, now)

    def _stay(self, name: str, place: Place, now: float, wanted: int) -> Plan[float]:
        self.place = name
        now = yield from self._go(place, now)
        if self.stop_early and not self.findings.worth(place):
            return now  # all was found on the way here
        if not self.spots:
            yield from self._ask_picture()
        since = max(self.source.rested, self._settles)
        spot = Spot(wanted, since, since == self._settles, place=name, reading=cast(Reading, self.near), mode=self.mode)
        self.spots.append(spot)
        try:
            now = yield from self.source.expose(spot, now)
        except Away:
            self.spots.remove(spot)
            raise
        self.near = spot.reading
        self.gather()
        return now

    def _ask_picture(self) -> Plan[None]:
        """How the frames will be turned, and in which mode; asked for while the first ones are exposed."""
        reply = yield from attempt(GetPicture())
        if isinstance(reply.result, Picture):
            self.mode = reply.result.mode
        if self.second == "always":
            yield from self.modes.note(reply)

    def _go(self, place: Place, now: float) -> Plan[float]:
        goal = replace(self.limits.goal(place.pan, place.tilt, self.limits.zoom[0]), near=self.slack(place.zoom))
        presets = {} if place.preset is None else {place.preset: (place.pan, place.tilt, place.zoom)}
        near, self.near = self.near, None
        move = goto(goal, self.limits, self.skill, now + self.move_timeout_s, near=near, presets=presets)
        arrival = yield from self.source.followed(move, now)
        self.source.reckon(arrival.rests)
        now = yield from self.source.followed(widest(self.limits, self.skill, arrival.at), self.source.rested)
        self.near = arrival.reading
        return now

    def _switch(self, now: float) -> Plan[float]:
        """To the second picture mode, where the camera has one."""
        try:
            changed = yield from self.modes.enter()
        except Refused:
            self.second = "never"
            return now
        self.source.leave(now)
        self.turn, self.mode, self._settles = 2, "bw", changed + LIGHT_S
        return changed

    def _first_mode(self, now: float) -> Plan[float]:
        """As the picture was before."""
        self.source.leave(now)
        yield from self.modes.leave()
        now = yield from wait(now)
        self.mode, self._settles = self.spots[0].mode, now + LIGHT_S
        return now

    def _unchanged(self, now: float) -> Plan[float]:
        """Waits a little for the picture to be as it was before the last scan."""
        until = now + RESTORED_S
        while self.modes.changed and now < until:
            now = yield from wait(now + STEP_S)
        return now

    def _missing(self, now: float) -> Plan[bool]:
        """Whether the first turn has left a target unseen, when all is looked at."""
        yield from self._all_there(now)
        return not self.findings.all_found

    def _back(self, error: Away, now: float) -> Plan[float]:
        """Waits for a camera that went away, as one does that restarts; it is stopped first. Raises when it stays."""
        self._lost, self.trouble, self.near = self._lost + 1, f"the camera is away: {error}", None
        until = now + BACK_S
        while True:
            reply = yield from attempt(Stop())
            if reply.error is None or isinstance(reply.error, Refused):
                break
            if self._lost > PATIENCE or reply.received > until or not isinstance(reply.error, Away):
                raise error if isinstance(reply.error, Away) else reply.error
            yield from wait(reply.received + 0.5)
        self.trouble = ""
        return reply.received

    def _all_there(self, now: float) -> Plan[float]:
        """Until every frame has come and has been looked at."""
        limit, done = now + ANALYSE_S, self.findings.analysed
        self.gather()
        while self.source.pending(now) or self.findings.analysed < len(self.findings.taken):
            if self.findings.analysed > done:
                limit, done = now + ANALYSE_S, self.findings.analysed
            if now > limit:
                raise DeviceError("the frames are not looked at: no worker answers")
            now = yield from wait(now + STEP_S)
            self.gather()
        return now

    def _again(self, now: float) -> Plan[float]:
        """Visits once more the places of which frames are missing: the stream stood still, or some were broken."""
        short = self._short(now)
        now = yield from self._mended(now)
        for spot in short:
            if spot.mode != self.mode:
                now = yield from self._switch(now)
                now = yield from self._mended(now)
        if not short:
            return now
        if self.modes.changed:
            now = yield from self._first_mode(now)
        return (yield from self._all_there(now))

    def _mended(self, now: float, way: Sequence[Place] = ()) -> Plan[float]:
        """Those whose frames are missing in this mode of the picture, and that are not nearer later on the way."""
        for spot in self._short(now):
            if spot.mode == self.mode and self._nearest(self.routine[spot.place], way):
                missing, spot.wanted = spot.wanted - spot.got, spot.got
                now = yield from self._visit(spot.place, self.routine[spot.place], now, missing)
                way = [self.routine[spot.place], *way[1:]]
        return now

    def _nearest(self, place: Place, way: Sequence[Place]) -> bool:
        """Whether a stop there costs least now; `way` begins where the camera is, the second turn where it ends."""
        if not way:
            return True
        more = detours(place, way, self.limits, self.skill)
        more[-1] *= 2 if self.turn == 1 and self.second == "always" else 1
        return more[0] <= min(more)

    def _short(self, now: float) -> list[Spot]:
        """The visits of which it is known that frames are missing, and that they are needed."""
        self.gather()
        self.source.pending(now)  # gives up what comes no more
        return [spot for spot in self.spots if spot.over and spot.got < spot.wanted and self._needed(spot)]

    def _needed(self, spot: Spot) -> bool:
        if sum((one.place, one.mode) == (spot.place, spot.mode) for one in self.spots) >= VISITS:
            return False
        whole = self.second == "always" or not self.stop_early
        return whole or (spot.got <= spot.wanted // 2 and self.findings.worth(self.routine[spot.place]))

    def _check(self) -> None:
        """DeviceError when there is a place of which no picture could be read."""
        seen = {spot.place for spot in self.spots if spot.got > 0}
        blind = [place for place in dict.fromkeys(spot.place for spot in self.spots) if place not in seen]
        if blind and not self.findings.all_found:
            why = next((self.findings.unreadable[one] for one in blind if one in self.findings.unreadable), "none came")
            raise DeviceError(f"no picture of {', '.join(blind)}: {why}")
