"""The mount as a plan: finds the known markers, looks at each from several readings, then the fit, and back again.

Where the mount is roughly known the camera looks where each marker should be; markers that it does not see there are
looked for all around. The reckoning is `vision/calibrate_mount.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from services.camera.calibration.shots import How, MarkerShot, markers_in, taken
from services.camera.calibration.study import study
from services.camera.device import Away, Reading, Refused
from services.camera.plan import Plan, wait
from services.camera.ptz.goal import Limits
from services.camera.ptz.move import goto
from services.camera.ptz.skill import Skill
from services.camera.ptz.stand import settle
from services.vision.aim import readings_at
from services.vision.calibrate_mount import FEWEST, MountFit, best_pose, fit
from services.vision.frames import Array, Mount, camera_in_apartment
from services.vision.lens import Lens
from services.vision.mount_squares import Known, Look

FRAMES = 2  # at each look: more would only average what is a hundredth of a pixel
ASIDE = ((0.0, 0.0), (13.0, 7.0), (-13.0, -7.0))  # a marker is looked at centred, and from readings beside that
SWEEP_TILTS, SWEEP_DEG = (30.0, 62.0), 55.0  # the search all around: a picture is about 90 degrees wide
RIM_PX = 10.0  # a marker nearer to the picture's rim is not used: the lens is known worst there
MOVE_S = 60.0
POOR_M, POOR_DEG = 0.05, 1.0  # a mount that is less sure than that is none


@dataclass(frozen=True, eq=False)
class Seen:
    """One stop: where the camera stood, and what it saw."""

    reading: Reading
    shot: MarkerShot


@dataclass
class Touring:
    """One calibration of the mount. `guess` places nothing when `placed` is not set: only its kind and arms count."""

    known: Mapping[int, Known]
    lens: Lens
    guess: Mount
    placed: bool
    dictionary: str
    how: How
    limits: Limits
    skill: Skill
    settle_s: float
    angle_deg: float
    tell: Callable[[Touring], None]
    said: str = ""
    progress: float = 0.0
    stops: list[Seen] = field(default_factory=list)
    looks: list[Look] = field(default_factory=list)

    @property
    def met(self) -> set[int]:
        """The markers that were seen."""
        return {look.marker for look in self.looks}

    def plan(self, now: float) -> Plan[MountFit]:
        """Ends with the mount, the camera where it began; DeviceError when too few markers were found."""
        began, now = yield from settle()
        now = yield from self._find(now)
        if len(self.met) < FEWEST:
            missing = sorted(set(self.known) - self.met)
            raise Refused(f"{len(self.met)} of {len(self.known)} markers were found, {FEWEST} are needed: no {missing}")
        wanted = [(marker, aside) for marker in sorted(self.met) for aside in ASIDE]
        for index, (marker, (right, below)) in enumerate(wanted):
            pan, tilt = self._towards(marker)
            self._say(f"looks at marker {marker}", 0.3 + 0.6 * index / len(wanted))
            now = yield from self._stop_at(pan + right, tilt + below, marker, now)
        self._say("that is enough, it is reckoned", 0.9)
        looks, known, guess = tuple(self.looks), self.known, self.guess
        found, now = yield from study(lambda: fit(looks, known, guess, self.angle_deg))
        self._check(found)
        yield from self._go(began.pan, began.tilt, now)
        return found

    def _find(self, now: float) -> Plan[float]:
        """Until every marker was seen, or everything was looked at."""
        ways = list(self._ways())
        for index, (pan, tilt, wanted) in enumerate(ways):
            if wanted in self.met or self.met >= set(self.known):
                continue
            self._say(f"looks for markers, {len(self.met)} of {len(self.known)} found", 0.3 * index / len(ways))
            now = yield from self._stop_at(pan, tilt, wanted, now)
        return now

    def _ways(self) -> Iterator[tuple[float, float, int | None]]:
        """Where to look, for which marker (None: for all)."""
        if self.placed:
            for marker, one in self.known.items():
                yield *readings_at(self.guess, np.array(one.position)), marker
        low, high = self.limits.ranges[0]
        count = int(np.ceil((high - low) / SWEEP_DEG))
        for row, tilt in enumerate(SWEEP_TILTS):
            pans = np.linspace(low + SWEEP_DEG / 3, high - SWEEP_DEG / 3, count)
            for pan in pans if row % 2 == 0 else pans[::-1]:
                yield float(pan), tilt, None

    def _stop_at(self, pan: float, tilt: float, wanted: int | None, now: float) -> Plan[float]:
        """Goes there and takes in every known marker that is seen; there should be the `wanted` one, None: any."""
        reading, now = yield from self._go(pan, tilt, now)
        now = yield from wait(now + self.settle_s)
        jpegs = []
        for _ in range(FRAMES):
            jpeg, now = yield from taken(now)
            jpegs.append(jpeg)
        how, dictionary, ids, lens = self.how, self.dictionary, sorted(self.known), self.lens
        try:
            shot, now = yield from study(lambda: markers_in(jpegs, how, dictionary, ids, wanted, lens))
        except Away:  # half a picture
            return now
        self.stops.append(Seen(reading, shot))
        scaled = lens.scaled(*shot.size)
        for marker, corners in shot.markers.items():
            if _inside(corners, shot.size):
                self.looks.append(Look(marker, corners, scaled, reading.pan, reading.tilt))
        return now

    def _go(self, pan: float, tilt: float, now: float) -> Plan[tuple[Reading, float]]:
        low, high = self.limits.tilt
        goal = self.limits.goal(pan % 360.0, min(high - 0.5, max(low + 0.5, tilt)), self.limits.zoom[0])
        arrival = yield from goto(goal, self.limits, self.skill, now + MOVE_S)
        return (yield from settle(arrival.reading))  # that one may be of the last bit of the way

    def _towards(self, marker: int) -> tuple[float, float]:
        """The readings that centre a marker, from how it was seen; the mount is not needed for that."""
        look = next(look for look in reversed(self.looks) if look.marker == marker)
        level = replace(self.guess, position=(0.0, 0.0, 0.0), yaw_deg=0.0, lean_deg=(0.0, 0.0))
        pose = best_pose(look, self.known[marker].size_m)
        assert pose is not None
        return readings_at(level, camera_in_apartment(level, look.pan, look.tilt).apply(pose.translation))

    def _check(self, found: MountFit) -> None:
        place, turn = float(found.position_doubt.max()), float(found.turn_doubt_deg.max())
        if place > POOR_M or turn > POOR_DEG:
            raise Refused(
                f"the mount is only known to {100 * place:.0f} cm and {turn:.1f} degrees: "
                "use more markers, spread around the camera and at two heights"
            )

    def _say(self, said: str, progress: float) -> None:
        self.said, self.progress = said, progress
        self.tell(self)


def _inside(corners: Array, size: tuple[int, int]) -> bool:
    return bool((corners > RIM_PX).all() and (corners < np.array(size) - 1 - RIM_PX).all())
