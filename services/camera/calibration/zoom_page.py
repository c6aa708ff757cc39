"""The report of a zoom calibration: what each level magnifies by, and the part of the wide picture that it showed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from services.camera.calibration import page as parts
from services.camera.calibration.shots import THUMB_PX, How
from services.camera.calibration.zoom import Visit
from services.camera.video import pictures
from services.vision.lens import Lens
from services.vision.zoom import Level

LINE_PX, LETTERS_PX = 3.0, 34.0


def page(
    camera: str, levels: Sequence[Level], visits: Sequence[Visit], lens: Lens | None, wide: bytes, how: How
) -> str:
    """The whole page; Away when `wide` is no picture."""
    return parts.page(
        f"Zoom of {camera}",
        f"{len(visits)} zoomed pictures were compared with the widest one of the same place. A level is only a range: "
        "its doubt says by how much two visits to it differ.",
        parts.section("What came out", _numbers(levels, visits, lens)),
        parts.section("What each visit showed", _picture(visits, how.upright(wide))),
    )


def values(levels: Sequence[Level], lens: Lens | None) -> dict[str, tuple[float, float]]:
    """The focal length of each level with its standard deviation, pixels; without a lens the magnification."""
    focal = lens.focal if lens is not None else 1.0
    return {f"zoom {one.zoom:g}": (focal * one.seen.times, focal * one.seen.sigma) for one in levels}


def _numbers(levels: Sequence[Level], visits: Sequence[Visit], lens: Lens | None) -> str:
    rows = []
    for level, (focal, doubt) in zip(levels, values(levels, lens).values(), strict=True):
        seen = [visit.seen.times for visit in visits if visit.zoom == level.zoom]
        span = f"{min(seen):.4f} to {max(seen):.4f}" if seen else ""
        row = (f"{level.zoom:g}", f"{level.seen.times:.4f}", f"{level.seen.relative:.2%}", span)
        rows.append((*row, f"{focal:.1f}" if lens else "", f"{doubt:.1f}" if lens else ""))
    return parts.table(("zoom", "magnification", "doubt", "visits", "focal length, px", "doubt, px"), rows)


def _picture(visits: Sequence[Visit], wide: pictures.Image) -> str:
    height, width = wide.shape[:2]
    drawn = "".join(_shown(visit, width, height) for visit in visits)
    return parts.figure((width, height), drawn, "the widest picture", pictures.thumbnail(wide, THUMB_PX))


def _shown(visit: Visit, width: int, height: int) -> str:
    """The outline of a zoomed picture in the widest one."""
    middle = np.array([width - 1, height - 1]) / 2
    shift = width * np.array([visit.seen.right, visit.seen.down])
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    outline = middle + (corners - middle - shift) / visit.seen.times
    left, top = outline[0]
    words = parts.label(left + 6, top + LETTERS_PX, f"{visit.zoom:g}", LETTERS_PX, "var(--dot)")
    return parts.outline(outline, LINE_PX, "var(--dot)") + words
