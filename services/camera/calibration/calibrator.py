"""Calibrations as they are ordered: the plan for each, what is said meanwhile, and what becomes of the result.

How a lens, a mount, a zoom is learnt is in `lens.py`, `mount.py` and `zoom.py`, the motors in `ptz/`; the files are in
`files.py` and `services/apartment/zoom_levels.py`.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

from services import topics
from services.apartment import zoom_levels
from services.bus import Message
from services.camera import orders
from services.camera.calibration import files, lens_page, mount_page, zoom_page
from services.camera.calibration.lens import Showing
from services.camera.calibration.mount import Touring
from services.camera.calibration.section import settings
from services.camera.calibration.shots import How, compared, taken
from services.camera.calibration.study import study
from services.camera.calibration.wishes import CalibrateLens, CalibrateMount, CalibrateZoom, TakeLens
from services.camera.calibration.zoom import Climb
from services.camera.device import GetPicture, Refused
from services.camera.plan import Plan, attempt, wait
from services.camera.ptz.trips import Trips
from services.camera.ptz.zooming import widest
from services.camera.scan.scanner import Scanner
from services.camera.settings import Config
from services.errors import DeviceError
from services.payloads import Calibration
from services.vision.calibrate_mount import FEWEST
from services.vision.frames import Mount
from services.vision.lens import ASPECT_TOLERANCE, Lens
from services.vision.mount_squares import Known
from services.whole_file import write_whole

SETTLE_S = 0.6  # from rest to a picture that shows it, where the configuration does not say

log = logging.getLogger(__name__)


class Calibrator:
    """Learns about one camera; what it learns is used from then on, also by `scanner`."""

    def __init__(self, config: Config, trips: Trips, scanner: Scanner, publish: Callable[[Message], None]) -> None:
        self.config, self.trips, self.scanner, self.publish = config, trips, scanner, publish

    def plan(self, command: orders.Calibration, now: float) -> Plan[object]:
        """The plan of one order; DeviceError in it when nothing came of it."""
        if isinstance(command, orders.Calibrate):
            return self.trips.calibrate()
        if isinstance(command, CalibrateLens):
            self._lens_file()
            return self._told("lens", self._learn_lens(command, now))
        if isinstance(command, CalibrateZoom):
            self._lens_file()
            return self._told("zoom", self._learn_zoom(now))
        return self._told("mount", self._learn_mount(self._touring(command), now))

    def take_lens(self, order: TakeLens, now: float) -> Plan[None]:
        """A lens that somebody else has calibrated: kept and used."""
        self._keep(order.lens, now)
        yield from ()

    def _told(self, what: Literal["lens", "mount", "zoom"], plan: Plan[Calibration]) -> Plan[object]:
        """Says how it ended, whichever way."""
        last = Calibration(what=what, state="cancelled")
        try:
            last = yield from plan
        except DeviceError as error:
            last = last.model_copy(update={"state": "failed", "said": str(error)})
            raise
        finally:
            self._say(last)
        return last

    def _learn_lens(self, wish: CalibrateLens, now: float) -> Plan[Calibration]:
        now = yield from self._ready(now)
        showing = Showing(wish, How(self.scanner.picture, self.scanner.kind), self._say_showing)
        found = yield from showing.plan(now)
        page, now = yield from study(lambda: lens_page.page(self.config.name, wish, found, showing.shots))
        file = self._keep(found.lens, now)
        return _of(showing).model_copy(
            update={
                "state": "done",
                "progress": 1.0,
                "values": found.values,
                "file": str(file),
                "report": self._report("lens", page),
            }
        )

    def _touring(self, wish: CalibrateMount) -> Touring:
        """Refused when it cannot be begun."""
        eye, config = self.scanner.eye, self.config
        places = {**config.markers.known, **dict(wish.markers)}
        if eye.lens is None:
            raise Refused("the camera has no camera_info: calibrate the lens first")
        if len(places) < FEWEST:
            raise Refused(f"{len(places)} markers at known places, {FEWEST} are needed: in the order, or markers.known")
        return Touring(
            {marker: Known(place, config.markers.of(marker), wish.doubt_m) for marker, place in places.items()},
            eye.lens,
            eye.mount or Mount((0.0, 0.0, 0.0), config.kind),
            eye.mount is not None,
            config.dictionary,
            How(self.scanner.picture, self.scanner.kind),
            config.limits,
            self.trips.skill,
            config.settle_s or SETTLE_S,
            config.reading_noise_deg,
            self._say_touring,
        )

    def _learn_mount(self, touring: Touring, now: float) -> Plan[Calibration]:
        now = yield from self._ready(now)
        touring.how = How(self.scanner.picture, self.scanner.kind)
        found = yield from touring.plan(now)
        known, stops, name = touring.known, touring.stops, self.config.name
        page, _ = yield from study(lambda: mount_page.page(name, known, found, stops))
        self.scanner.eye = replace(self.scanner.eye, mount=found.mount, mount_doubt=found.covariance[:6, :6])
        wrong = [str(marker) for marker, one in found.markers.items() if one.misplaced]
        return Calibration(
            what="mount",
            state="done",
            progress=1.0,
            views=len(stops),
            said=f"not where they were said to be: {', '.join(wrong)}" if wrong else "",
            values=mount_page.values(found),
            mount=settings(found.mount),
            report=self._report("mount", page),
        )

    def _learn_zoom(self, now: float) -> Plan[Calibration]:
        yield from self._ready(now)
        how = How(self.scanner.picture, self.scanner.kind)
        climb = Climb(
            self.config.limits, self.trips.skill, self._look, lambda a, b: compared(a, b, how), self._say_climb
        )
        found = yield from climb.plan()
        lens, file = self.scanner.eye.lens, zoom_levels.of_lens(self._lens_file())
        page, _ = yield from study(lambda: zoom_page.page(self.config.name, found, climb.visits, lens, climb.wide, how))
        try:
            zoom_levels.write(file, found, lens)
        except OSError as error:
            raise Refused(f"{file} cannot be written: {error.strerror or error}") from error
        self.scanner.eye = replace(self.scanner.eye, levels=found)
        return Calibration(
            what="zoom",
            state="done",
            progress=1.0,
            views=len(climb.visits),
            values=zoom_page.values(found, lens),
            file=str(file),
            report=self._report("zoom", page),
        )

    def _look(self, now: float) -> Plan[tuple[bytes, float]]:
        now = yield from wait(now + (self.config.settle_s or SETTLE_S))
        return (yield from taken(now))

    def _say_climb(self, climb: Climb) -> None:
        views, progress = len(climb.visits), round(climb.progress, 3)
        self._say(Calibration(what="zoom", state="running", progress=progress, views=views, said=climb.said))

    def _ready(self, now: float) -> Plan[float]:
        """The widest zoom, and how the picture is delivered."""
        zoom = self.trips.bulletin.known().zoom
        if zoom > self.config.zoom_range[0]:
            now = (yield from self.trips.plan(orders.LookAt(zoom=self.config.zoom_range[0]), now)).at
        now = yield from widest(self.config.limits, self.trips.skill, now)
        yield from attempt(GetPicture())
        return (yield from wait(now + (self.config.settle_s or SETTLE_S)))

    def _keep(self, lens: Lens, now: float) -> Path:
        """Writes the lens, and uses it."""
        file, old = self._lens_file(), self.scanner.eye.lens
        if old is not None and abs(lens.width / lens.height / (old.width / old.height) - 1) > ASPECT_TOLERANCE:
            had = f"{old.width}x{old.height}"
            raise Refused(f"expected a picture of the shape of {had}, got {lens.width}x{lens.height}")
        backup = files.write_lens(file, lens, self.config.name, now)
        self.scanner.eye = replace(self.scanner.eye, lens=lens)
        log.info("%s: a new lens is in %s and in use; the old one is %s", self.config.name, file, backup or "none")
        return file

    def _lens_file(self) -> Path:
        if self.config.camera_info is None:
            raise Refused("the configuration of the camera names no file for it: expected camera_info there")
        return self.config.folder / self.config.camera_info

    def _report(self, what: str, page: str) -> str | None:
        """Writes the page; where it is, None when there is no folder for it."""
        if self.config.state is None:
            return None
        file = self.config.state / "cameras" / f"{self.config.name}-{what}.html"
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            write_whole(file, page)
        except OSError as error:
            log.warning("the report is not kept: %s", error)
            return None
        return str(file)

    def _say_touring(self, touring: Touring) -> None:
        views, progress = len(touring.stops), round(touring.progress, 3)
        self._say(Calibration(what="mount", state="running", progress=progress, views=views, said=touring.said))

    def _say_showing(self, showing: Showing) -> None:
        self._say(_of(showing))

    def _say(self, calibration: Calibration) -> None:
        self.publish(topics.CAMERA_CALIBRATION.message(calibration, cam=self.config.name))


def _of(showing: Showing) -> Calibration:
    album = showing.album
    return Calibration(
        what="lens",
        state="running",
        progress=round(showing.progress, 3),
        views=len(showing.shots),
        said=showing.said,
        regions=album.regions.tolist() if album else [],
    )
