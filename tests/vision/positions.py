"""How exact and how honest positions are, over random flats: the trial of the tests and of `make soak`.

Every sighting is placed three times: with exact readings, with noisy ones, and with noisy ones and a mount that was
calibrated from six markers. A part of them is zoomed.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from rich.console import Console
from rich.table import Table

from services.camera.scan.sightings import Eye, Sighting, Sought, results
from services.payloads import ScanResult
from services.vision.calibrate_mount import fit
from services.vision.frames import Array, quaternion
from tests import bounds
from tests.vision import mount_trials
from tests.vision.sighted import SIZE_M, Sighted, flat, placed, sighted

MOST_TIMES = 3.0  # the simulated camera's zoom
NINETY = 6.251  # chi-square of three numbers
FLIPPED_DEG = 15.0  # an orientation farther off than this is the other one
PER_SCENE, ZOOMED_PER_SCENE = 32, 8
INEXACT_DEG = 1e-4  # what "exact" readings are said to be
MARKERS = 6  # of a mount's calibration
Readings = Literal["exact", "noisy", "calibrated"]
READINGS: tuple[Readings, ...] = ("exact", "noisy", "calibrated")


@dataclass(frozen=True)
class Outcome:
    """One sighting and what came of it."""

    zoomed: bool
    readings: Readings
    off_mm: float
    inside: bool
    sure: bool
    flipped: bool
    magnification_off: float | None = None


@dataclass(frozen=True)
class Figures:
    """Of several outcomes."""

    count: int
    median_mm: float
    most_mm: float  # 95 of 100
    inside: float
    sure: int
    flipped: float  # share of the sure ones
    magnification: float | None  # median error, share

    @classmethod
    def of(cls, outcomes: Sequence[Outcome]) -> Figures:
        """ValueError when there are none."""
        off = [one.off_mm for one in outcomes]
        sure = [one for one in outcomes if one.sure]
        wrong = [one.magnification_off for one in outcomes if one.magnification_off is not None]
        return cls(
            len(outcomes),
            float(np.median(off)),
            float(np.percentile(off, 95)),
            sum(one.inside for one in outcomes) / len(outcomes),
            len(sure),
            sum(one.flipped for one in sure) / max(1, len(sure)),
            float(np.median(wrong)) if wrong else None,
        )


class Refusals(list[str]):
    """Why some sightings have no position."""


def scene(seed: int, count: int, zoomed: int, refused: Refusals) -> list[Outcome]:
    """The outcomes in one flat: so many wide sightings, and so many zoomed ones."""
    there, rng = flat(seed), np.random.default_rng(seed)
    noisy = replace(there.eye, angle_noise_deg=bounds.READ_NOISE_DEG)
    eyes: dict[Readings, Eye] = {
        "exact": replace(there.eye, angle_noise_deg=INEXACT_DEG),
        "noisy": noisy,
        "calibrated": _calibrated(noisy, rng),
    }
    outcomes = []
    for number in range(count + zoomed):
        times = 1.0 if number < count else rng.uniform(1.1, MOST_TIMES)
        one = sighted(there, placed(there, rng), rng, times=times)
        if not one.seen:
            refused.append(f"not seen: {one.side_px:.0f} px")
            continue
        for readings, eye in eyes.items():
            off = rng.normal(0, 0 if readings == "exact" else bounds.READ_NOISE_DEG, 2)
            outcome = _outcome(eye, one, off, times, readings, refused)
            if outcome is not None:
                outcomes.append(outcome)
    return outcomes


def _calibrated(eye: Eye, rng: np.random.Generator) -> Eye:
    """With a mount as its calibration finds it, from markers that were put a centimetre off."""
    truth = eye.mount
    assert truth is not None
    markers = mount_trials.spread(rng, truth, MARKERS)
    looks = mount_trials.looks_at(truth, markers, rng)
    found = fit(looks, mount_trials.placed(rng, markers), replace(truth, position=(0.0, 0.0, 0.0), yaw_deg=0.0))
    return replace(eye, mount=found.mount, mount_doubt=found.covariance[:6, :6])


def _outcome(
    eye: Eye, one: Sighted, off_deg: Array, times: float, readings: Readings, refused: Refusals
) -> Outcome | None:
    seen = [_misread(sighting, off_deg) for sighting in one.seen]
    (result,) = results(eye, Sought(one.marker.id, SIZE_M), seen, "scan", "color")
    if result.position is None:
        refused.append(str(result.why))
        return None
    off = one.off(np.array([result.position.x, result.position.y, result.position.z]))
    surprise = float(off @ np.linalg.solve(np.array(result.covariance), off))
    magnified = seen[0].magnified
    return Outcome(
        zoomed=times != 1.0,
        readings=readings,
        off_mm=1000 * float(np.linalg.norm(off)),
        inside=surprise < NINETY,
        sure=result.orientation is not None,
        flipped=_turned(result, one.marker.pose.rotation) > FLIPPED_DEG,
        magnification_off=abs(magnified.times / times - 1) if magnified else None,
    )


def _misread(sighting: Sighting, off: Array) -> Sighting:
    pan, tilt, zoom = sighting.reading.pan + off[0], sighting.reading.tilt + off[1], sighting.reading.zoom
    return replace(sighting, reading=replace(sighting.reading, pan=pan, tilt=tilt, zoom=zoom))


def _turned(result: ScanResult, truly: Array) -> float:
    """Degrees between the best orientation and the true one."""
    first = result.orientations[0]
    along = abs(float(np.dot([first.x, first.y, first.z, first.w], quaternion(truly))))
    return float(np.degrees(2 * np.arccos(min(1.0, along))))


def kinds(outcomes: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    """By whether they are zoomed, and what is known of the readings and the mount."""
    sorted_: dict[str, list[Outcome]] = {}
    for one in sorted(outcomes, key=lambda one: (one.zoomed, READINGS.index(one.readings))):
        sorted_.setdefault(f"{'zoomed' if one.zoomed else 'wide'}, {one.readings}", []).append(one)
    return sorted_


def table(outcomes: Sequence[Outcome], refused: Refusals) -> Table:
    """The figures of each kind, beside their bounds."""
    why = ", ".join(f"{count} x {why}" for why, count in Counter(refused).most_common())
    title = f"where a {SIZE_M} m marker is, 2 to 6 m, K = 8; without a position: {why or 'none'}"
    rows = Table("", "sightings", "median mm", "95 % mm", "bound", "in the 90 % ellipsoid", "orientation sure",
                 "of these flipped", "magnification off", title=title)  # fmt: skip
    for name, ones in kinds(outcomes).items():
        figures = Figures.of(ones)
        bound = bounds.EXACT_MM if "exact" in name else bounds.NOISY_MM
        magnification = "" if figures.magnification is None else f"{figures.magnification:.4%}"
        rows.add_row(
            name, str(figures.count), f"{figures.median_mm:.1f}", f"{figures.most_mm:.1f}",
            f"{bound[0]:.0f} / {bound[1]:.0f}", f"{figures.inside:.1%}", str(figures.sure), f"{figures.flipped:.1%}",
            magnification,
        )  # fmt: skip
    return rows


@contextmanager
def in_flats() -> Iterator[Callable[[random.Random], float]]:
    """Turns of one flat each, for `make soak`; at the end the table of all. A turn's figure is its median error."""
    outcomes: list[Outcome] = []
    refused = Refusals()

    def turn(rng: random.Random) -> float:
        fresh = scene(rng.randrange(10**6), PER_SCENE, ZOOMED_PER_SCENE, refused)
        outcomes.extend(fresh)
        return Figures.of(fresh).median_mm

    yield turn
    Console(width=170).print(table(outcomes, refused))
