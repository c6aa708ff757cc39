"""Pictures as people take them: markers tilted, shadowed, blurred, covered in part, amid what looks like markers.

The geometry of a ceiling camera and exact truths to a hundredth of a pixel are in `rendering`; here it is the mess of
real photographs that counts: light, hands, glare, bent paper, colour casts, JPEG, text, chessboards, QR codes, frames.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
CELL = 12  # px of a cell in the print's own picture
OVER = 3  # rays across a pixel
WORDS = ("HOME", "0815", "MILK", "kitchen", "Sofa", "42", "O0", "#@", "[]", "##", "II", "HH", "EE", "lamp", "B8")


@dataclass(frozen=True)
class Shown:
    """A marker in a scene: its corners (4, 2) clockwise from its own top-left, and what was done to it."""

    marker: int
    corners: Array
    hard: tuple[str, ...] = ()

    @property
    def side_px(self) -> float:
        return float(np.sqrt(cv2.contourArea(self.corners.astype(np.float32))))


@dataclass
class Scene:
    """A picture, BGR, and the markers in it."""

    image: Picture
    markers: list[Shown] = field(default_factory=list)


@lru_cache(maxsize=4096)
def code(dictionary: str, marker: int) -> Picture:
    """The cells of a marker with its border, 0 and 255."""
    book = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    return cv2.aruco.generateImageMarker(book, marker, book.markerSize + 2)


def pose(rng: np.random.Generator, middle: Array, side: float, tilt_deg: float) -> Array:
    """A homography from the unit square to the picture: turned anyhow, tilted about any axis, 3 to 8 sides away."""
    tilt, about, turn = np.radians(tilt_deg), rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)
    axis = np.array([np.cos(about), np.sin(about), 0.0])
    rotation = cv2.Rodrigues(axis * tilt)[0] @ cv2.Rodrigues(np.array([0, 0, turn]))[0]
    away = rng.uniform(3, 8)
    to_unit = np.array([[1, 0, -0.5], [0, 1, -0.5], [0, 0, 1.0]])
    plane = np.column_stack((rotation[:, 0], rotation[:, 1], [0, 0, away]))
    lens = np.array([[side * away, 0, middle[0]], [0, side * away, middle[1]], [0, 0, 1.0]])
    return lens @ plane @ to_unit


def put(image: Array, texture: Array, homography: Array, alpha: Array | None = None) -> None:
    """Lays a flat texture (h, w) or (h, w, 3), whose outline is the unit square, over the picture."""
    height, width = image.shape[:2]
    outline = cv2.perspectiveTransform(np.array([[[0.0, 0], [1, 0], [1, 1], [0, 1]]]), homography)[0]
    x0, y0 = np.maximum(np.floor(outline.min(axis=0)).astype(int) - 1, 0)
    x1, y1 = np.minimum(np.ceil(outline.max(axis=0)).astype(int) + 2, (width, height))
    if x1 - x0 < 2 or y1 - y0 < 2:
        return
    rows, columns = texture.shape[:2]
    scale = np.array([[1 / columns, 0, 0.5 / columns], [0, 1 / rows, 0.5 / rows], [0, 0, 1.0]])
    finer = np.array([[OVER, 0, OVER * (0.5 - x0) - 0.5], [0, OVER, OVER * (0.5 - y0) - 0.5], [0, 0, 1.0]])
    mapping, size = finer @ homography @ scale, ((x1 - x0) * OVER, (y1 - y0) * OVER)
    mask = np.ones((rows, columns), np.float32) if alpha is None else alpha.astype(np.float32)
    warp = cv2.warpPerspective(
        texture.astype(np.float32), mapping, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    cover = cv2.warpPerspective(mask, mapping, size, flags=cv2.INTER_LINEAR)
    small = (x1 - x0, y1 - y0)
    cover = cv2.resize(cover, small, interpolation=cv2.INTER_AREA)[..., None]
    colours = warp if warp.ndim == 3 else np.repeat(warp[..., None], 3, axis=2)
    colours = cv2.resize(colours, small, interpolation=cv2.INTER_AREA)
    part = image[y0:y1, x0:x1]
    part[:] = cover * colours + (1 - cover) * part


def paper(rng: np.random.Generator, dictionary: str, marker: int, rim: float) -> tuple[Array, Array]:
    """The print and where the black square lies on it: (4, 2) shares of its sides."""
    dark, light = rng.uniform(15, 55), rng.uniform(170, 240)
    cells = np.kron(code(dictionary, marker), np.ones((CELL, CELL)))
    wide = max(1, round(rim * CELL))
    print_ = np.pad(np.where(cells > 0, light, dark), wide, constant_values=light)
    low, high = wide / print_.shape[0], 1 - wide / print_.shape[0]
    return print_, np.array([[low, low], [high, low], [high, high], [low, high]])


def chessboard(rng: np.random.Generator) -> Array:
    cells = np.indices(rng.integers(3, 10, 2)).sum(axis=0) % 2
    return np.pad(np.kron(cells * rng.uniform(120, 200) + 20, np.ones((16, 16))), 8, constant_values=220)


def qr(rng: np.random.Generator) -> Array:
    text = "".join(rng.choice(list("abcdefgh0123456789"), rng.integers(4, 60)))
    return np.kron(np.pad(cv2.QRCodeEncoder.create().encode(text), 2, constant_values=255), np.ones((5, 5)))


def page(rng: np.random.Generator) -> Array:
    """Paper or a screen full of text."""
    ink, ground = (20, 235) if rng.random() < 0.6 else (220, 30)
    image = np.full(tuple(rng.integers(120, 320, 2)), ground, np.uint8)
    step = int(rng.integers(12, 40))
    for row in range(step, image.shape[0], step):
        text = " ".join(rng.choice(WORDS, 12))
        cv2.putText(
            image, text, (4, row), int(rng.integers(0, 8)), step / 30, ink, int(rng.integers(1, 4)), cv2.LINE_AA
        )
    return np.pad(image, int(rng.integers(1, 12)), constant_values=255 - ground).astype(float)


def frame(rng: np.random.Generator) -> Array:
    """A dark picture frame, or a window, around something."""
    inside = cv2.resize(
        rng.uniform(30, 230, tuple(rng.integers(1, 7, 2))), (120, 120), interpolation=int(rng.integers(0, 2))
    )
    image = np.pad(inside, int(rng.integers(8, 30)), constant_values=rng.uniform(10, 60))
    return np.pad(image, int(rng.integers(2, 20)), constant_values=rng.uniform(150, 240))


def crossword(rng: np.random.Generator) -> Array:
    """Dark-bordered cells at random that are no marker of any dictionary here: 8 to a side, or of three greys."""
    side = int(rng.integers(3, 11))
    side = side if side not in (4, 5, 6, 7) else 9
    cells = np.pad(rng.integers(0, 2, (side, side)) * rng.uniform(120, 200) + 25, 1, constant_values=25)
    return np.pad(np.kron(cells, np.ones((10, 10))), 10, constant_values=215)


def keys(rng: np.random.Generator) -> Array:
    """A keyboard or a shelf: dark boxes in rows, with light signs."""
    image = np.full((160, 240), rng.uniform(120, 220), np.uint8)
    step = int(rng.integers(16, 40))
    for y in range(4, 160 - step, step):
        for x in range(4, 240 - step, step):
            cv2.rectangle(image, (x, y), (x + step - 5, y + step - 5), rng.uniform(10, 70), -1)
            cv2.putText(image, str(rng.choice(list("QWERTZ0123#"))), (x + 3, y + step - 9), 1, step / 22, 220, 2)
    return image.astype(float)


DISTRACTORS = (chessboard, qr, page, frame, crossword, keys)


def room(rng: np.random.Generator, height: int, width: int, things: int) -> Array:
    """A wall in a light of its own, furniture, and things that look like markers to a program."""
    coarse = rng.uniform(60, 210, (int(rng.integers(2, 6)), int(rng.integers(2, 6)), 3))
    image = cv2.resize(
        coarse.mean(axis=2, keepdims=True) * 0.8 + coarse * 0.2, (width, height), interpolation=cv2.INTER_CUBIC
    )
    texture = rng.normal(0, 1, (height // 4 + 1, width // 4 + 1)) * rng.uniform(0, 40)
    image += cv2.resize(cv2.GaussianBlur(texture, (0, 0), rng.uniform(0.5, 4)), (width, height))[..., None]
    for _ in range(int(rng.integers(4, 16))):
        box = (
            (rng.uniform(0, width), rng.uniform(0, height)),
            tuple(rng.uniform(0.03, 0.5, 2) * height),
            rng.uniform(0, 90),
        )
        cv2.fillPoly(
            image, [cv2.boxPoints(box).astype(np.int32)], rng.uniform(15, 235) * rng.uniform(0.8, 1, 3), cv2.LINE_AA
        )
    for _ in range(things):
        thing = DISTRACTORS[rng.integers(len(DISTRACTORS))](rng)
        put(image, thing, anywhere(rng, height, width, rng.uniform(0.06, 0.45) * height))
    return image


def anywhere(rng: np.random.Generator, height: int, width: int, side: float) -> Array:
    return pose(rng, rng.uniform((0, 0), (width, height)), side, rng.uniform(0, 65))


def bent(texture: Array, by: float) -> Array:
    """A print on paper that bulges: its lines become arcs."""
    rows, columns = texture.shape
    y, x = np.indices(texture.shape, np.float32)
    arc = by * rows * (0.25 - (x / columns - 0.5) ** 2)
    return cv2.remap(texture, x, (y + arc).astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def shadowed(rng: np.random.Generator, image: Array, over: Array) -> None:
    """A shadow whose edge runs through the square `over`; hard or a little soft."""
    height, width = image.shape[:2]
    shape, away = over.mean(axis=0), rng.uniform(0, 2 * np.pi)
    normal = np.array([np.cos(away), np.sin(away)])
    side = np.linalg.norm(over[1] - over[0])
    y, x = np.indices((height, width))
    distance = (x - shape[0]) * normal[0] + (y - shape[1]) * normal[1] - rng.uniform(-0.3, 0.3) * side
    if rng.random() < 0.4:  # a bar's shadow, or a blind's
        distance = np.abs(distance) - rng.uniform(0.15, 0.5) * side
    share = np.clip(distance / max(rng.uniform(0.0, 0.15) * side, 0.7) + 0.5, 0, 1)
    image *= (1 - share * (1 - rng.uniform(0.2, 0.6)))[..., None]


def handed(rng: np.random.Generator, image: Array, over: Array) -> None:
    """A finger that covers a part of one side or corner of the square."""
    side = float(np.linalg.norm(over[1] - over[0]))
    edge, share = int(rng.integers(4)), rng.uniform(0, 1)
    start = over[edge] * share + over[(edge + 1) % 4] * (1 - share)
    out = start - over.mean(axis=0)
    end = start + out / max(np.linalg.norm(out), 1e-6) * side * 3
    inner = start - out * rng.uniform(0.0, 0.15)
    skin = np.array([120, 150, 200.0]) * rng.uniform(0.4, 1.1)
    cv2.line(
        image,
        *(tuple(int(v) for v in p) for p in (inner, end)),
        skin.tolist(),
        max(2, int(side * rng.uniform(0.1, 0.22))),
        cv2.LINE_AA,
    )


def glared(rng: np.random.Generator, image: Array, over: Array) -> None:
    """A lamp mirrored on the print."""
    height, width = image.shape[:2]
    side = float(np.linalg.norm(over[1] - over[0]))
    at, size = over.mean(axis=0) + rng.uniform(-0.5, 0.5, 2) * side, side * rng.uniform(0.15, 0.5)
    y, x = np.indices((height, width))
    spot = np.exp(-(((x - at[0]) ** 2 + (y - at[1]) ** 2) / size**2))
    image += (spot * rng.uniform(60, 200))[..., None]


def smeared(image: Array, length: float, angle: float) -> Array:
    """Moved while it was exposed."""
    reach = int(np.ceil(length)) | 1
    kernel = np.zeros((reach + 2, reach + 2), np.float32)
    mid = (reach + 1) / 2
    step = np.array([np.cos(angle), np.sin(angle)])
    for share in np.linspace(-0.5, 0.5, 8 * reach):
        x, y = mid + step * share * length
        kernel[round(y), round(x)] += 1
    return cv2.filter2D(image, -1, kernel / kernel.sum())


HARD = ("tilt", "shadow", "hand", "glare", "bent", "blur", "motion", "dark", "small", "flat", "mixed")


def photograph(
    seed: int,
    dictionary: str,
    markers: int,
    *,
    hard: bool,
    height: int = 480,
    width: int = 640,
    things: int = 4,
    kind: str | None = None,
) -> Scene:
    """A photograph with that many markers of the dictionary in it (0: none), each hard in one way or two, or none."""
    rng = np.random.default_rng(seed)
    image, shown = room(rng, height, width, things), []
    how = (
        (kind,)
        if kind and kind != "mixed"
        else tuple(rng.choice(HARD[:-1], int(rng.integers(1, 3)), replace=False))
        if hard
        else ()
    )
    book = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    for number in range(markers):
        marker = int(rng.integers(len(book.bytesList)))
        one = _placed(rng, image, dictionary, marker, how, number, markers)
        shown.append(one)
    for what, apply in (("shadow", shadowed), ("hand", handed), ("glare", glared)):
        if what in how and shown:
            for one in shown[:1] if what == "shadow" else shown:
                apply(rng, image, one.corners)
    return Scene(_exposed(rng, image, how, shown), shown)


def _placed(
    rng: np.random.Generator, image: Array, dictionary: str, marker: int, how: tuple[str, ...], number: int, of: int
) -> Shown:
    height, width = image.shape[:2]
    modules = code(dictionary, marker).shape[0]
    side = (
        modules * np.exp(rng.uniform(np.log(1.9), np.log(3.0)))
        if "small" in how
        else rng.uniform(0.11, 0.45 if of == 1 else 0.25) * height
    )
    tilt = rng.uniform(55, 72) if "tilt" in how else rng.uniform(0, 45)
    if "tilt" in how:
        side = max(side, modules * 6)
    x = (number + rng.uniform(0.3, 0.7)) / of * width
    texture, square = paper(rng, dictionary, marker, rng.choice([0.35, 0.6, 1.0, 2.0]))
    if "bent" in how:
        texture = bent(texture, rng.uniform(0.05, 0.3))
    homography = pose(rng, np.array([x, rng.uniform(0.3, 0.7) * height]), side / (square[1, 0] - square[0, 0]), tilt)
    put(image, texture, homography)
    corners = cv2.perspectiveTransform(square[None], homography)[0]
    return Shown(marker, corners, how)


def _exposed(rng: np.random.Generator, image: Array, how: tuple[str, ...], shown: list[Shown]) -> Picture:
    module = min((one.side_px for one in shown), default=80.0) / 7
    image = cv2.GaussianBlur(image, (0, 0), rng.uniform(0.5, 1.0))
    if "blur" in how:
        image = cv2.GaussianBlur(image, (0, 0), module * rng.uniform(0.35, 0.7))
    if "motion" in how:
        image = smeared(image, module * rng.uniform(0.7, 1.6), rng.uniform(0, np.pi))
    if "dark" in how:
        image = image * rng.uniform(0.08, 0.25) + rng.uniform(0, 12)
    if "flat" in how:  # mist, a window behind: little contrast
        image = image * rng.uniform(0.1, 0.25) + rng.uniform(60, 170)
    if rng.random() < 0.5:
        image = image * rng.uniform(0.75, 1.1, 3)
    image = image + rng.normal(0, rng.uniform(1, 5), image.shape)
    picture = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    if rng.random() < 0.6:
        coded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(50, 95))])[1]
        picture = cv2.imdecode(coded, cv2.IMREAD_COLOR)
    return picture
