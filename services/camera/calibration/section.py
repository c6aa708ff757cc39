"""The mount's section in the configuration's text: replaced value by value, comments and everything else as they were.

Pure: text in, text out. Writing the file is in `files.py`, asking whether to in `command.py`.
"""

from __future__ import annotations

import re
from typing import Any

from services.vision.frames import Mount

PLACE, ANGLE = 4, 3  # decimals: a tenth of a millimetre, a thousandth of a degree
STEP = "  "
KEY = re.compile(r"^(?P<indent> *)(?P<key>[^\s#:][^:#]*):(?P<rest>.*)$")


def settings(mount: Mount) -> dict[str, Any]:
    """A mount as the configuration writes it."""

    def metres(values: tuple[float, ...]) -> list[float]:
        return [round(value, PLACE) + 0.0 for value in values]

    return {
        "position": metres(mount.position),
        "kind": mount.kind,
        "yaw_deg": round(mount.yaw_deg, ANGLE) + 0.0,
        "lean_deg": [round(value, ANGLE) + 0.0 for value in mount.lean_deg],
        "pan_to_tilt_m": metres(mount.pan_to_tilt_m),
        "tilt_to_lens_m": metres(mount.tilt_to_lens_m),
        "sensor_roll_deg": round(mount.sensor_roll_deg, ANGLE) + 0.0,
        "tilt_zero_deg": round(mount.tilt_zero_deg, ANGLE) + 0.0,
    }


def with_mount(text: str, camera: str, mount: dict[str, Any]) -> str:
    """The configuration's text with this mount for this camera.

    ValueError when the camera does not stand there as a section of its own, one key on each line.
    """
    lines = text.splitlines()
    try:
        start, end = _block(lines, _block(lines, (0, len(lines)), "cameras"), camera)
    except LookupError as error:
        raise ValueError(str(error)) from error
    depth = _depth(lines, start, end)
    left = dict(mount)
    try:
        first, last = _block(lines, (start, end), "mount")
    except LookupError:
        lines.insert(end, " " * depth + "mount:")
        first, last = end + 1, end + 1
    inner = _depth(lines, first, last) if last > first else depth + len(STEP)
    kept = _replaced(lines[first:last], inner, left)
    lines[first:last] = [*kept, *(f"{' ' * inner}{key}: {_value(value)}" for key, value in left.items())]
    return "\n".join(lines) + "\n"


def _replaced(lines: list[str], indent: int, left: dict[str, Any]) -> list[str]:
    """The section's lines with the values that are in `left`, which are taken out of it; lists lose their own lines."""
    kept, within = [], False
    for line in lines:
        found = KEY.match(line)
        if found and len(found["indent"]) == indent:
            key = found["key"].strip()
            within = key in left
            if within:
                line = f"{' ' * indent}{found['key']}: {_value(left.pop(key))}{_comment(found['rest'])}"
            kept.append(line)
        elif not within or line.lstrip().startswith("#"):
            kept.append(line)
    return kept


def _block(lines: list[str], within: tuple[int, int], key: str) -> tuple[int, int]:
    """From the line after `key:` to the line after its last; a comment at its end belongs to what follows."""
    wanted = None
    for index in range(*within):
        found = KEY.match(lines[index])
        if not found:
            continue
        indent = len(found["indent"])
        if wanted is None or indent <= wanted:
            wanted = indent if wanted is None else wanted
            if indent == wanted and found["key"].strip() == key:
                if _without_comment(found["rest"]).strip():
                    raise ValueError(f"expected {key} on lines of its own, got {lines[index].strip()!r}")
                return index + 1, _end(lines, index + 1, within[1], indent)
    raise LookupError(f"expected the key {key!r}, got none")


def _end(lines: list[str], start: int, limit: int, indent: int) -> int:
    """The line after the last one that is indented more."""
    end = start
    for index in range(start, limit):
        text = lines[index]
        if text.strip() and not text.lstrip().startswith("#"):
            if len(text) - len(text.lstrip()) <= indent:
                break
            end = index + 1
    return end


def _depth(lines: list[str], start: int, end: int) -> int:
    inside = (KEY.match(line) for line in lines[start:end])
    return next((len(found["indent"]) for found in inside if found), len(STEP))


def _value(value: Any) -> str:
    return f"[{', '.join(map(str, value))}]" if isinstance(value, list) else str(value)


def _without_comment(rest: str) -> str:
    return re.split(r"(?:^|\s)#", rest, maxsplit=1)[0]


def _comment(rest: str) -> str:
    return rest[len(_without_comment(rest).rstrip()) :] if "#" in rest else ""
