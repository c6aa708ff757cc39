"""The apartment as the lens sees it: floor, ceiling, boxes and printed markers, without noise.

Boxes are drawn from front to back, each where nothing stands before it, into a pinhole picture, which is then bent as
the lens bends it; the markers are drawn into the bent picture, exactly (`prints`). What the camera makes of it (noise,
colour, JPEG) is in `picture`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from cv2.typing import MatLike

from services.simulators.board import HeldBoard
from services.simulators.camera.view import boards, prints
from services.simulators.camera.view.looks import DENSITY
from services.simulators.camera.view.optics import Float32, Window, rays
from services.simulators.camera.view.order import Indexes, Order
from services.simulators.camera.view.prints import Image, View
from services.simulators.camera.view.solids import SIDES, boxes
from services.simulators.camera.view.textures import floor, generator, texture
from services.simulators.true_camera import Lens
from services.simulators.world import World
from services.vision.frames import Array, Transform

NEAR_M = 0.05  # nothing nearer to the lens is drawn
LIT_GREY = 214  # what is seen past everything: daylight
WINDOWS = 7  # kept ready: main stream and substream, each also coarser in a turn, and a zoomed one
BAND_PX = 96
FINE = 16  # cv2's polygons in sixteenths of a pixel


@dataclass(frozen=True)
class Surface:
    """A textured parallelogram in the apartment: top left corner, edges right and down, its picture in sizes."""

    corner: Array
    right: Array
    down: Array
    sizes: tuple[Image, ...]


@dataclass(frozen=True)
class Pinhole:
    """The undistorted picture that surfaces are drawn into: focal length, middle; `free`: where nothing is yet."""

    image: Image
    matrix: Array
    free: Image


@dataclass(frozen=True)
class Bend:
    """How the pinhole picture of `size` (rows, columns) is bent for one window: where each pixel comes from."""

    rays: Float32
    where: tuple[MatLike, MatLike]
    matrix: Array
    size: tuple[int, int]


def bend(lens: Lens, window: Window) -> Bend:
    """The pinhole picture is just large enough for every ray of the window, with the window's focal length."""
    ways, focal = rays(lens, window), lens.fx * window.scale
    low, high = (np.array([edge(ways[..., 0]), edge(ways[..., 1])]) for edge in (np.min, np.max))
    width, height = np.ceil((high - low) * focal).astype(int) + 3
    matrix = np.array([[focal, 0, 1 - low[0] * focal], [0, focal, 1 - low[1] * focal], [0, 0, 1]], float)
    x, y = (ways[..., i] * np.float32(focal) + np.float32(matrix[i, 2]) for i in (0, 1))
    where = cv2.convertMaps(x, y, cv2.CV_16SC2)
    return Bend(ways, where, matrix, (int(height), int(width)))


class Scene:
    """Draws pictures of one world. Not for several threads at once."""

    def __init__(self, world: World, lens: Lens, seed: int) -> None:
        self.world, self.lens, self.seed = world, lens, seed
        self.boxes = boxes(world)
        self.order = Order(self.boxes)
        self._surfaces: dict[tuple[int, int], Surface] = {}
        self._bends: dict[Window, Bend] = {}
        self.boards = dict(world.boards)
        self.changes = 0  # of the boards
        self._room: tuple[tuple[bytes, bytes, Window], Image, View] | None = None

    def hold(self, name: str, board: HeldBoard | None) -> None:
        """Somebody holds a board there from now on, or (None) puts it away."""
        self.boards.pop(name, None)
        self.boards.update({} if board is None else {name: board})
        self.changes += 1

    def draw(self, pose: Transform, window: Window) -> Image:
        """The upright picture (BGR) from `T_AC` of what the window of the sensor shows."""
        key = (pose.rotation.tobytes(), pose.translation.tobytes(), window)
        if self._room is None or self._room[0] != key:  # a board that is moved does not change the room behind it
            self._room = (key, *self._drawn(pose, window))
        _, room, view = self._room
        image = room.copy()
        for board in self.boards.values():
            boards.draw(image, board, view, self.boxes)
        return cv2.GaussianBlur(image, (3, 3), 0.5)  # type: ignore[return-value]

    def _drawn(self, pose: Transform, window: Window) -> tuple[Image, View]:
        """The room with its markers, without boards, and how it is seen."""
        if window not in self._bends:
            self._bends = {window: bend(self.lens, window), **dict(list(self._bends.items())[: WINDOWS - 1])}
        how = self._bends[window]
        flat = np.full((*how.size, 3), LIT_GREY, np.uint8)
        self._draw_all(Pinhole(flat, how.matrix, np.full(how.size, 255, np.uint8)), pose)
        image = np.asarray(cv2.remap(flat, *how.where, cv2.INTER_LINEAR), np.uint8)
        view = View(pose, self.lens, window, how.rays)
        for marker in self.world.markers:
            prints.draw(image, marker, view, self.boxes)
        return image, view

    def _draw_all(self, flat: Pinhole, pose: Transform) -> None:
        to_camera = pose.inverse()
        chosen, faces = self._in_view(flat, to_camera), self.order.facing(pose.translation)
        for index in reversed(self.order.back_to_front(chosen, pose.translation)):
            for side in np.flatnonzero(faces[index])[::-1]:
                draw_surface(flat, self._surface(index, int(side)), to_camera)
        for surface in reversed(self._floor_and_ceiling):
            draw_surface(flat, surface, to_camera)

    def _in_view(self, flat: Pinhole, to_camera: Transform) -> Indexes:
        """The boxes that are not wholly behind or beside the picture."""
        points = to_camera.apply(self.order.corners) @ flat.matrix.T
        x, y, z = np.moveaxis(points, -1, 0)
        height, width = flat.image.shape[:2]
        beside = [z < NEAR_M, x < 0, y < 0, x > width * z, y > height * z]
        return np.flatnonzero(~np.any([side.all(axis=1) for side in beside], axis=0))

    def _surface(self, index: int, side: int) -> Surface:
        if (index, side) not in self._surfaces:
            box, (corner, right, down) = self.boxes[index], self.order.sides[index, side]
            size = (float(np.linalg.norm(right)), float(np.linalg.norm(down)))
            image = texture(box.look, SIDES[side], size, generator(self.seed, f"{box.name} {side}"))
            self._surfaces[index, side] = Surface(corner, right, down, halving(image))
        return self._surfaces[index, side]

    @cached_property
    def _floor_and_ceiling(self) -> list[Surface]:
        low, high = self.order.corners.min(axis=(0, 1)), self.order.corners.max(axis=(0, 1))
        x, y, _ = np.diag(high - low)
        image = floor(self.world, (float(low[0]), float(low[1])), (float(x[0]), float(y[1])), self.seed)
        over = texture("ceiling", "bottom", (1.0, 1.0), generator(self.seed, "ceiling"))
        return [
            Surface(np.array([low[0], high[1], 0.0]), x, -y, halving(image)),
            Surface(np.array([low[0], low[1], high[2]]), x, y, halving(over)),
        ]


