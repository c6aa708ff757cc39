"""What surfaces look like: a seeded picture of every side of every box, and of the floor, in 8-bit BGR.

`DENSITY` pixels to the metre. What is painted on them is in `looks`; here they get grain, shade and shadows.
"""

from __future__ import annotations

import zlib

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from services.simulators.camera.view.looks import DENSITY, LOOKS, Image
from services.simulators.true_camera import XY
from services.simulators.world import World

SHADES = {"top": 1.0, "front": 0.86, "back": 0.82, "left": 0.78, "right": 0.9, "bottom": 0.8}


def generator(seed: int, name: str) -> Generator:
    """A source of chance of its own for every surface, the same in every run."""
    return np.random.default_rng((seed, zlib.crc32(name.encode())))


def texture(look: str, side: str, size: XY, rng: Generator) -> Image:
    """The picture of one side of a box, `size` in metres; shaded as the ceiling's light falls."""
    height, width = (max(4, round(metres * DENSITY)) for metres in reversed(size))
    base, paint, grain = LOOKS.get(look, LOOKS["cupboard"])
    image = np.full((height, width, 3), base, np.uint8)
    paint(image, side, rng)
    return _grained(image, grain, SHADES[side], rng)


def _grained(image: Image, grain: float, shade: float, rng: Generator) -> Image:
    """Adds blotches and fine grain, and shades; walls and fronts get darker towards the floor."""
    height, width = image.shape[:2]
    coarse = rng.normal(0, grain, (height // 40 + 2, width // 40 + 2)).astype(np.float32)
    blotches = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    fine = rng.normal(0, grain * 0.6, (height, width)).astype(np.float32)
    lit = (image + (blotches + fine)[..., None]) * np.float32(shade)
    return np.clip(lit, 0, 255).astype(np.uint8)


def floor(world: World, origin: XY, size: XY, seed: int) -> Image:
    """The whole floor seen from above (north up), with the soft shadows of what stands on it."""
    rng = generator(seed, "floor")
    height, width = (round(metres * DENSITY) for metres in reversed(size))
    image = np.full((height, width, 3), (120, 156, 190), np.uint8)
    _planks(image, rng)
    tiles = np.full_like(image, (196, 200, 202))
    _tiles(tiles, rng)
    tiled = np.zeros((height, width), np.uint8)
    for name in ("Kitchen", "Bathroom"):
        if name in world.rooms:
            cv2.fillPoly(tiled, [_pixels(world.rooms[name].polygon, origin, height)], 255)
    cv2.copyTo(tiles, tiled, image)
    return _grained(_shadowed(image, world, origin), 3.0, 0.92, rng)


def _pixels(points: tuple[XY, ...] | NDArray[np.float64], origin: XY, height: int) -> NDArray[np.int32]:
    flat = (np.asarray(points, float) - origin) * DENSITY
    return np.round(np.stack([flat[:, 0], height - flat[:, 1]], axis=1)).astype(np.int32)


def _shadowed(image: Image, world: World, origin: XY) -> Image:
    light = np.full(image.shape[:2], 255, np.uint8)
    for piece in world.furniture:
        if piece.z < 0.2 and piece.kind != "rug":
            box = cv2.boxPoints(((0, 0), (piece.size[0] + 0.06, piece.size[1] + 0.06), piece.yaw_deg))
            cv2.fillPoly(light, [_pixels(np.add(box, (piece.x, piece.y)), origin, image.shape[0])], 130)
    soft = cv2.GaussianBlur(light, (0, 0), 0.06 * DENSITY)
    return cv2.multiply(image, cv2.merge([soft] * 3), scale=1 / 255)  # type: ignore[return-value]


def _planks(image: Image, rng: Generator) -> None:
    wide, long = round(0.14 * DENSITY), round(1.3 * DENSITY)
    for y in range(0, image.shape[0], wide):
        for x in range(-int(rng.integers(long)), image.shape[1], long):
            shift = rng.normal(0, 2, 3) + rng.normal(0, 8)
            board = image[y : y + wide, max(x, 0) : max(x + long, 0)]
            board[:] = np.clip(board + shift, 0, 255).astype(np.uint8)
            cv2.rectangle(image, (x, y), (x + long, y + wide), (88, 116, 144), 1)


def _tiles(image: Image, rng: Generator) -> None:
    side = round(0.3 * DENSITY)
    for y in range(0, image.shape[0], side):
        for x in range(0, image.shape[1], side):
            tile = image[y : y + side, x : x + side]
            tile[:] = np.clip(tile + rng.normal(0, 4), 0, 255).astype(np.uint8)
            cv2.rectangle(image, (x, y), (x + side, y + side), (150, 154, 156), 2)
