"""Printed markers, drawn into a finished picture exactly: each pixel is the mean of the print over its area."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from services.simulators.camera.view.optics import Float32, Window, project
from services.simulators.camera.view.solids import Box
from services.simulators.true_camera import Lens
from services.simulators.world import Marker
from services.vision.frames import Array, Transform

Image = NDArray[np.uint8]
INK, PAPER = 28.0, 232.0  # grey of toner and of paper in a lit room
MARGIN = 1  # modules of white around the black square
SAMPLES_TARGET = 250_000  # sub-samples of one marker, which sets how finely each pixel is divided
PAD = 2
NEAR_M = 0.05
LIFT_M = 1e-4  # so that what it lies on does not hide it


@dataclass(frozen=True)
class View:
    """What a camera sees from where: `T_AC`, lens, window and the ray of every pixel."""

    pose: Transform
    lens: Lens
    window: Window
    rays: Float32

    def pixels(self, points: Array) -> Array:
        """Picture pixels (n, 2) of points (n, 3) of the apartment that lie before the camera."""
        return self.window.from_sensor(project(self.pose.inverse().apply(points), self.lens))


@lru_cache(maxsize=64)
def modules(marker_id: int) -> Float32:
    """Greys of the print of a DICT_5X5_1000 marker, row 0 at its top, with MARGIN white modules around."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_1000)
    bits = cv2.aruco.generateImageMarker(dictionary, marker_id, 7)
    return np.where(np.pad(bits, MARGIN, constant_values=255) > 127, PAPER, INK).astype(np.float32)


def paper(marker: Marker) -> Array:
    """The corners (4, 3) of the sheet in the apartment: top left, top right, bottom right, bottom left."""
    half = marker.size / 2 * (7 + 2 * MARGIN) / 7
    corners = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
    return marker.pose.apply(corners)


def corners(marker: Marker) -> Array:
    """The corners (4, 3) of the black square in the apartment, in the order in which detectors give them."""
    half = marker.size / 2
    return marker.pose.apply(np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]]))


def draw(image: Image, marker: Marker, view: View, boxes: list[Box]) -> None:
    """Draws a marker into the picture, where it faces the camera and nothing stands before it."""
    patch = rows_and_columns(marker.pose, paper(marker), view)
    if patch is None:
        return
    rays, near = view.rays[patch], [box for box in boxes if box.may_hide(view.pose.translation, paper(marker))]
    grey, cover = _averaged(marker, view, rays)
    cover *= free(marker.pose, view, rays, near)
    laid(image[patch], grey, cover)


def laid(spot: Image, grey: Float32, cover: Float32) -> None:
    """Lays greys over a part of a picture where they cover it."""
    spot[:] = np.round(spot * (1 - cover)[..., None] + (grey * cover)[..., None]).astype(np.uint8)


def rows_and_columns(pose: Transform, corners: Array, view: View) -> tuple[slice, slice] | None:
    """Those of the picture that hold a sheet (`corners` in the apartment); None when its front is not in the picture.

    Rays are clipped to those of the picture's edge first: far outside, the distortion's polynomial folds back.
    """
    sheet = view.pose.inverse().apply(corners)
    if pose.inverse().apply(view.pose.translation)[2] <= 0.0 or (sheet[:, 2] <= NEAR_M).any():
        return None
    ways, edges = sheet / sheet[:, 2:], view.rays[:: view.window.height - 1, :: view.window.width - 1]
    reach = 1.05 * np.abs(edges).max(axis=(0, 1))
    pixels = view.window.from_sensor(
        project(np.column_stack([np.clip(ways[:, :2], -reach, reach), ways[:, 2]]), view.lens)
    )
    left, top = np.maximum(np.floor(pixels.min(axis=0)).astype(int) - PAD, 0)
    right, bottom = np.minimum(np.ceil(pixels.max(axis=0)).astype(int) + PAD, (view.window.width, view.window.height))
    return (slice(top, bottom), slice(left, right)) if left < right and top < bottom else None


def plane(pose: Transform, view: View, rays: Float32) -> Float32:
    """Where rays (h, w, 2) of the camera meet a sheet's plane, in its frame (h, w, 2): a homography."""
    seen = pose.inverse() @ view.pose
    turn, (x, y, z) = seen.rotation, seen.translation
    to_plane = np.array([x * turn[2] - z * turn[0], y * turn[2] - z * turn[1], turn[2]])
    return np.asarray(cv2.perspectiveTransform(rays, to_plane), np.float32)


def _averaged(marker: Marker, view: View, rays: Float32) -> tuple[Float32, Float32]:
    """Mean grey of the print, and the part covered by the sheet, of every pixel of a patch."""
    height, width = rays.shape[:2]
    fine = int(np.clip(np.sqrt(SAMPLES_TARGET / (height * width)), 2, 8))
    dense = np.asarray(cv2.resize(rays, (width * fine, height * fine), interpolation=cv2.INTER_LINEAR), np.float32)
    module = marker.size / 7
    x, y = np.moveaxis(plane(marker.pose, view, dense) / module, -1, 0)
    count = 7 + 2 * MARGIN
    column, row = np.floor(x + count / 2).astype(int), np.floor(count / 2 - y).astype(int)
    on = (column >= 0) & (column < count) & (row >= 0) & (row < count)
    grey = np.where(on, modules(marker.id)[np.clip(row, 0, count - 1), np.clip(column, 0, count - 1)], 0.0)
    cover = cv2.resize(on.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
    ink = cv2.resize(grey.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
    return (ink / np.maximum(cover, 1e-6)).astype(np.float32), cover.astype(np.float32)


def free(pose: Transform, view: View, rays: Float32, boxes: list[Box]) -> NDArray[np.bool_]:
    """For every pixel of a patch, whether nothing stands between the camera and the sheet."""
    if not boxes:
        return np.ones(rays.shape[:2], np.bool_)
    flat = plane(pose, view, rays).reshape(-1, 2)
    points = pose.apply(np.column_stack([flat, np.full(len(flat), LIFT_M)]))
    hidden = np.zeros(len(points), bool)
    for box in boxes:
        hidden |= box.hides(view.pose.translation, points)
    return ~hidden.reshape(rays.shape[:2])
