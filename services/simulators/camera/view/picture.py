"""What the camera makes of the scene: exposure while turning, noise, colour, flips, digital zoom and JPEG.

How much light there is, and how noisy that makes the picture, is in `sensor`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from threading import Lock
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from services.simulators.board import HeldBoard
from services.simulators.camera.config_tables import Tables
from services.simulators.camera.motors import Pose, magnification
from services.simulators.camera.view import sensor
from services.simulators.camera.view.optics import Window, project, window
from services.simulators.camera.view.prints import Image
from services.simulators.camera.view.scene import Scene
from services.simulators.camera.view.tally import Tally
from services.simulators.true_camera import WorldCamera
from services.vision.frames import Array

Stream = Literal["MainFormat", "ExtraFormat"]
STREAMS: tuple[Stream, ...] = ("MainFormat", "ExtraFormat")
EXPOSURE_S = 1 / 30  # indoors, by lamp light
GRAIN = 24  # steps of the noise pattern's grain in one sigma
NOISE_PLAY = 64  # pixels by which the noise pattern is shifted from frame to frame
QUALITY = 88
SETTLING_S, DARK = 1.5, 0.25  # a change of mode: how long, and how dark at first; inferred
AHEAD_M = 3.0  # distance at which the blur of a turn is taken
SMEAR_PX, COARSEST = 2.0, 4  # what a turn smears is drawn so coarse that it is smeared over this many pixels still


@dataclass(frozen=True)
class Still:
    """A noiseless picture and what it shows."""

    pose: Pose
    window: Window
    image: Image
    boards: int  # how often they had been moved


class Pictures:
    """The newest picture of each stream as JPEG; the same one until the next frame is due. For several threads."""

    def __init__(
        self,
        scene: Scene,
        camera: WorldCamera,
        tables: Tables,
        motors: Callable[[float], tuple[Pose, Pose]],
        rest: Callable[[], Pose | None],
        seed: int,
    ) -> None:
        self._scene, self._camera, self._tables, self._motors, self._rest = scene, camera, tables, motors, rest
        self._lock = Lock()
        self._stills: dict[Stream, Still] = {}
        self._ahead: dict[Stream, Still] = {}
        self._goals: dict[Stream, Pose | None] = {}
        self._newest: dict[Stream, tuple[object, bytes]] = {}
        self._rng = np.random.default_rng(seed)
        self.lux = scene.world.light
        self._tallies: dict[Stream, Tally] = {stream: Tally() for stream in STREAMS}

    @cached_property
    def _noise(self) -> NDArray[np.int8]:
        size = (self._camera.lens.height + NOISE_PLAY, self._camera.lens.width + NOISE_PLAY, 3)
        return (self._rng.standard_normal(size, dtype=np.float32) * sensor.NOISE).round().astype(np.int8)

    @cached_property
    def _grain(self) -> NDArray[np.int8]:
        """Fine enough to be amplified; from dice of its own, so that pictures in good light do not depend on it."""
        pattern = self._rng.spawn(1)[0].standard_normal(self._noise.shape, dtype=np.float32)
        return np.clip((pattern * GRAIN).round(), -127, 127).astype(np.int8)

    def fps(self, stream: Stream) -> int:
        """Frames per second of a stream."""
        return min(max(self._tables.number(f"Encode[0].{stream}[0].Video.FPS"), 1), 30)

    def size(self, stream: Stream) -> tuple[int, int]:
        """Width and height of a stream's pictures."""
        video = f"Encode[0].{stream}[0].Video."
        return self._tables.number(video + "Width"), self._tables.number(video + "Height")

    def rates(self) -> dict[str, dict[str, float]]:
        """How many pictures of each stream were made, and how many a second lately."""
        return {
            "frames_rendered": {stream: tally.frames for stream, tally in self._tallies.items()},
            "fps": {stream: tally.fps() for stream, tally in self._tallies.items()},
        }

    def frame(self, stream: Stream, now: float) -> Image:
        """The picture of this moment (BGR), made anew."""
        with self._lock:
            return self._developed(stream, *self._motors(now), self.light(now))

    def ahead(self, stream: Stream) -> None:
        """Draws what the camera will see at rest, where its firmware drives it to: a machine that needs longer for a
        picture than a frame lasts is late in the turn then, where pictures are smeared, and not at its end. Not in a
        turn's first moment either, which tells when it began.
        """
        with self._lock:
            pose, before = self._rest(), self._goals.get(stream)
            self._goals[stream] = pose
            if pose is not None and pose == before and not self._tables.covered:
                view = self._window(pose, self.size(stream))
                if self._kept(stream, pose, view) is None:
                    self._ahead[stream] = self._drawn(pose, view)

    def jpeg(self, stream: Stream, now: float) -> bytes:
        """The picture of this moment, encoded."""
        with self._lock:
            pose, rates = self._motors(now)
            moved = self._scene.changes
            exposure = self.light(now)
            key = (pose, self._tables.changes, self.lux, exposure, int(now * self.fps(stream)), moved)
            if stream not in self._newest or self._newest[stream][0] != key:
                self._newest[stream] = key, _encoded(self._developed(stream, pose, rates, exposure))
            return self._newest[stream][1]

    def hold(self, name: str, board: HeldBoard | None) -> None:
        """Somebody holds a board there from now on, or (None) puts it away."""
        with self._lock:
            self._scene.hold(name, board)

    def shine(self, lux: float, now: float) -> None:
        """Somebody switches lamps on or off: there is so much light from now on."""
        with self._lock:
            self.lux = lux
            self._tables.expose(now)

    def light(self, now: float) -> float:
        """How bright the picture is, of 1: a change of mode or light starts dark, and settles in SETTLING_S as bright
        as the sensor can make it."""
        since, share = now - self._tables.exposed_at, sensor.light(self.lux, self._tables).share
        return share if not 0.0 <= since < SETTLING_S else share * (DARK + (1.0 - DARK) * since / SETTLING_S)

    def _developed(self, stream: Stream, pose: Pose, rates: Pose, exposure: float) -> Image:
        self._tallies[stream].note()
        size = self.size(stream)
        if self._tables.covered:
            return np.zeros((size[1], size[0], 3), np.uint8)
        view = self._window(pose, size)
        sweep = self._sweep(pose, rates, view)
        still = self._still(stream, pose, coarser(view, sweep))
        image = blurred(still.image, sweep * still.window.scale / view.scale)
        image = _resized(image, (view.width, view.height))
        image = image if exposure == 1.0 else np.asarray(cv2.convertScaleAbs(image, alpha=exposure), np.uint8)
        light = sensor.light(self.lux, self._tables)
        image = _resized(self._noisy(image, light.gain), size)
        return upright(self._toned(image, grey=light.grey), self._camera, self._tables)

    def _window(self, pose: Pose, size: tuple[int, int]) -> Window:
        """What the picture shows, never finer than the sensor."""
        zoom, lens = magnification(pose.zoom), self._camera.lens
        width, height = min(size[0], round(lens.width / zoom)), min(size[1], round(lens.height / zoom))
        return window(lens, zoom, width, height)

    def _still(self, stream: Stream, pose: Pose, view: Window) -> Still:
        """Drawn anew only when the camera has moved."""
        self._stills[stream] = self._kept(stream, pose, view) or self._drawn(pose, view)
        return self._stills[stream]

    def _kept(self, stream: Stream, pose: Pose, view: Window) -> Still | None:
        kept = [stills[stream] for stills in (self._stills, self._ahead) if stream in stills]
        shows = (pose, view, self._scene.changes)
        return next((still for still in kept if (still.pose, still.window, still.boards) == shows), None)

    def _drawn(self, pose: Pose, view: Window) -> Still:
        image = self._scene.draw(self._camera.pose(pose.pan, pose.tilt), view)
        return Still(pose, view, image, self._scene.changes)

    def _sweep(self, pose: Pose, rates: Pose, view: Window) -> Array:
        """How many pixels the middle of the picture moves during an exposure."""
        if not rates.pan and not rates.tilt:
            return np.zeros(2)
        pans = (pose.pan + rates.pan * EXPOSURE_S, pose.tilt + rates.tilt * EXPOSURE_S)
        ahead = self._camera.pose(pose.pan, pose.tilt).apply(np.array([[0.0, 0.0, AHEAD_M]]))
        was, comes = (
            view.from_sensor(project(self._camera.pose(*at).inverse().apply(ahead), self._camera.lens))[0]
            for at in ((pose.pan, pose.tilt), pans)
        )
        return np.asarray(comes - was)

    def _noisy(self, image: Image, gain: float) -> Image:
        height, width = image.shape[:2]
        y, x = (int(i) for i in self._rng.integers(NOISE_PLAY, size=2))
        spot = slice(y, y + height), slice(x, x + width)
        if gain == 1.0:
            return np.asarray(cv2.add(image, self._noise[spot], dtype=cv2.CV_8U), np.uint8)
        sigma = cv2.LUT(image, sensor.noise(gain))
        patch = cv2.multiply(sigma, self._grain[spot], scale=1 / GRAIN, dtype=cv2.CV_32F)
        return np.asarray(cv2.add(image, patch, dtype=cv2.CV_8U), np.uint8)

    def _toned(self, image: Image, *, grey: bool) -> Image:
        """Black and white, saturation, contrast and brightness as the tables say."""
        settings = {key: self._tables.tone(key) for key in ("Brightness", "Contrast", "Saturation")}
        saturation = 0 if grey else settings["Saturation"]
        if saturation != 50:
            plain = cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
            image = np.asarray(cv2.addWeighted(image, saturation / 50, plain, 1 - saturation / 50, 0), np.uint8)
        if settings["Contrast"] == settings["Brightness"] == 50:
            return image
        gain, shift = 2 ** ((settings["Contrast"] - 50) / 50), (settings["Brightness"] - 50) * 1.2
        curve = np.clip((np.arange(256) - 128) * gain + 128 + shift, 0, 255).astype(np.uint8)
        return np.asarray(cv2.LUT(image, curve), np.uint8)


