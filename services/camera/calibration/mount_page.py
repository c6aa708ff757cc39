"""The report of a mount calibration: the numbers and their doubt, the markers' places, a plan from above, pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees

import numpy as np

from services.camera.calibration import page as parts
from services.camera.calibration.mount import Seen
from services.camera.calibration.page import Array
from services.vision.calibrate_mount import MountFit
from services.vision.mount_squares import Known

OFFSETS = 20  # times; how much the markers' offsets are enlarged on the plan
PLAN_PX, RIM_M = 900, 0.6  # the plan's width, and what is shown around
ARROW_PX = 25  # how long the usual arrow in a picture is to be


def page(camera: str, known: Mapping[int, Known], found: MountFit, stops: Sequence[Seen]) -> str:
    """The whole page."""
    wrong = [marker for marker, one in found.markers.items() if one.misplaced]
    return parts.page(
        f"Mount of {camera}",
        f"{len(found.markers)} markers in {len(stops)} pictures, {len(found.looks)} looks. "
        f"The corners are {_rms(found.off_px.reshape(-1, 2)):.2f} px off on average (root mean square).",
        parts.section("What came out", _numbers(found), _verdict(found, wrong)),
        parts.section("The markers", _markers(known, found), parts.pair(_plan(known, found), _scatter(found))),
        parts.section("The pictures", _pictures(found, stops)),
    )


def values(found: MountFit) -> dict[str, tuple[float, float]]:
    """The numbers with their standard deviations: metres, and degrees about the apartment's axes."""
    mount, place, turn = found.mount, found.position_doubt, found.turn_doubt_deg
    named = dict(zip("xyz", zip(mount.position, map(float, place), strict=True), strict=True))
    lean_doubt = float(max(turn[0], turn[1]))
    named["yaw_deg"] = (mount.yaw_deg, float(turn[2]))
    named["lean_x_deg"], named["lean_y_deg"] = ((lean, lean_doubt) for lean in mount.lean_deg)
    zero, roll = (degrees(float(sigma)) for sigma in found.axes_doubt[:2])
    named["tilt_zero_deg"], named["sensor_roll_deg"] = (mount.tilt_zero_deg, zero), (mount.sensor_roll_deg, roll)
    return named


def _rms(vectors: Array) -> float:
    return float(np.sqrt((vectors**2).sum(axis=-1).mean()))


def _numbers(found: MountFit) -> str:
    rows = []
    for name, (value, sigma) in values(found).items():
        unit = "degrees" if name.endswith("_deg") else "m"
        digits = 2 if unit == "degrees" else 4
        rows.append((name.removesuffix("_deg").replace("_", " "), f"{value:.{digits}f}", f"{sigma:.{digits}f}", unit))
    return parts.table(("", "value", "standard deviation", ""), rows)


def _verdict(found: MountFit, wrong: Sequence[int]) -> str:
    place, turn = float(np.linalg.norm(found.position_doubt)), float(np.linalg.norm(found.turn_doubt_deg))
    words = f"The place is known to {100 * place:.1f} cm and the turn to {turn:.2f} degrees (one standard deviation)."
    if wrong:
        named = ", ".join(map(str, wrong))
        return parts.text(
            f"{words} Not where they were said to be: {named}. They hardly count; measure them again.", "bad"
        )
    return parts.text(words, "good" if place < 0.02 and turn < 0.5 else "bad")


def _markers(known: Mapping[int, Known], found: MountFit) -> str:
    rows = []
    for marker, one in found.markers.items():
        said = ", ".join(f"{value:.3f}" for value in known[marker].position)
        off = ", ".join(f"{1000 * value:+.0f}" for value in one.offset)
        size = f"{1000 * float(np.linalg.norm(one.offset)):.0f}"
        remark = "not where it was said to be" if one.misplaced else ""
        rows.append((str(marker), said, off, size, str(one.looks), f"{one.rms_px:.2f}", remark))
    head = ("marker", "said to be at, m", "found beside it, mm", "distance, mm", "looks", "px off", "")
    return parts.table(head, rows)


def _plan(known: Mapping[int, Known], found: MountFit) -> str:
    """From above, y up: the camera, where the markers were said to be, and how far beside that they were found."""
    said = np.array([known[marker].position for marker in found.markers])[:, :2]
    here = np.array(found.mount.position)[:2]
    every = np.vstack((said, here))
    low, high = every.min(axis=0) - RIM_M, every.max(axis=0) + RIM_M
    scale = PLAN_PX / (high[0] - low[0])
    size = (PLAN_PX, max(1, round(float(high[1] - low[1]) * scale)))

    def on_plan(points: Array) -> Array:
        return np.asarray((points - (low[0], high[1])) * (scale, -scale), float)

    offsets = np.array([one.offset[:2] for one in found.markers.values()]) * OFFSETS * (scale, -scale)
    drawing = parts.dots(on_plan(said), 7) + parts.arrows(on_plan(said), offsets, 3, "var(--bad)")
    for marker, (x, y) in zip(found.markers, on_plan(said), strict=True):
        drawing += parts.label(x + 12, y - 8, str(marker), 22)
    ((x, y),) = on_plan(here[None])
    yaw = np.radians(found.mount.yaw_deg)
    drawing += parts.arrows(np.array([[x, y]]), np.array([[60 * np.cos(yaw), -60 * np.sin(yaw)]]), 4, "var(--good)")
    drawing += parts.dots(np.array([[x, y]]), 11, "var(--good)") + parts.label(x + 16, y + 28, "camera", 22)
    metre = f"<path d='M20 {size[1] - 20}h{scale:.1f}' stroke='var(--soft)' stroke-width='3'/>"
    metre += parts.label(24, size[1] - 28, "1 m", 20, "var(--soft)")
    return parts.figure(size, drawing + metre, f"From above; the markers' offsets are {OFFSETS} times enlarged")


def _scatter(found: MountFit) -> str:
    points = found.off_px.reshape(-1, 2)
    caption = "What each corner leaves; readings are coarse, so whole pictures are off together"
    return parts.scatter(points, 1.1 * max(float(np.abs(points).max()), 0.1), "px", caption)


def _pictures(found: MountFit, stops: Sequence[Seen]) -> str:
    times = max(1, round(ARROW_PX / max(_rms(found.off_px.reshape(-1, 2)), 0.05)))
    figures = []
    for stop in stops:
        width = stop.shot.size[0]
        drawing, offs = "", []
        for look, off in zip(found.looks, found.off_px, strict=True):
            if (look.pan, look.tilt) == (stop.reading.pan, stop.reading.tilt) and look.marker in stop.shot.markers:
                x, y = (float(value) for value in look.corners.max(axis=0))
                drawing += parts.outline(look.corners, width / 500, "#35d07f")
                drawing += parts.arrows(look.corners, -times * off, width / 500, "#ff5a3c")
                drawing += parts.label(x + width / 150, y, str(look.marker), width / 40, "#35d07f")
                offs.append(off)
        if offs:
            where = f"pan {stop.reading.pan:.1f}, tilt {stop.reading.tilt:.1f}: "
            caption = f"{where}{len(offs)} markers, {_rms(np.concatenate(offs)):.2f} px off"
            figures.append(parts.figure(stop.shot.size, drawing, caption, stop.shot.thumbnail))
    legend = f"Green: the markers as seen. Red: to where the fit would have their corners, {times} times enlarged."
    return parts.text(legend, "soft") + parts.grid(figures)
