"""A plan of the apartment with what a scan has found, as a picture: rooms, camera, places, markers with their doubt.

Numbers in, pixels out. Where the numbers come from is `services/command_line/scanned.py`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.frames import Mount, camera_in_apartment

Image = NDArray[np.uint8]
XY = tuple[float, float]
Colour = tuple[int, int, int]

PER_M = 160  # pixels per metre
EDGE_M = 0.6
MARGIN_PX, ROW_PX = 12, 30  # of what is told below the plan
TABLE_M = 0.8  # the height at which a place's line of sight is drawn to end
REACH_M = 4.0  # and where it does not go down so far
NINETY = 4.605  # chi-square of two numbers: nine in ten lie inside
LARGER = 10  # times: an ellipse of a centimetre cannot be seen
FONT = cv2.FONT_HERSHEY_SIMPLEX
TOLD = 0.55  # size of the letters below the plan
INK, GREY, WALL = (40, 40, 40), (150, 150, 150), (120, 120, 120)
ROOM, PAPER = (240, 245, 247), (255, 255, 255)
BLUE, GREEN, RED = (190, 110, 20), (60, 140, 40), (40, 40, 210)


@dataclass(frozen=True)
class Mark:
    """A marker: where it was found (None: only where it truly is is known), the covariance in the plane, m^2."""

    marker: int
    found: XY | None = None
    covariance: NDArray[np.float64] = field(default_factory=lambda: np.zeros((2, 2)))
    true: XY | None = None


@dataclass(frozen=True)
class Plan:
    """All that is drawn. `rooms`: corners by label; `places`: pan and tilt, in the order of their visits."""

    title: str
    rooms: Mapping[str, Sequence[XY]]
    mount: Mount
    places: Mapping[str, tuple[float, float]]
    marks: Sequence[Mark]
    walls: Sequence[tuple[XY, XY]] = ()


def draw(plan: Plan) -> Image:
    """The picture (BGR), north up."""
    paper = _Paper(plan)
    for label, corners in plan.rooms.items():
        paper.room(label, corners)
    for start, end in plan.walls:
        paper.line(start, end, WALL, 4)
    here = (plan.mount.position[0], plan.mount.position[1])
    for number, (name, (pan, tilt)) in enumerate(plan.places.items(), 1):
        paper.view(here, aim(plan.mount, pan, tilt), f"{number} {name}")
    paper.spot(here, BLUE, 9)
    paper.text("camera", (here[0] + 0.09, here[1] - 0.16), BLUE)
    for mark in plan.marks:
        paper.mark(mark)
    paper.legend()
    return paper.image


def png(image: Image) -> bytes:
    """The picture as the bytes of a PNG file."""
    _, data = cv2.imencode(".png", image)
    return data.tobytes()


def aim(mount: Mount, pan: float, tilt: float) -> XY:
    """Where the middle of the picture meets a table, or a point on the way there that is not too far."""
    pose = camera_in_apartment(mount, pan, tilt)
    eye, ahead = pose.translation, pose.rotation @ np.array([0.0, 0.0, 1.0])
    far = (TABLE_M - eye[2]) / ahead[2] if ahead[2] < -1e-3 else REACH_M
    x, y = (eye + min(far, REACH_M) * ahead)[:2]
    return float(x), float(y)


def ellipse(covariance: NDArray[np.float64]) -> tuple[float, float, float]:
    """The half axes (m, the longer one first) of the ellipse that holds nine in ten, and its turn from x, degrees."""
    values, vectors = np.linalg.eigh(np.asarray(covariance, float))
    long, short = np.sqrt(np.maximum(values[::-1], 0.0) * NINETY)
    return float(long), float(short), float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))


class _Paper:
    """The canvas, metres in."""

    def __init__(self, plan: Plan) -> None:
        corners = [corner for room in plan.rooms.values() for corner in room]
        corners += [mark.found or mark.true or (0.0, 0.0) for mark in plan.marks] + [plan.mount.position[:2]]
        low, high = np.min(corners, axis=0) - EDGE_M, np.max(corners, axis=0) + EDGE_M
        self.low, self.high = low, high
        width, height = (int(side) for side in np.ceil((high - low) * PER_M))
        self.told = _told(plan, width - 2 * MARGIN_PX)
        self.top = height
        self.image: Image = np.full((height + ROW_PX * (len(self.told) + 1), width, 3), PAPER, np.uint8)

    def pixel(self, at: Sequence[float]) -> tuple[int, int]:
        x, y = (float(at[0]) - self.low[0]) * PER_M, (self.high[1] - float(at[1])) * PER_M
        return round(x), round(y)

    def room(self, label: str, corners: Sequence[XY]) -> None:
        points = np.array([self.pixel(corner) for corner in corners], np.int32)
        cv2.fillPoly(self.image, [points], ROOM)
        cv2.polylines(self.image, [points], True, GREY, 1, cv2.LINE_AA)
        self.text(label, (corners[0][0] + 0.1, corners[0][1] + 0.12), GREY, 0.6)

    def line(self, start: XY, end: XY, colour: Colour, thick: int) -> None:
        cv2.line(self.image, self.pixel(start), self.pixel(end), colour, thick, cv2.LINE_AA)

    def view(self, eye: XY, to: XY, label: str) -> None:
        cv2.arrowedLine(self.image, self.pixel(eye), self.pixel(to), BLUE, 1, cv2.LINE_AA, tipLength=0.05)
        self.text(label, (to[0] + 0.05, to[1] + 0.05), BLUE, 0.45)

    def spot(self, at: XY, colour: Colour, radius: int) -> None:
        cv2.circle(self.image, self.pixel(at), radius, colour, -1, cv2.LINE_AA)

    def mark(self, mark: Mark) -> None:
        if mark.true is not None:
            x, y = self.pixel(mark.true)
            for dx, dy in ((9, 0), (0, 9)):
                cv2.line(self.image, (x - dx, y - dy), (x + dx, y + dy), GREEN, 2, cv2.LINE_AA)
        if mark.found is None:
            if mark.true is not None:
                self.text(f"{mark.marker} (not seen)", (mark.true[0] + 0.08, mark.true[1] - 0.13), GREEN, 0.45)
            return
        long, short, turn = ellipse(mark.covariance)
        for times, thick in ((1, 2), (LARGER, 1)):
            size = (max(1, round(times * long * PER_M)), max(1, round(times * short * PER_M)))
            cv2.ellipse(self.image, self.pixel(mark.found), size, -turn, 0, 360, RED, thick, cv2.LINE_AA)
        self.spot(mark.found, RED, 3)
        self.text(str(mark.marker), (mark.found[0] + 0.08, mark.found[1] + 0.08), RED, 0.7, 2)

    def text(self, words: str, at: XY, colour: Colour, size: float = 0.5, thick: int = 1) -> None:
        plain = words.encode("ascii", "replace").decode()  # OpenCV's letters
        (width, _), _ = cv2.getTextSize(plain, FONT, size, thick)
        x, y = self.pixel(at)
        x = max(2, min(x, self.image.shape[1] - width - 2))
        cv2.putText(self.image, plain, (x, y), FONT, size, PAPER, thick + 3, cv2.LINE_AA)
        cv2.putText(self.image, plain, (x, y), FONT, size, colour, thick, cv2.LINE_AA)

    def legend(self) -> None:
        """What the signs mean, and in figures how far each marker is from where it truly is."""
        top = self.top
        cv2.line(self.image, (0, top), (self.image.shape[1], top), GREY, 1)
        for row, (words, colour) in enumerate(self.told, 1):
            cv2.putText(self.image, words, (MARGIN_PX, top + ROW_PX * row), FONT, TOLD, colour, 1, cv2.LINE_AA)
        metre = (MARGIN_PX, top - 14), (MARGIN_PX + PER_M, top - 14)
        cv2.line(self.image, *metre, INK, 3)
        cv2.putText(self.image, "1 m", (18 + PER_M, top - 9), FONT, 0.5, INK, 1, cv2.LINE_AA)


def _told(plan: Plan, width: int) -> list[tuple[str, Colour]]:
    """The rows below the plan, none of them wider than so many pixels if its parts are not."""
    parts = [([plan.title], INK)]
    parts += [([f"red: found; ellipses hold nine in ten, as they are and {LARGER} times as large"], RED)]
    if any(mark.true for mark in plan.marks):
        parts += [(["green cross: where it truly is (simulated)"], GREEN)]
    parts += [(list(map(_figures, plan.marks)) or ["no marker was found"], INK)]
    return [(row, colour) for words, colour in parts for row in _rows(words, width)]


def _rows(parts: Sequence[str], width: int) -> list[str]:
    rows: list[str] = []
    for part in parts:
        plain = part.encode("ascii", "replace").decode()  # OpenCV's letters
        longer = f"{rows[-1]}; {plain}" if rows else plain
        fits = bool(rows) and cv2.getTextSize(longer, FONT, TOLD, 1)[0][0] <= width
        rows[-1:] = [longer] if fits else [*rows[-1:], plain]
    return rows


def _figures(mark: Mark) -> str:
    if mark.found is None:
        return f"{mark.marker}: not seen"
    long = 1000 * ellipse(mark.covariance)[0]
    off = "" if mark.true is None else f", off by {1000 * np.hypot(*np.subtract(mark.found, mark.true)):.0f} mm"
    return f"{mark.marker}: +-{long:.0f} mm{off}"
