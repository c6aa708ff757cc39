"""`ptz.cgi`: which command does what with the motors, and what they remember. Pure; the time comes in.

What is told about them is put into words in `status`; moves to a position are in `aims`.
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from services.simulators.camera import aims, status
from services.simulators.camera.config_tables import Tables
from services.simulators.camera.latency import Latency
from services.simulators.camera.messages import OK, Answer, Request, lines, refusal
from services.simulators.camera.motors import CODES, Motors, Pose, reading
from services.simulators.camera.profiles import Profile
from services.simulators.camera.rounds import SCAN_LEVEL, Round, Rounds
from services.simulators.true_camera import WorldCamera

IDLE_CODES = ("FocusNear", "FocusFar", "IrisLarge", "IrisSmall")  # accepted; a fixed lens does nothing with them
TOURS = ("StartTour", "StopTour", "AddTour", "DelTour", "ClearTour")
SCANS = {"AutoPanOff": "AutoPanOn", "AutoScanOff": "AutoScanOn"}
LIMITS = ("SetLeftLimit", "SetRightLimit")
DITHER = (-0.1, 0.0, 0.0, 0.1)  # degrees

Act = Callable[[Request, float], Answer]


class Ptz:
    """The motors, the presets and tours, and what `ptz.cgi` does with them."""

    def __init__(self, camera: WorldCamera, profile: Profile, tables: Tables, latency: Latency, now: float) -> None:
        self._camera, self._profile, self._tables, self._latency = camera, profile, tables, latency
        self.motors = Motors(camera, profile, now)
        self.rounds = Rounds(self.motors)
        self.presets = {
            place.preset: (name, Pose(*camera.aim(place.looks_at), 0.0)) for name, place in camera.places.items()
        }
        self.tours: dict[int, list[int]] = {}
        self._limits = dict.fromkeys(LIMITS, Pose(*camera.starts_at))
        self._preset = 0  # the last one gone to
        self.commands = 0  # that were to move something
        self.loses_stops = 0  # so many of the next stops are answered well and stop nothing
        self._dice = Random(camera.serial)
        self._actions: dict[str, Act] = {
            "start": self._start,
            "stop": self._stop,
            "setPreset": lambda request, now: self._keep(request, "arg1", now),
            **dict.fromkeys(("moveAbsolutely", "moveRelatively", "moveDirectly"), self._aim),
            "getStatus": self._status,
            "getPresets": lambda request, now: lines(status.presets(profile, self.presets)),
            "getCurrentProtocolCaps": lambda request, now: lines(status.capabilities(profile, camera)),
            "getProtocolList": lambda request, now: lines(status.protocols()),
        }
        self._codes: dict[str, Act] = {
            "GotoPreset": self._goto_preset,
            "SetPreset": lambda request, now: self._keep(request, "arg2", now),
            "ClearPreset": self._clear_preset,
            **dict.fromkeys(("PositionABS", "Position", "Continuously"), self._aim),
            **dict.fromkeys(TOURS, self._tour),
            **dict.fromkeys((*SCANS, *SCANS.values(), *LIMITS), self._scan),
            **dict.fromkeys(IDLE_CODES, lambda request, now: OK),
        }

    def answer(self, request: Request, now: float) -> Answer:
        """One request to `ptz.cgi` or `ptzBase.cgi`; arguments that are no numbers are refused."""
        self.rounds.advance(now)
        act = self._actions.get(request.action)
        try:
            channel = int(request.number("channel", self._profile.ptz_channels[0]))
            if act is None or channel not in self._profile.ptz_channels:
                return refusal(self._profile)
            self.commands += not request.action.startswith("get")
            return act(request, now)
        except ValueError:
            return refusal(self._profile)

    def list_tours(self) -> Answer:
        """What `configManager.cgi?action=getTours` tells."""
        return lines(status.tours(self.tours)) if self._profile.tours else refusal(self._profile)

    @property
    def signs(self) -> tuple[int, int]:
        """Which way travel and tilt go to the right and down in the picture, as the firmware takes it."""
        inverts = self._profile.mirror_inverts_motors
        flip, mirror = (inverts and self._tables.flag(f"VideoInOptions[0].{key}") for key in ("Flip", "Mirror"))
        return (-1 if mirror else 1), (1 if flip else -1)

    def _start(self, request: Request, now: float) -> Answer:
        code = request.text("code")
        if code in self._codes:
            return self._codes[code](request, now)
        if code not in CODES:
            return refusal(self._profile)
        right, down = self.signs
        vertical, horizontal = int(request.number("arg1")), int(request.number("arg2"))
        if self.motors.start(code, vertical, horizontal, now, flip=down > 0, mirror=right < 0):
            self._preset = 0
        return OK

    def _stop(self, request: Request, now: float) -> Answer:
        code = request.text("code")
        if code not in CODES and code not in self._codes:
            return refusal(self._profile)
        if self.loses_stops and self.motors.code == code:
            self.loses_stops -= 1
        else:
            self.motors.stop(code, now)
        return OK

    def _aim(self, request: Request, now: float) -> Answer:
        code = request.text("code") if request.action == "start" else request.action
        stand = aims.Stand(self._camera.lens, self.motors.pose(now), self.signs)
        aim = aims.read(request, code, self._profile, stand)
        if isinstance(aim, aims.Speeds):
            self.motors.turn(code, aim.axes(self.motors.rails), now, aim.seconds)
        elif aim is not None:
            self.motors.drive(aim.goal, now, code, aim.level)
        self._preset = self._preset if aim is None else 0
        return OK

    def _number(self, request: Request, key: str, most: int) -> int:
        number = int(request.number(key))
        if not 1 <= number <= most:
            raise ValueError(f"expected 1 to {most}, got {number}")
        return number

    def _goto_preset(self, request: Request, now: float) -> Answer:
        number = self._number(request, "arg2", self._profile.preset_max)
        if number not in self.presets:
            return OK if self._profile.unset_preset == "ok" else refusal(self._profile)
        self._preset = number
        self.motors.go(self.presets[number][1], now)
        return OK

    def _keep(self, request: Request, key: str, now: float) -> Answer:
        """Stores the pose; with a name where that is the argument after the number."""
        number = self._number(request, key, self._profile.preset_max)
        old = self.presets.get(number, (f"Preset{number}",))[0]
        name = request.text("arg2", old) if key == "arg1" else old
        self.presets[number] = (name, self.motors.pose(now))
        return OK

    def _clear_preset(self, request: Request, now: float) -> Answer:
        self.presets.pop(self._number(request, "arg2", self._profile.preset_max), None)
        return OK

    def _tour(self, request: Request, now: float) -> Answer:
        """ValueError where the firmware has no tours, or nothing to visit."""
        code, number = request.text("code"), self._number(request, "arg1", status.TOUR_MAX)
        if not self._profile.tours:
            raise ValueError("no tours")
        stops = self.tours.setdefault(number, [])
        if code == "AddTour":
            stops.append(self._number(request, "arg2", self._profile.preset_max))
        elif code == "DelTour":
            stops.remove(self._number(request, "arg2", self._profile.preset_max))
        elif code == "ClearTour":
            stops.clear()
        elif code == "StopTour":
            self.motors.stop("StartTour", now)
        else:
            poses = tuple(self.presets[preset][1] for preset in stops if preset in self.presets)
            self._begin_round(Round("StartTour", poses), now)
        self.tours = {number: stops for number, stops in self.tours.items() if stops}
        return OK

    def _scan(self, request: Request, now: float) -> Answer:
        """Between the limits that were set, or as far as it goes; accepted without effect by firmware without it."""
        code = request.text("code")
        if code in LIMITS:
            self._limits[code] = self.motors.pose(now)
        elif code in SCANS:
            self.motors.stop(SCANS[code], now)
        elif self._profile.auto_scan:
            self._begin_round(Round(code, self._ends(code, now), SCAN_LEVEL, 0.0), now)
        return OK

    def _ends(self, code: str, now: float) -> tuple[Pose, ...]:
        if code == "AutoScanOn":
            return tuple(self._limits.values())
        here = self.motors.pose(now)
        return tuple(here._replace(pan=edge) for edge in self._camera.pan_dead_arc)

    def _begin_round(self, what: Round, now: float) -> None:
        if not what.stops:
            raise ValueError("nowhere to go")
        self._preset = 0
        self.rounds.begin(what, now)

    def _status(self, request: Request, now: float) -> Answer:
        """All of it is of one lag ago, the position and whether it moves."""
        seen = now - self._latency.lag_s
        pose, rates = self.motors.pose(seen), self.motors.rates(seen)
        if self._profile.status_dither:
            pan, tilt = (value + self._dice.choice(DITHER) for value in pose[:2])
            pose = Pose(pan % 360.0, tilt, pose.zoom)
        moves = (bool(rates.pan or rates.tilt), bool(rates.zoom))
        if self._profile.move_status != "honest":
            stuck = self._profile.move_status == "stuck" and self.motors.worked(now).motions > 0
            moves = (stuck, False)
        return lines(status.status(self._profile, reading(pose), moves, self._preset))
