"""The camera's inside: identity, configuration, motors and what its programs answer. No network; the time comes in."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from random import Random
from threading import RLock
from typing import Literal

from services.simulators.camera.clock import Clock
from services.simulators.camera.config_tables import Tables
from services.simulators.camera.events import CODES, Events
from services.simulators.camera.identity import Identity
from services.simulators.camera.latency import Latency
from services.simulators.camera.messages import OK, Answer, Request, lines, refusal, refuses_brackets
from services.simulators.camera.motion import MotionDetector
from services.simulators.camera.motors import Pose
from services.simulators.camera.profiles import Profile
from services.simulators.camera.ptz import Ptz
from services.simulators.camera.sound import Microphone, Speaker
from services.simulators.true_camera import WorldCamera

Program = Callable[[Request, float], Answer]


class Device:
    """One camera; safe for several threads, each call is one step."""

    def __init__(self, camera: WorldCamera, profile: Profile, now: float, latency: Latency | None = None) -> None:
        self.camera, self.profile = camera, profile
        self.latency = latency or Latency(profile, None, Random(1))
        self.tables = Tables(profile, camera.lens)
        self.ptz = Ptz(camera, profile, self.tables, self.latency, now)
        self.events, self.detector = Events(profile), MotionDetector(self.tables)
        self.identity, self.clock = Identity(profile, camera.serial, self.tables), Clock(now)
        self.microphone, self.speaker = Microphone(seed=1), Speaker()
        self.boots_until = float("-inf")
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
            "IntervideoManager": self.identity.versions,
            "storageDevice": self.identity.storage,
            "devAudioInput": self.identity.sound_devices,
            "devAudioOutput": self.identity.sound_devices,
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

    def rest(self) -> Pose | None:
        """Where the last motion ends, or has ended; None: when somebody stops it."""
        with self._lock:
            ends = self.ptz.motors.rests_at
            return self.ptz.motors.pose(ends + 1.0) if isfinite(ends) else None

    def place(self, pose: Pose, now: float) -> None:
        """Puts the motors there at once (the side door)."""
        with self._lock:
            self.ptz.motors.place(pose, now)

    def step(self, act: Callable[[], Answer]) -> Answer:
        """Something that another program of the camera does, undisturbed by the others."""
        with self._lock:
            return act()

    def watch(self, now: float) -> None:
        """Looks for motion; to be called several times a second."""
        with self._lock:
            rates = self.ptz.motors.rates(now)
            change = None if self.booting(now) else self.detector.update(now, turning=any(rates))
        if change is not None:
            self.events.tell("VideoMotion", change)

    def drops_snapshot(self) -> Literal["close", "text"] | None:
        """Whether this snapshot has no answer, or one that is no picture, as happens with some firmware."""
        if self._dice.random() >= self.profile.snapshot_drop:
            return None
        return self._dice.choice(("close", "text"))

    def booting(self, now: float) -> bool:
        """Whether it is restarting and answers nobody."""
        return now < self.boots_until

    def _magic_box(self, request: Request, now: float) -> Answer:
        if request.action in ("reboot", "shutdown"):  # some models come up again after a shutdown too
            return self.reboot(now)
        return self.identity.magic_box(request, now)

    def reboot(self, now: float) -> Answer:
        """Presets and configuration stay; the motors return to where they are after power-on."""
        self.boots_until = now + self.profile.boot_s
        self.latency.drowsy_until = self.boots_until + self.profile.drowsy_s
        self.ptz.motors.place(Pose(*self.camera.starts_at), now)
        self.events.forget()
        self.detector.forget()
        return OK

    def _global(self, request: Request, now: float) -> Answer:
        if request.action == "getCurrentTime":
            return lines([f"result={self.clock.tell(now)}"])
        return (
            self._set_time(request.text("time"), now) if request.action == "setCurrentTime" else refusal(self.profile)
        )

    def _set_time(self, text: str, now: float) -> Answer:
        """Answered alike whether the text was understood or not; what it does not read as a time changes nothing."""
        before = self.clock.tell(now)
        if self.clock.put(text, now):
            self.events.tell("TimeChange", "Pulse", data={"BeforeModifyTime": before, "ModifiedTime": text})
        return OK

    def _config_manager(self, request: Request, now: float) -> Answer:
        if request.action == "getTours":
            return self.ptz.list_tours()
        if request.action == "setConfig":
            return self._write([(key, value) for key, value in request.query if key != "action"], now)
        found = self.tables.read(request.text("name")) if request.action == "getConfig" else None
        return refusal(self.profile) if found is None else lines(found)

    def _write(self, pairs: list[tuple[str, str]], now: float) -> Answer:
        covered = self.tables.covered
        if not self.tables.write(pairs, now):
            return refusal(self.profile)
        if self.tables.covered != covered:
            self.events.tell("LensMaskOpen" if self.tables.covered else "LensMaskClose", "Pulse")
        return OK

    def _event_manager(self, request: Request, now: float) -> Answer:
        if request.action == "getCaps":
            return lines(f"caps.Events[{i}]={code}" for i, code in enumerate(CODES))
        if request.action != "getEventIndexes":
            return refusal(self.profile)
        channels = self.events.active(request.text("code"))
        return lines(f"channels[{i}]={c}" for i, c in enumerate(channels)) if channels else lines(["Error: No Events"])
