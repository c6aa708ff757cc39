"""`ptz.cgi`: start and stop, presets, status and capabilities, on top of the motors. Pure; the time comes in."""

from __future__ import annotations

from math import isfinite

from services.simulators.camera.config_tables import Tables
from services.simulators.camera.latency import Latency
from services.simulators.camera.messages import OK, Answer, Request, lines, refusal
from services.simulators.camera.motors import CODES, Motors, Pose, reading
from services.simulators.camera.profiles import Profile
from services.simulators.true_camera import WorldCamera

IDLE_CODES = ("FocusNear", "FocusFar", "IrisLarge", "IrisSmall")  # accepted; a fixed lens does nothing with them


class Ptz:
    """The motors, the presets, and what `ptz.cgi` does with them."""

    def __init__(self, camera: WorldCamera, profile: Profile, tables: Tables, latency: Latency, now: float) -> None:
        self._camera, self._profile, self._tables, self._latency = camera, profile, tables, latency
        self.motors = Motors(camera, profile, now)
        self.presets = {
            place.preset: (name, Pose(*camera.aim(place.looks_at), 0.0)) for name, place in camera.places.items()
        }
        self._preset = 0  # the last one gone to
        self.commands = 0  # that were to move something
        self._actions = {
            "start": self._start,
            "stop": self._stop,
            "setPreset": self._set_preset,
            "getStatus": self._status,
            "getPresets": self._presets,
            "getCurrentProtocolCaps": self._capabilities,
        }
        self._codes = {
            "GotoPreset": self._goto_preset,
            "SetPreset": self._set_preset,
            "ClearPreset": self._clear_preset,
            "PositionABS": self._go_absolute,
        }

    def answer(self, request: Request, now: float) -> Answer:
        """One request to `ptz.cgi`; arguments that are no numbers are refused."""
        act = self._actions.get(request.action)
        try:
            channel = int(request.number("channel", self._profile.ptz_channels[0]))
            if act is None or channel not in self._profile.ptz_channels:
                return refusal(self._profile)
            self.commands += not request.action.startswith("get")
            return act(request, now)
        except ValueError:
            return refusal(self._profile)

    def _start(self, request: Request, now: float) -> Answer:
        code = request.text("code")
        if code in self._codes:
            return self._codes[code](request, now)
        if code in IDLE_CODES:
            return OK
        if code not in CODES:
            return refusal(self._profile)
        inverts = self._profile.mirror_inverts_motors
        flip, mirror = (inverts and self._tables.flag(f"VideoInOptions[0].{key}") for key in ("Flip", "Mirror"))
        vertical, horizontal = int(request.number("arg1")), int(request.number("arg2"))
        if self.motors.start(code, vertical, horizontal, now, flip=flip, mirror=mirror):
            self._preset = 0
        return OK

    def _stop(self, request: Request, now: float) -> Answer:
        code = request.text("code")
        if code not in CODES and code not in self._codes and code not in IDLE_CODES:
            return refusal(self._profile)
        self.motors.stop(code, now)
        return OK

    def _number(self, request: Request) -> int:
        key = "arg1" if request.action == "setPreset" else "arg2"
        number = int(request.number(key))
        if not 1 <= number <= self._profile.preset_max:
            raise ValueError(f"preset {number}")
        return number

    def _goto_preset(self, request: Request, now: float) -> Answer:
        number = self._number(request)
        if number not in self.presets:
            return refusal(self._profile)
        self._preset = number
        self.motors.go(self.presets[number][1], now)
        return OK

    def _set_preset(self, request: Request, now: float) -> Answer:
        number = self._number(request)
        old = self.presets.get(number, (f"Preset{number}",))[0]
        name = request.text("arg2", old) if request.action == "setPreset" else old
        self.presets[number] = (name, self.motors.pose(now))
        return OK

    def _clear_preset(self, request: Request, now: float) -> Answer:
        self.presets.pop(self._number(request), None)
        return OK

    def _go_absolute(self, request: Request, now: float) -> Answer:
        """`arg1` is the travel, not the reading: asked for 180, the camera reads 0."""
        if self._profile.position_abs == "bad-request":
            return refusal(self._profile)
        here = self.motors.pose(now)
        goal = Pose((180.0 - request.number("arg1")) % 360.0, request.number("arg2"), request.number("arg3"))
        if not all(isfinite(value) for value in goal):
            return refusal(self._profile)
        goal = goal if self._profile.position_abs == "full" else goal._replace(tilt=here.tilt)
        self.motors.go(goal, now, "PositionABS")
        return OK

    def _status(self, request: Request, now: float) -> Answer:
        """All of it is of one lag ago, the position and whether it moves."""
        seen = now - self._latency.lag_s
        pan, tilt, zoom = reading(self.motors.pose(seen))
        moves, zooms = self._moving(seen)
        key, form = self._profile.position_key, self._profile.status_form
        at = [f"{key}[0]={pan:.6f}", f"{key}[1]={tilt:.6f}", f"{key}[2]={zoom:.6f}"]
        if form == "c":
            return lines(f"status.{line}" for line in (*at, "Zoom=0", f"ZoomValue={zoom:.0f}"))
        head = ["Action=Preset"]
        if form == "b":
            head = ["Focus.FocusPosition=1053.000000", "Focus.Status=Unknown", "Iris.IrisValue=4.000000"]
            head += ["Iris.Status=Idle"]
        tail = [f"PresetID={self._preset}", "Sequence=0", "UTC=0", f"ZoomStatus={zooms}"]
        tail += ["ZoomValue=170"] if form == "b" else []
        return lines(f"status.{line}" for line in (*head, f"MoveStatus={moves}", "PTS=0", *at, *tail))

    def _moving(self, seen: float) -> tuple[str, str]:
        rates = self.motors.rates(seen)
        return "Moving" if rates.pan or rates.tilt else "Idle", "Zooming" if rates.zoom else "Idle"

    def _presets(self, request: Request, now: float) -> Answer:
        stored = sorted(self.presets.items())
        pairs = ((f"Index={number}", f"Name={name}") for number, (name, _) in stored)
        return lines(f"presets[{i}].{text}" for i, pair in enumerate(pairs) for text in pair)

    def _capabilities(self, request: Request, now: float) -> Answer:
        low, high = self._camera.tilt_range
        values = {"AutoPan": "false", "AutoScan": "false", "Aux": "false", "Focus": "false", "Iris": "false"}
        values |= {"MoveAbsolutely": "false", "MoveRelatively": "false"}
        values |= {"Pan": "true", "PanSpeedMax": "8", "PanSpeedMin": "1", "Pattern": "false", "Preset": "true"}
        values |= {"PresetMax": str(self._profile.preset_max), "PresetMin": "1"}
        values |= {"PtzMotionRange.HorizontalAngle[0]": "0", "PtzMotionRange.HorizontalAngle[1]": "360"}
        values |= {"PtzMotionRange.VerticalAngle[0]": f"{low:.0f}", "PtzMotionRange.VerticalAngle[1]": f"{high:.0f}"}
        values |= {"Tile": "true", "TileSpeedMax": "8", "TileSpeedMin": "1"}  # "Tile" is the firmware's spelling
        values |= {"Tour": "false", "Zoom": "true"}
        return lines(f"caps.{key}={value}" for key, value in values.items())
