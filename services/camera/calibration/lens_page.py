"""The report of a lens calibration: the numbers and their doubt, where the board was shown, what each view leaves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from services.camera.calibration import page as parts
from services.camera.calibration.page import Array
from services.camera.calibration.shots import BoardShot
from services.camera.calibration.wishes import CalibrateLens
from services.vision.calibrate_lens import Fit, doubt_px

ARROW = 1 / 60  # of the picture's width: how long the usual arrow is to be, the true ones are not to be seen
MEANING = {
    "fx": "focal length across, px",
    "fy": "focal length down, px",
    "cx": "principal point from the left, px",
    "cy": "principal point from the top, px",
}


def page(camera: str, wish: CalibrateLens, found: Fit, shots: Sequence[BoardShot]) -> str:
    """The whole page; `shots` by the numbers of the views."""
    return parts.page(
        f"Lens of {camera}",
        f"{len(found.used)} views of a {wish.board.words}, {found.lens.width}x{found.lens.height} px, {found.model}. "
        f"The corners are {found.rms_px:.2f} px off on average (root mean square).",
        parts.section("What came out", _numbers(found), _verdict(found)),
        parts.section("Where the board was shown", parts.pair(_coverage(found), _doubt(found))),
        parts.section("What is left", parts.pair(_scatter(found), _over_picture(found))),
        parts.section("The views", _views(found, shots)),
    )


def _numbers(found: Fit) -> str:
    rows = []
    for name, (value, sigma) in found.values.items():
        digits = 2 if name in MEANING else 5
        rows.append((name, f"{value:.{digits}f}", f"{sigma:.{digits}f}", MEANING.get(name, "distortion")))
    return parts.table(("", "value", "standard deviation", ""), rows)


def _verdict(found: Fit) -> str:
    worst = float(np.nanmax(doubt_px(found)))
    words = f"The focal length is known to {100 * found.focal_doubt:.2f} %, "
    words += f"and a pixel at the worst spot of the picture to {worst:.2f} px (one standard deviation each)."
    left = f" {len(found.left_out)} views were left out because they did not fit." if found.left_out else ""
    return parts.text(words + left, "good" if found.focal_doubt < 0.0015 and worst < 2 else "bad")


def _enlarged(found: Fit) -> int:
    """How many times the arrows are enlarged: 1, 2 or 5 times a power of ten."""
    wanted = ARROW * found.lens.width / max(found.rms_px, 1e-3)
    power = 10 ** int(np.floor(np.log10(max(wanted, 1.0))))
    return int(power * max(step for step in (1, 2, 5) if step * power <= max(wanted, 1.0)))


def _all(found: Fit) -> tuple[Array, Array]:
    return np.concatenate([one.pixels for one in found.seen]), np.concatenate(found.residuals)


def _size(found: Fit) -> tuple[int, int]:
    return found.lens.width, found.lens.height


def _coverage(found: Fit) -> str:
    points, _ = _all(found)
    return parts.figure(
        _size(found), parts.dots(points, found.lens.width / 300, opacity=0.5), "All corners of all views"
    )


def _doubt(found: Fit) -> str:
    """The grid of `doubt_px` as tiles: the darker, the less sure."""
    doubt = doubt_px(found)
    width, height = found.lens.width / doubt.shape[1], found.lens.height / doubt.shape[0]
    worst, tiles = max(float(np.nanmax(doubt)), 1e-9), []
    for (row, column), value in np.ndenumerate(doubt):
        shade = 1.0 if np.isnan(value) else float(value) / worst
        tiles.append(
            f"<rect x='{column * width:.1f}' y='{row * height:.1f}' width='{width:.1f}' height='{height:.1f}' "
            f"fill='var(--bad)' fill-opacity='{0.75 * shade:.2f}'/>"
        )
    best = f"from {float(np.nanmin(doubt)):.2f} px (light) to {worst:.2f} px (dark)"
    return parts.figure(_size(found), "".join(tiles), f"How unsure a pixel is: {best}")


def _scatter(found: Fit) -> str:
    _, residuals = _all(found)
    reach = 1.1 * float(np.abs(residuals).max())
    return parts.scatter(residuals, reach, "px", "What each corner leaves; a cloud without a shape is as it should be")


def _over_picture(found: Fit) -> str:
    points, residuals = _all(found)
    times = _enlarged(found)
    drawing = parts.arrows(points, -times * residuals, found.lens.width / 900, "var(--dot)")
    return parts.figure(
        _size(found), drawing, f"From each corner to where the fit would have it, {times} times enlarged"
    )


def _views(found: Fit, shots: Sequence[BoardShot]) -> str:
    figures = []
    for index, number in enumerate(found.used):
        seen, residuals, shot = found.seen[index], found.residuals[index], shots[number]
        rms = float(np.sqrt((residuals**2).sum(axis=1).mean()))
        stroke = shot.size[0] / 500
        drawing = parts.rings(seen.pixels, 2.5 * stroke, stroke / 1.5, "#35d07f")
        drawing += parts.arrows(seen.pixels, -_enlarged(found) * residuals, stroke, "#ff5a3c")
        caption = f"view {number + 1}: {len(seen.ids)} corners, {rms:.2f} px off, edges {seen.blur_px:.1f} px wide"
        figures.append(parts.figure(shot.size, drawing, caption, shot.thumbnail))
    for number, why in found.left_out.items():
        shot = shots[number]
        drawing = parts.rings(shot.seen.pixels, shot.size[0] / 200, shot.size[0] / 800, "#ff5a3c") if shot.seen else ""
        figures.append(parts.figure(shot.size, drawing, f"view {number + 1}: left out, {why}", shot.thumbnail))
    legend = f"Green: the corners as found. Red: where the fit would have them, {_enlarged(found)} times enlarged."
    return parts.text(legend, "soft") + parts.grid(figures)
