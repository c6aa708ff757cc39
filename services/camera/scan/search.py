"""The marker scan as a plan: go to a place, wait for the picture, take frames, go on. They are looked at meanwhile.

The scan stays at the widest zoom: the camera's zoom is digital, so it adds nothing to a full-size picture, and its true
magnification is not known. Not here: finding markers (`analysis.py`), where they are (`sightings.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, cast

from services.camera.plan import Plan, ask, attempt, wait
from services.camera.ptz.goal import Limits
from services.camera.ptz.move import goto
from services.camera.ptz.skill import Skill
from services.camera.ptz.zooming import widest
from services.camera.requests import Away, Reading, Snapshot
from services.camera.scan.analysis import Analysed
from services.camera.scan.sightings import Sighting, between
from services.payloads import Place, ScanState
from services.vision.frames import Kind

ANALYSE_S = 30.0  # longest wait for the last frames to be looked at
WELL = 2  # frames that must show a target before a scan may end early
NEARER_DEG = 3.0  # a place that looks less nearer than this is not worth the way
TRIES = 3  # of a picture: the camera sometimes closes without an answer


@dataclass(frozen=True)
class Frame:
    """When and where a picture was taken, at rest; its bytes are not kept."""

    number: int
    place: str
    reading: Reading
    at: float


Look = Callable[[Frame, bytes], None]
Take = Callable[[float, float], Plan[tuple[bytes, float, float]]]
"""Plans a picture from after a moment, given the time now: its bytes, when it was exposed, and the time then."""


def snapshot(after: float, now: float) -> Plan[tuple[bytes, float, float]]:
    """A Take: asked for now, when the camera has been at rest for a while."""
    for _ in range(TRIES - 1):
        reply = yield from attempt(Snapshot())
        if reply.error is None:
            return cast(bytes, reply.result), reply.sent, reply.received
        yield from wait(reply.received + 0.3)
    reply = yield from ask(Snapshot())
    return cast(bytes, reply.result), reply.sent, reply.received


@dataclass
class Scan:
    """One scan: the plan that drives it, and what has come out so far."""

    name: str
    targets: tuple[int, ...]
    routine: Mapping[str, Place]
    limits: Limits
    skill: Skill
    began: float
    frames: int = 4
    settle_s: float = 0.6
    stop_early: bool = True
    kind: Kind = "ceiling"
    move_timeout_s: float = 60.0
    take: Take = snapshot
    place: str | None = None
    near: Reading | None = None  # of the place before, where nothing has moved it since
    taken: list[Frame] = field(default_factory=list)
    analysed: int = 0
    seen: dict[int, list[Sighting]] = field(default_factory=dict)

    def plan(self, look: Look) -> Plan[None]:
        """Visits the places; `look` is handed every frame. Ends when all frames have been looked at.

        With `stop_early`, places that can add nothing any more are left out.
        """
        now, left = self.began, dict(self.routine)
        while left:
            self.place = next(iter(left))
            now = yield from self._visit(left.pop(self.place), now, look)
            if self.stop_early:
                now = yield from self._all_analysed(now)
                left = {name: place for name, place in left.items() if self.worth(place)}
        yield from self._all_analysed(now)
        self.place = None

    def add(self, analysed: Analysed) -> None:
        """Takes in what was found in one frame."""
        self.analysed += 1
        frame = self.taken[analysed.number]
        for detection in analysed.detections:
            if detection.marker in self.targets:
                sighting = Sighting(detection, frame.place, frame.reading, frame.at, analysed.size)
                self.seen.setdefault(detection.marker, []).append(sighting)

    def worth(self, place: Place) -> bool:
        """Whether a place is still to be visited: a target is missing, or it looks nearer to one than any so far."""
        enough = min(WELL, self.frames)
        return any(
            len(self.seen.get(target, ())) < enough or self._nearer(place, self.seen[target]) for target in self.targets
        )

    def _nearer(self, place: Place, seen: list[Sighting]) -> bool:
        best = min(seen, key=lambda sighting: sighting.off_centre)
        there = best.bearing(self.kind)
        return between(there, (place.pan, place.tilt)) + NEARER_DEG < between(
            there, (best.reading.pan, best.reading.tilt)
        )

    def state(
        self, state: Literal["running", "done", "cancelled", "failed"], now: float, reason: str = ""
    ) -> ScanState:
        """How far it is."""
        return ScanState(
            state=state,
            scan=self.name,
            targets=list(self.targets),
            found=sorted(self.seen),
            turn=1,
            place=self.place,
            progress=1.0 if state == "done" else self._progress(),
            frames_taken=len(self.taken),
            frames_analysed=self.analysed,
            elapsed_s=round(max(0.0, now - self.began), 3),
            reason=reason,
        )

    def _progress(self) -> float:
        whole = max(1, len(self.routine) * self.frames)
        return round(min(1.0, (len(self.taken) + self.analysed) / (2 * whole)), 3)

    def _visit(self, place: Place, now: float, look: Look) -> Plan[float]:
        goal = self.limits.goal(place.pan, place.tilt, self.limits.zoom[0])
        until, preset = now + self.move_timeout_s, place.preset
        presets = {} if preset is None else {preset: (place.pan, place.tilt, place.zoom)}
        arrival = yield from goto(goal, self.limits, self.skill, until, near=self.near, presets=presets)
        self.near = arrival.reading
        now = yield from widest(self.limits, self.skill, arrival.at)
        now = yield from wait(now + self.settle_s)
        for _ in range(self.frames):
            jpeg, at, now = yield from self.take(arrival.at, now)
            frame = Frame(len(self.taken), self.place or "", arrival.reading, at)
            self.taken.append(frame)
            look(frame, jpeg)
        return now

    def _all_analysed(self, now: float) -> Plan[float]:
        limit = now + ANALYSE_S
        while self.analysed < len(self.taken):
            if now > limit:
                raise Away("the frames were not looked at in time")
            now = yield from wait(now + 0.05)
        return now