def halving(image: Image) -> tuple[Image, ...]:
    """The picture, at half its size, at a quarter, and so on."""
    sizes = [image]
    while min(sizes[-1].shape[:2]) >= 8 and len(sizes) < 6:
        half = (sizes[-1].shape[1] // 2, sizes[-1].shape[0] // 2)
        sizes.append(cv2.resize(sizes[-1], half, interpolation=cv2.INTER_AREA))  # type: ignore[arg-type]
    return tuple(sizes)


def draw_surface(flat: Pinhole, surface: Surface, to_camera: Transform) -> None:
    """Draws a surface where the pinhole picture is free; there it is free no more."""
    corner = to_camera.apply(surface.corner)
    right, down = to_camera.rotation @ surface.right, to_camera.rotation @ surface.down
    outline = before_camera(np.array([corner, corner + right, corner + right + down, corner + down]))
    if len(outline) < 3:
        return
    pixels = outline @ flat.matrix.T
    pixels = np.clip(pixels[:, :2] / pixels[:, 2:], -30000, 30000)
    (height, width), least, most = flat.image.shape[:2], pixels.min(axis=0), pixels.max(axis=0)
    x0, y0 = max(int(least[0]), 0), max(int(least[1]), 0)
    x1, y1 = min(int(most[0]) + 2, width), min(int(most[1]) + 2, height)
    if x0 >= x1 or y0 >= y1:
        return
    mask = np.zeros((y1 - y0, x1 - x0), np.uint8)
    cv2.fillConvexPoly(mask, np.round((pixels - (x0, y0)) * FINE).astype(np.int32), 255, cv2.LINE_8, 4)
    free = flat.free[y0:y1, x0:x1]
    cv2.bitwise_and(mask, free, mask)
    cv2.subtract(free, mask, free)
    image = _fitting(surface, outline, flat.matrix[0, 0])
    to_pixels = flat.matrix @ np.column_stack([right, down, corner]) @ _from_texture(image)
    for row in range(0, y1 - y0, BAND_PX):  # in bands, because a slanting surface fills little of its frame
        x, y, width, height = cv2.boundingRect(mask[row : row + BAND_PX])
        if width:
            inside = mask[row + y : row + y + height, x : x + width]
            spot = flat.image[y0 + row + y :, x0 + x :][:height, :width]
            shift = np.array([[1, 0, -x0 - x], [0, 1, -y0 - row - y], [0, 0, 1]], float)
            patch = cv2.warpPerspective(image, shift @ to_pixels, (width, height), borderMode=cv2.BORDER_REPLICATE)
            cv2.copyTo(patch, inside, spot)


def before_camera(polygon: Array) -> Array:
    """The part of a polygon (n, 3) that lies before the camera (Sutherland-Hodgman against one plane)."""
    kept = []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if a[2] >= NEAR_M:
            kept.append(a)
        if (a[2] >= NEAR_M) != (b[2] >= NEAR_M):
            kept.append(a + (b - a) * ((NEAR_M - a[2]) / (b[2] - a[2])))
    return np.array(kept).reshape(-1, 3)


def _fitting(surface: Surface, outline: Array, focal: float) -> Image:
    """The size of the texture whose pixels are about as large as those of the picture, at the outline's middle."""
    per_metre = focal / outline[:, 2].mean()
    level = int(np.clip(np.round(np.log2(max(DENSITY / per_metre, 1e-3))), 0, len(surface.sizes) - 1))
    return surface.sizes[level]


def _from_texture(image: Image) -> Array:
    """Texture pixels (their centres are whole numbers) to fractions of the surface."""
    height, width = image.shape[:2]
    return np.array([[1 / width, 0, 0.5 / width], [0, 1 / height, 0.5 / height], [0, 0, 1]])
