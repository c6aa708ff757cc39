"""The files of a calibration: `ost.yaml` as ROS reads it, and the report; whole or not at all, the old one kept.

Not here: the mount's section in the configuration, that is `section.py`.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from services import document
from services.camera.device import Refused
from services.vision.lens import COEFFICIENTS, Lens
from services.whole_file import write_whole


def camera_info(lens: Lens, name: str) -> dict[str, Any]:
    """A lens as ROS's camera_calibration_parsers has it."""
    matrix = [[round(float(value), 5) for value in row] for row in lens.matrix]
    model = next(model for model, count in COEFFICIENTS.items() if count == len(lens.distortion))
    projection = [value for row in matrix for value in (*row, 0.0)]
    return {
        "image_width": lens.width,
        "image_height": lens.height,
        "camera_name": name,
        "camera_matrix": _table(3, 3, [value for row in matrix for value in row]),
        "distortion_model": model,
        "distortion_coefficients": _table(1, len(lens.distortion), [round(float(v), 8) for v in lens.distortion]),
        "rectification_matrix": _table(3, 3, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        "projection_matrix": _table(3, 4, projection),
    }


def _table(rows: int, columns: int, data: list[float]) -> dict[str, Any]:
    return {"rows": rows, "cols": columns, "data": data}


def write_lens(file: Path, lens: Lens, name: str, now: float) -> Path | None:
    """Writes `ost.yaml`; where the old one is now, None when there was none. Refused when it cannot be written."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        old = kept(file, now)
        document.write(file, camera_info(lens, name))
    except OSError as error:
        raise Refused(f"{file} cannot be written: {error.strerror or error}") from error
    return old


def kept(file: Path, now: float) -> Path | None:
    """A copy of a file beside it, named by the time and as hidden from others as it; None when there is no file."""
    if not file.exists():
        return None
    copy = file.with_name(f"{file.name}.{time.strftime('%Y%m%d-%H%M%S', time.gmtime(now))}.bak")
    write_whole(copy, file.read_bytes(), like=file)
    return copy
