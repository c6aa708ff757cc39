"""The calibrated zoom as a file beside the lens's, `zoom.yaml`: what each level magnifies by, and how surely.

How it is learnt is in `camera/calibration/`, how it is used in `vision/zoom.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pydantic import Field, ValidationError

from services import document
from services.section import Section
from services.vision.lens import Lens
from services.vision.zoom import Level, Magnification

FILE = "zoom.yaml"


class _Row(Section):
    zoom: float
    magnification: float = Field(gt=0.5, lt=100)
    sigma: float = Field(ge=0)
    right: float = 0.0
    down: float = 0.0
    focal_px: float | None = None  # for readers: in the pictures that the lens was calibrated in


class _Table(Section):
    levels: list[_Row]


def of_lens(camera_info: Path) -> Path:
    """Where the table of that lens is."""
    return camera_info.with_name(FILE)


def read(file: Path) -> tuple[Level, ...]:
    """The table; empty where there is none. ConfigError with the line of what is wrong."""
    if not file.exists():
        return ()
    found = document.read(file)
    value = document.must(found)
    try:
        table = _Table.model_validate(value)
    except ValidationError as fault:
        for error in fault.errors(include_url=False):
            found.fault(error["loc"], f"{error['msg']}, got {str(error['input'])[:80]!r}")
        document.must(found)
        raise
    return tuple(
        Level(row.zoom, Magnification(row.magnification, row.sigma, row.right, row.down)) for row in table.levels
    )


def write(file: Path, levels: Sequence[Level], lens: Lens | None) -> None:
    """Writes the table; OSError when it cannot be written."""
    document.write(file, {"levels": [_row(level, lens) for level in levels]})


def _row(level: Level, lens: Lens | None) -> dict[str, float]:
    seen = level.seen
    row = {"zoom": level.zoom, "magnification": round(seen.times, 5), "sigma": round(seen.sigma, 5)}
    row |= {"right": round(seen.right, 6), "down": round(seen.down, 6)}
    return row if lens is None else row | {"focal_px": round(lens.focal * seen.times, 2)}
