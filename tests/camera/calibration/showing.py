"""A whole calibration in virtual time: the real service and the simulated camera, and a person who holds a board."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from services.payloads import Calibration, OrderResult
from services.simulators.board import HeldBoard
from services.simulators.camera.settings import Config as CameraSimulator
from services.simulators.true_camera import Lens as TrueLens
from services.simulators.true_camera import WorldCamera
from services.simulators.world import World, load
from services.topics import CAMERA_CALIBRATION, CAMERA_ORDER_RESULT, read
from services.virtual import VirtualApartment
from services.vision.board import Board
from services.vision.lens import Lens
from tests.vision.boards import gestures, held

LONGEST_S = 900.0


def world_of(flat: VirtualApartment) -> World:
    """What is true in there."""
    simulator = flat.apartment.instances["simulated-camera"].config
    assert isinstance(simulator, CameraSimulator)
    return load(simulator.folder / simulator.world)


def true_lens(lens: TrueLens) -> Lens:
    """The simulator's lens in the formulas' words."""
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
    return Lens(lens.width, lens.height, matrix, np.array(lens.distortion))


def ordered(
    flat: VirtualApartment, key: str, value: Any, heard: Callable[[Calibration], None] = lambda _: None
) -> tuple[OrderResult, list[Calibration]]:
    """Gives an order and lets time pass until its end; `heard` is called at each word of a calibration."""
    flat.client.forget()
    told: list[Calibration] = []
    ends: list[OrderResult] = []

    def over() -> bool:
        for message in flat.client.pump():
            if message.topic == CAMERA_CALIBRATION.name(cam="ip1"):
                told.append(read(message, flat.now).payload)
                heard(told[-1])
            elif message.topic == CAMERA_ORDER_RESULT.name(cam="ip1"):
                answer = read(message, flat.now).payload
                if answer.key == key and answer.state in ("done", "failed", "refused", "cancelled"):
                    ends.append(answer)
        return bool(ends)

    flat.client.say(f"camera/ip1/order/{key}", value)
    assert flat.until(over, LONGEST_S), f"{key} has no end after {LONGEST_S:.0f} s"
    return ends[0], told


def person(flat: VirtualApartment, board: Board, rng: np.random.Generator) -> Callable[[Calibration], None]:
    """Somebody who holds the board elsewhere after each word."""
    camera: WorldCamera = world_of(flat).cameras["ip1"]
    pose, _ = flat.insides["ip1"].device.motion(flat.now)
    ways = _held(camera, camera.pose(pose.pan, pose.tilt), board, rng)
    hold = flat.insides["ip1"].pictures.hold
    hold("board", next(ways))
    return lambda heard: hold("board", next(ways) if heard.state == "running" else None)


def _held(camera: WorldCamera, pose: Any, board: Board, rng: np.random.Generator) -> Iterator[HeldBoard]:
    for spot, distance, turned in gestures(rng):
        yield held(pose, true_lens(camera.lens), board, spot, distance, turned)
