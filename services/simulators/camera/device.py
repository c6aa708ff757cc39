"""The camera's inside: identity, configuration, motors and what its programs answer. No network; the time comes in."""

from __future__ import annotations

import time
from collections.abc import Callable
from random import Random
from threading import RLock
from typing import Literal

from services.simulators.camera.config_tables import Tables
from services.simulators.camera.events import Events
from services.simulators.camera.latency import Latency
from services.simulators.camera.messages import OK, Answer, Request, lines, refusal, refuses_brackets
from services.simulators.camera.motors import Pose
from services.simulators.camera.profiles import Profile
from services.simulators.camera.ptz import Ptz
from services.simulators.true_camera import WorldCamera

Program = Callable[[Request, float], Answer]


class Device:
    """One camera; safe for several threads, each call is one step."""

    def __init__(self, camera: WorldCamera, profile: Profile, now: float, latency: Latency | None = None) -> None:
        self.camera, self.profile = camera, profile
        self.latency = latency or Latency(profile, None, Random(1))
        self.tables = Tables(profile, camera.lens)
        self.ptz = Ptz(camera, profile, self.tables, self.latency, now)
        self.events = Events()
        self.boots_until = float("-inf")
        self.clock_offset_s = 0.0  # how far its clock is ahead of the true time
        self.rights = True  # whether the account may do more than look
        self._dice = Random(camera.serial)
        self._lock = RLock()
        self._programs: dict[str, Program] = {
            "magicBox": self._magic_box,
            "global": self._global,
            "configManager": self._config_manager,
            "eventManager": self._event_manager,
            "ptz": self.ptz.answer,
            "ptzBase": self.ptz.answer,
        }

    def answer(self, request: Request, now: float) -> Answer:
        """One request with a short answer."""
        if refuses_brackets(self.profile, request.target):
            return Answer(b"Error\r\nBad Request!\r\n", 400)
        if not self.rights and (request.cgi.startswith("ptz") or request.action in ("setConfig", "reboot")):
            return Answer(b"Error\r\nInvalid Authority!\r\n", 401)
        with self._lock:
            program = self._programs.get(request.cgi)
            return program(request, now) if program else Answer(b"", 404)

    def motion(self, now: float) -> tuple[Pose, Pose]:
        """The true pose, and how fast each reading changes (degrees/s, levels/s)."""
        with self._lock:
            self.ptz.rounds.advance(now)
            return self.ptz.motors.pose(now), self.ptz.motors.rates(now)

    def place(self, pose: Pose, now: float) -> None:
        """Puts the motors there at once (the side door)."""
        with self._lock:
            self.ptz.motors.place(pose, now)

    def step(self, act: Callable[[], Answer]) -> Answer:
        """Something that another program of the camera does, undisturbed by the others."""
        with self._lock:
            return act()

    def drops_snapshot(self) -> Literal["close", "text"] | None:
        """Whether this snapshot has no answer, or one that is no picture, as happens with some firmware."""
        if self._dice.random() >= self.profile.snapshot_drop:
            return None
        return self._dice.choice(("close", "text"))

    def booting(self, now: float) -> bool:
        """Whether it is restarting and answers nobody."""
        return now < self.boots_until

    def _magic_box(self, request: Request, now: float) -> Answer:
        profile = self.profile
        version = [f"version={profile.firmware}", f"BuildDate={profile.built}"]
        if profile.version_form == "one line":
            version = [f"version={profile.firmware},build:{profile.built}"]
        facts = {
            "getDeviceType": [f"type={profile.model}"],
            "getSerialNo": [f"sn={self.camera.serial}"],
            "getSoftwareVersion": version,
            "getMachineName": [f"name={self.tables.text('General.MachineName')}"],
            "getVendor": ["vendor=Amcrest"],
        }
        if request.action == "reboot":
            return self.reboot(now)
        return lines(facts[request.action]) if request.action in facts else refusal(profile)

    def reboot(self, now: float) -> Answer:
        """Presets and configuration stay; the motors return to where they are after power-on."""
        self.boots_until = now + self.profile.boot_s
        self.latency.drowsy_until = self.boots_until + self.profile.drowsy_s
        self.ptz.motors.place(Pose(*self.camera.starts_at), now)
        return OK

    def _global(self, request: Request, now: float) -> Answer:
        if request.action != "getCurrentTime":
            return refusal(self.profile)
        return lines([f"result={time.strftime('%Y-%m-%d %H:%M:%S', time.localtime(now + self.clock_offset_s))}"])

    def _config_manager(self, request: Request, now: float) -> Answer:
        if request.action == "getTours":
            return self.ptz.list_tours()
        if request.action == "setConfig":
            pairs = [(key, value) for key, value in request.query if key != "action"]
            return OK if self.tables.write(pairs) else refusal(self.profile)
        found = self.tables.read(request.text("name")) if request.action == "getConfig" else None
        return refusal(self.profile) if found is None else lines(found)

    def _event_manager(self, request: Request, now: float) -> Answer:
        if request.action != "getEventIndexes":
            return refusal(self.profile)
        channels = self.events.active(request.text("code"))
        return lines(f"channels[{i}]={c}" for i, c in enumerate(channels)) if channels else lines(["Error: No Events"])