def upright(image: Image, camera: WorldCamera, tables: Tables) -> Image:
    """The picture as the flip and mirror options give it; a ceiling camera's sensor is upside down without them."""
    turned = camera.mount.kind == "ceiling"
    rows = -1 if tables.flag("VideoInOptions[0].Flip") != turned else 1
    columns = -1 if tables.flag("VideoInOptions[0].Mirror") != turned else 1
    return np.ascontiguousarray(image[::rows, ::columns])


def coarser(view: Window, sweep: Array) -> Window:
    """The same with larger pixels where the sweep (pixels) hides what finer ones would show: a machine that has other
    work keeps the frame rate in a turn."""
    length, parts = float(np.hypot(*sweep)), 1
    while parts < COARSEST and length / parts >= 2 * SMEAR_PX:
        parts *= 2
    return replace(view, width=view.width // parts, height=view.height // parts)


def blurred(image: Image, sweep: Array) -> Image:
    """The mean over the sweep (pixels): halving steps, each the mean of the picture and itself moved."""
    length = float(np.hypot(*sweep))
    while length > 1.0:
        sweep, length = sweep / 2, length / 2
        move = np.array([[1, 0, sweep[0]], [0, 1, sweep[1]]])
        size = (image.shape[1], image.shape[0])
        moved = cv2.warpAffine(image, move, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        image = np.asarray(cv2.addWeighted(image, 0.5, moved, 0.5, 0), np.uint8)
    return image


def _resized(image: Image, size: tuple[int, int]) -> Image:
    if (image.shape[1], image.shape[0]) == size:
        return image
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_LINEAR), np.uint8)


def _encoded(image: Image) -> bytes:
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return data.tobytes()
