"""The lens as a plan: pictures while a person shows a board, a word after each of what is missing, then the fit.

The camera stands still meanwhile, at its widest zoom. What is enough, and what is missing, is decided in
`vision/coverage.py`; the reckoning is `vision/calibrate_lens.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from services.camera.calibration.shots import BoardShot, How, board_in, taken
from services.camera.calibration.study import study
from services.camera.calibration.wishes import CalibrateLens
from services.camera.device import Away, Refused, Status
from services.camera.plan import Plan, attempt, wait
from services.vision.calibrate_lens import Fit, doubt_px, fit
from services.vision.coverage import Album

PAUSE_S = 0.3  # between two pictures: a person cannot hold it elsewhere sooner
FOCAL_DOUBT, PIXEL_DOUBT = 0.001, 1.5  # good enough: of the focal length, and px at the worst spot of the picture
POOR_FOCAL_DOUBT, FEWEST = 0.003, 8  # still better than nothing when the time is over
MORE = 4  # views between two fits

Told = Callable[["Showing"], None]


@dataclass
class Showing:
    """One calibration of the lens. `shots` belong to the views of `album`; `said` is for the person."""

    wish: CalibrateLens
    how: How
    tell: Told
    album: Album | None = None
    shots: list[BoardShot] = field(default_factory=list)
    said: str = "show the board"
    found: Fit | None = None
    looked: int = 0

    @property
    def progress(self) -> float:
        """0 to 1."""
        return self.album.progress if self.album else 0.0

    def plan(self, now: float) -> Plan[Fit]:
        """Ends with the lens; DeviceError when too little was shown in time."""
        until, tried = now + self.wish.seconds, 0
        while True:
            now = yield from self._look(now)
            self.tell(self)
            views = len(self.shots)
            if self.album is not None and not self.album.missing and views >= tried + MORE:
                tried = views
                found, now = yield from self._fitted()
                if found is not None and not self._lacking(found):
                    return found
            if now > until:
                return (yield from self._at_the_end())
            yield from attempt(Status())  # nobody else asks while the motors are held: whether it is still there
            now = yield from wait(now + PAUSE_S)

    def _look(self, now: float) -> Plan[float]:
        jpeg, now = yield from taken(now)
        try:
            shot, now = yield from study(lambda: board_in(jpeg, self.how, self.wish.board))
        except Away:  # half a picture
            return now
        self.looked += 1
        if self.album is None:
            self.album = Album(shot.size)
        if shot.size != self.album.size:
            raise Refused(f"the pictures changed their size from {self.album.size} to {shot.size}")
        self.said = self._taken(shot, self.album)
        return now

    def _taken(self, shot: BoardShot, album: Album) -> str:
        """Takes a view into the album where it is of use; what to say about it."""
        if shot.seen is None:
            return f"no board is seen; {album.missing}" if album.views else "no board is seen yet"
        before = [one.seen for one in album.views]
        why_not = album.add(shot.seen)
        for index, one in enumerate(album.views):
            if one.seen is shot.seen and index < len(before):
                self.shots[index] = shot
            elif one.seen is shot.seen:
                self.shots.append(shot)
        return "; ".join(filter(None, (why_not or "taken", album.missing)))

    def _fitted(self) -> Plan[tuple[Fit | None, float]]:
        """The fit as it is now; None when the views do not fit together yet."""
        assert self.album is not None
        seen, size, model = [one.seen for one in self.album.views], self.album.size, self.wish.model
        self.said = "that is enough, it is reckoned"
        self.tell(self)
        now = yield from wait(0.0)
        try:
            self.found, now = yield from study(lambda: fit(seen, size, model))
        except Refused as error:
            self.said = str(error)
            self.tell(self)
            return None, now
        return self.found, now

    def _lacking(self, found: Fit) -> str:
        """What the fit still lacks, as told to the person; empty when it is good."""
        worst = float(np.nanmax(doubt_px(found)))
        if found.focal_doubt > FOCAL_DOUBT:
            self.said = "not sure of the focal length yet: tilt it more, nearer"
        elif worst > PIXEL_DOUBT:
            self.said = f"up to {worst:.1f} px unsure at the rim: show it in the corners and along the edges, nearer"
        else:
            self.said = ""
        self.tell(self)
        return self.said

    def _at_the_end(self) -> Plan[Fit]:
        """The time is over: what there is, when it is of some use."""
        lacking = (self.album.missing if self.album and self.shots else "") or self.said
        if len(self.shots) < FEWEST:
            raise Refused(f"{len(self.shots)} views of the board in {self.wish.seconds:.0f} s are too few: {lacking}")
        found, _ = yield from self._fitted()
        if found is None or found.focal_doubt > POOR_FOCAL_DOUBT or self.progress < 0.6:
            raise Refused(f"too little was shown in {self.wish.seconds:.0f} s: {lacking}")
        self.said = f"the time is over; it would be better with more: {lacking}"
        return found
