"""What the probe leaves behind: the configuration's section, a simulator's profile, the report, recorded answers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import pairwise
from math import log, pow
from pathlib import Path
from typing import Any

from services.camera.probe import anonymous
from services.camera.probe.findings import Findings
from services.camera.probe.video import USUAL_PORT
from services.camera.probe.wire import Wire

LEVELS, SLOWEST = 8, 0.05  # speeds that there are; degrees/s, where one is so slow that it was hardly measured


def section(found: Findings, name: str, user: str, certificate: Path | None = None) -> str:
    """The camera's section, as `apartment check` takes it; what could not be found out is a comment."""
    tilt = found.capabilities.get("tilt_range") or [-10, 108]
    channels = found.switches.get("ptz_channels") or ()
    measured = "as the camera says" if "tilt_range" in found.capabilities else "not told: measure it"
    lines = [
        f"# {' '.join(part for part in (found.vendor, found.model, found.firmware) if part)}".rstrip(),
        "cameras:",
        f"  {name}:",
        f"    brand: {found.brand or 'amcrest'}",
        f"    url: {found.url}",
        *([f"    certificate: {json.dumps(str(certificate.resolve()))}"] if certificate else []),
        f"    user: {json.dumps(user)}",
        f"    password: ${{CAMERA_{name.upper()}_PASSWORD}}",
    ]
    if channels:
        lines.append(f"    channel: {channels[-1]}                              # of the motors")
    if {"flip", "mirror"} <= set(found.picture):
        flip, mirror = (str(found.picture[key]).lower() for key in ("flip", "mirror"))
        lines.append(f"    picture: {{flip: {flip}, mirror: {mirror}}}")
    lines += _streams(found)
    lines += [
        f"    tilt_range: [{tilt[0]:g}, {tilt[1]:g}]                   # {measured}",
        "    pan_dead_arc: [179, 186]                # not measured: what siblings of this camera have",
        f"    places: {name}                             # a folder; it is made when the first place is saved",
        "    # mount, camera_info, markers: see config/apartment.yaml; a scan needs them",
    ]
    return "\n".join(lines) + "\n"


def _streams(found: Findings) -> list[str]:
    """Where its moving pictures are, as far as that is not what the service supposes."""
    lines = [f"    rtsp_port: {found.rtsp_port}"] if found.rtsp_port not in (None, USUAL_PORT) else []
    if found.streams and "sub" not in found.streams:
        lines.append("    stream: {source: main}                  # the sub stream did not come")
    if found.rtsp_port is not None and not found.streams:
        lines.append(f"    # no moving pictures over RTSP: {found.unknown.get('sub stream', 'not tried')}")
    return lines


def profile(found: Findings) -> str:
    """The firmware as switches of the simulated camera."""
    lines = [
        f"# {found.model} {found.firmware} as it was seen; not found out: {', '.join(found.unknown) or 'nothing'}."
    ]
    lines += [f"# {note}" for note in _guessed(found)]
    lines += ["simulators:", "  camera:"]
    lines += [f"    profile: {found.like.name}"] if found.like and found.like.known else []
    lines += ["    switches:"]
    lines += [f"      {key}: {json.dumps(value)}" for key, value in switches(found).items()]
    return "\n".join(lines) + "\n"


def switches(found: Findings) -> dict[str, Any]:
    """What a simulator's profile takes, in its own words."""
    known = {key: value for key, value in found.switches.items() if value is not None}
    seen = {"model": found.model, "firmware": found.firmware, "built": found.built, **known}
    times = {"latency_s": "median", "latency_spread_s": "spread", "snapshot_s": "snapshot"}
    seen |= {ours: round(found.latency_ms[told] / 1000, 3) for ours, told in times.items() if told in found.latency_ms}
    if "reading" in found.delays_s:
        seen["status_lag_s"] = found.delays_s["reading"]
    if pan := _pan(found):
        seen["pan_speeds"] = every_level(pan)
    return seen


def every_level(measured: Mapping[int, float]) -> list[float]:
    """Speeds 1 to 8 from two or more: on straight lines through these in logarithms of level and speed. Pure."""
    known = sorted((level, max(speed, SLOWEST)) for level, speed in measured.items())
    pieces = list(pairwise(known))

    def at(level: int) -> float:
        (low, slow), (high, fast) = next((piece for piece in pieces if level <= piece[1][0]), pieces[-1])
        return slow * pow(level / low, log(fast / slow) / log(high / low))

    return [round(at(level), 2) for level in range(1, LEVELS + 1)]


def _pan(found: Findings) -> dict[int, float]:
    return {one.level: one.per_s for one in found.speeds if one.axis == "pan"}


def _guessed(found: Findings) -> list[str]:
    """What in a profile is no measurement, for its reader."""
    base = found.like.name if found.like and found.like.known else "the simulated camera's default"
    pan = sorted(_pan(found))
    if not pan:
        return [f"Speeds were not measured: they, and what else is not said, are those of {base}."]
    return [
        f"pan_speeds: {', '.join(map(str, pan))} are measured, the others lie on lines through these (in logarithms).",
        f"Accelerations and zoom were not measured: they, and what else is not said, are those of {base}.",
    ]


def recorded(found: Findings, wire: Wire) -> Mapping[str, str]:
    """The answers without names, by file name."""
    clean = anonymous.cleaner(found.serial, found.name, wire.user)
    files = anonymous.recorded(wire.exchanges, clean)
    if wire.heard:
        files["events.txt"] = clean(wire.heard.decode("latin-1"))
    return files


def write(folder: Path, found: Findings, wire: Wire, name: str) -> list[Path]:
    """Writes all of it; the files, in the order in which a reader wants them."""
    texts = {
        f"{name}.yaml": section(found, name, wire.user, wire.certificate),
        "profile.yaml": profile(found),
        "report.json": json.dumps(found.data(), indent=2) + "\n",
    }
    texts |= {f"replies/{file}": text for file, text in recorded(found, wire).items()}
    written = []
    for file, text in texts.items():
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8", newline="")
        written.append(path)
    return written
