"""What was learnt of a camera's motors, kept over a restart: a small file for each camera, by serial and firmware.

Another camera under the same name, or another firmware, begins anew. A file that cannot be read is as none. A thread
writes it: a disk takes its time, and whoever waits for the end of a move, or gives the next order, does not.
"""

from __future__ import annotations

import logging
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from services.camera.device import Identity
from services.camera.ptz.pace import Pace
from services.camera.ptz.planes import Planes
from services.camera.ptz.skill import KEEP, ZOOM_UNSURE, Honours, RelativeForm, Sense, Skill
from services.camera.ptz.zoom_rate import Fit, ZoomRate
from services.whole_file import write_whole

Pair = tuple[float, float]
Triple = tuple[float, float, float]
SHOW_THEM = "its first moves take longer, unless `apartment calibrate ptz {}` shows them to it"
log = logging.getLogger(__name__)


class _Filter(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    mean: list[float]
    cov: list[list[float]]


class _Law(_Filter):
    likely: float


class _Kept(BaseModel):
    """The file; what is in one of an older version and no longer known is left."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    serial: str
    firmware: str
    paces: tuple[_Filter, _Filter, _Filter]
    drives: tuple[_Filter, _Filter, _Filter]
    picture: tuple[bool, bool]
    senses: tuple[tuple[int, bool], tuple[int, bool]]
    took: list[float]
    count: int
    worst: float
    surprise: float
    arrives_late: float
    exact: int = 0
    steady: int = 0
    diagonals: bool
    zoom_steps: list[float]
    zoom_rate: Pair | None = None
    zoom_fits: list[Fit] = []
    honours: dict[str, Honours]
    beside: dict[str, Pair]
    presets: dict[int, Triple]
    scales: dict[RelativeForm, dict[str, _Law]] = {}
    strayed: dict[RelativeForm, Pair] = {}
    strayed_flying: dict[RelativeForm, Pair] = {}


class Kept:
    """One camera's file; without a folder nothing is kept."""

    def __init__(self, folder: Path | None, camera: str) -> None:
        self.camera, self.file = camera, folder / "cameras" / f"{camera}.json" if folder else None
        self.identity: Identity | None = None
        self._writer = ThreadPoolExecutor(1, "kept motors")

    def recall(self, identity: Identity, skill: Skill) -> None:
        """It is known which camera this is: takes in what was kept of that one."""
        if self.identity == identity:
            return
        self.identity = identity
        kept = self._read()
        if kept is not None and (kept.serial, kept.firmware) == (identity.serial, identity.version):
            _take_in(kept, skill)
            log.info("what was learnt of the motors of %s is known again", identity.serial)
        else:
            log.info("the motors of %s are not known yet: %s", identity.serial, SHOW_THEM.format(self.camera))

    def save(self, skill: Skill) -> None:
        """Has it written, as a whole; `written` waits for that."""
        if self.file is not None and self.identity is not None:
            self._writer.submit(_write, self.file, _kept(self.identity, skill).model_dump_json())

    def written(self) -> None:
        """Returns when all that was to be kept is on the disk, or could not be."""
        self._writer.submit(lambda: None).result()

    def _read(self) -> _Kept | None:
        return _read(self.file) if self.file is not None else None


def recalled(folder: Path, camera: str) -> Skill | None:
    """What is kept of a camera, whichever it is; None when nothing is."""
    kept = _read(folder / "cameras" / f"{camera}.json")
    if kept is None:
        return None
    skill = Skill(picture=kept.picture)
    _take_in(kept, skill)
    return skill


def _write(file: Path, text: str) -> None:
    try:
        write_whole(file, text)
    except OSError as error:
        log.warning("what was learnt of the motors is not kept: %s", error)


def _read(file: Path) -> _Kept | None:
    if not file.exists():
        return None
    try:
        return _Kept.model_validate_json(file.read_text(encoding="utf-8"))
    except (OSError, ValidationError, UnicodeDecodeError) as error:
        log.warning("%s cannot be read, the motors are learnt anew: %s", file, str(error)[:200])
        return None


def _kept(identity: Identity, skill: Skill) -> _Kept:
    return _Kept(
        serial=identity.serial,
        firmware=identity.version,
        paces=_paces(skill.paces),
        drives=_paces(skill.drives),
        picture=skill.picture,
        senses=((skill.senses[0].sign, skill.senses[0].sure), (skill.senses[1].sign, skill.senses[1].sure)),
        took=list(skill.timing.took),
        count=skill.timing.count,
        worst=skill.timing.worst,
        surprise=skill.surprise,
        arrives_late=skill.arrives_late,
        exact=skill.exact,
        steady=skill.steady,
        diagonals=skill.diagonals,
        zoom_steps=skill.zoom_steps,
        zoom_rate=skill.zoom_rate.guess,
        zoom_fits=skill.zoom_rate.fits,
        honours=skill.honours,
        beside=skill.beside,
        presets=skill.presets,
        scales={
            form: {one.law.name: _Law(likely=one.likely, **_kept_filter(one).model_dump()) for one in scale.laws}
            for form, scale in skill.scales.items()
        },
        strayed={form: (scale.rested.square, scale.rested.looks) for form, scale in skill.scales.items()},
        strayed_flying={form: (scale.flying.square, scale.flying.looks) for form, scale in skill.scales.items()},
    )


def _paces(paces: tuple[Pace, Pace, Pace]) -> tuple[_Filter, _Filter, _Filter]:
    pan, tilt, zoom = map(_kept_filter, paces)
    return pan, tilt, zoom


def _kept_filter(known: Pace | Planes) -> _Filter:
    return _Filter(mean=known.mean.round(9).tolist(), cov=known.cov.round(12).tolist())


def _take_in(kept: _Kept, skill: Skill) -> None:
    filters: list[tuple[Pace | Planes, _Filter]] = [
        *zip((*skill.paces, *skill.drives), (*kept.paces, *kept.drives), strict=True)
    ]
    for form, scale in skill.scales.items():
        for strays, seen in ((scale.rested, kept.strayed), (scale.flying, kept.strayed_flying)):
            strays.square, strays.looks = seen.get(form, (strays.square, strays.looks))
        for planes in scale.laws:
            law = kept.scales.get(form, {}).get(planes.law.name)
            if law is not None:
                planes.likely = law.likely
                filters.append((planes, law))
    for own, known in filters:
        mean, cov = np.array(known.mean, float), np.array(known.cov, float)
        if mean.shape == own.mean.shape and cov.shape == own.cov.shape:
            own.mean, own.cov = mean, cov
    if kept.picture == skill.picture:
        skill.senses = (Sense(*kept.senses[0]), Sense(*kept.senses[1]), skill.senses[2])
    skill.timing.took = deque(kept.took[:-1], maxlen=KEEP)
    if kept.took:
        skill.timing.learn(kept.took[-1])
    skill.timing.count, skill.timing.worst = kept.count, kept.worst
    skill.surprise, skill.arrives_late = kept.surprise, kept.arrives_late
    skill.steady, skill.exact = kept.steady, kept.exact
    if kept.zoom_rate is not None:
        rate, doubt = kept.zoom_rate
        skill.zoom_rate = ZoomRate(rate, ZOOM_UNSURE if kept.zoom_fits else doubt, kept.zoom_fits)
    skill.diagonals, skill.zoom_steps, skill.honours = kept.diagonals, kept.zoom_steps, kept.honours
    skill.beside, skill.presets = kept.beside, kept.presets
