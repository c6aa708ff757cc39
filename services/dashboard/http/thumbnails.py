"""Small pictures of a camera's places: taken when it stands at one anyhow, kept in the state folder.

Not here: who shows them (`static/views/camera.js`); making them smaller is all that is done to pictures here.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import logging
import time
from pathlib import Path

from services import topics
from services.dashboard.house import SNAPSHOT, House
from services.dashboard.http.video import Videos
from services.dashboard.thumbnail import smaller
from services.dashboard.view import Entry
from services.errors import Unavailable
from services.payloads import Position
from services.whole_file import write_whole

log = logging.getLogger(__name__)
TOPIC = "/dashboard/thumbnails/"  # our own: the places of a camera that have one, and since when (ms)
LOOK_S = 1.0
STANDS_S = 3.0  # so long it stood there before it is taken,
SHARP_S = 1.0  # and so long before it was exposed: the first pictures are still soft, and the newest may be late
AGAIN_S = 3600.0  # a younger one is not taken again
AFTER_FAILURE_S = 120.0


class Thumbnails:
    """`run` takes them as long as the server runs."""

    def __init__(self, house: House, videos: Videos) -> None:
        self.house, self.videos = house, videos
        self.folder = house.config.state / "dashboard" / "thumbnails" if house.config.state else None
        self._taken: dict[tuple[str, str], tuple[float, bytes]] = {}
        self._asked: set[tuple[str, str]] = set()  # the disk was asked once; what comes later comes from us
        self._not_before: dict[str, float] = {}
        self._stands: dict[str, tuple[str, float]] = {}  # by camera, at which place and since when
        self._trouble: dict[str, str] = {}  # by camera, what was told last

    async def run(self) -> None:
        """Until it is cancelled."""
        while True:
            await asyncio.sleep(LOOK_S)
            await self.look(time.time())

    async def look(self, now: float) -> None:
        """Takes those that are due; called again and again."""
        for camera in self.house.config.cameras:
            try:
                place = self._due(camera, now)
                if place is not None:
                    await self._take(camera, place, now)
            except (ValueError, OSError) as error:  # words that are none, a file that cannot be read: of this one alone
                self._troubled(camera, str(error))

    def get(self, camera: str, place: str) -> bytes | None:
        """The picture of a place."""
        found = self._taken.get((camera, place)) or self._read(camera, place)
        return found[1] if found else None

    def _due(self, camera: str, now: float) -> str | None:
        """The place whose picture is to be taken now: the camera has stood there a while, and does nothing else."""
        text = self.house.latest(topics.CAMERA_POSITION.name(cam=camera))
        scan = self.house.latest(topics.CAMERA_SCAN_STATE.name(cam=camera))
        self._tell(camera)
        before = self._stands.pop(camera, None)
        if text is None or (scan and json.loads(scan)["state"] == "running") or now < self._not_before.get(camera, 0):
            return None
        position = Position.model_validate_json(text)
        if position.moving or position.place is None:
            return None
        since = before[1] if before is not None and before[0] == position.place else now
        self._stands[camera] = position.place, since
        if now - since < STANDS_S:
            return None
        found = self._known(camera, position.place)
        return position.place if found is None or now - found[0] > AGAIN_S else None

    def _troubled(self, camera: str, why: str) -> None:
        """Told once."""
        if self._trouble.get(camera) != why:
            self._trouble[camera] = why
            log.warning("no small pictures of %s: %s", camera, why)

    async def _take(self, camera: str, place: str, now: float) -> None:
        url = self.house.picture_of(camera, SNAPSHOT)
        if not url:
            return
        try:
            still = await self.videos.snapshot(url)
        except Unavailable as error:
            log.info("no picture of %s at %s: %s", camera, place, error)
            self._not_before[camera] = now + AFTER_FAILURE_S
            return
        text = self.house.latest(topics.CAMERA_POSITION.name(cam=camera))
        there = Position.model_validate_json(text) if text is not None else None
        if there is None or there.moving or there.place != place:
            return  # it has turned away meanwhile
        if still.exposed < self._stands[camera][1] + SHARP_S:
            return
        small = await asyncio.to_thread(smaller, still.jpeg)
        if small is not None:
            self._taken[camera, place] = (now, small)
            self._write(camera, place, small)
        else:
            self._not_before[camera] = now + AFTER_FAILURE_S
        self._tell(camera)

    def _tell(self, camera: str) -> None:
        text = self.house.latest(topics.CAMERA_PLACES.name(cam=camera))
        known = {}
        for place in json.loads(text) if text else ():
            found = self._known(camera, place)
            if found is not None:
                known[place] = round(found[0] * 1000)
        told = json.dumps(known)
        if self.house.latest(f"{TOPIC}{camera}") != told:
            self.house.hub.spread([Entry(f"{TOPIC}{camera}", told, round(time.time() * 1000), "s")])

    def _file(self, camera: str, place: str) -> Path | None:
        """A place's name may hold anything, so its hash names the file."""
        name = hashlib.sha256(f"{camera}/{place}".encode()).hexdigest()[:24]
        return self.folder / f"{name}.jpg" if self.folder else None

    def _known(self, camera: str, place: str) -> tuple[float, bytes] | None:
        """When the picture of one of the camera's own places was taken, and the picture."""
        found = self._taken.get((camera, place))
        if found is None and (camera, place) not in self._asked:
            self._asked.add((camera, place))
            found = self._read(camera, place)
        return found

    def _read(self, camera: str, place: str) -> tuple[float, bytes] | None:
        file = self._file(camera, place)
        if file is None or not file.exists():
            return None
        found = self._taken[camera, place] = (file.stat().st_mtime, file.read_bytes())
        return found

    def _write(self, camera: str, place: str, small: bytes) -> None:
        file = self._file(camera, place)
        if file is None:
            return
        try:
            write_whole(file, small)
        except OSError as error:
            log.warning("%s cannot be kept: %s", file, error)
