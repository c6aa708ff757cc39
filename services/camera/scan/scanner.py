"""Runs scans: hands frames to the ones who look for markers, and publishes how far it is and what came out.

The scan itself is `search.py`; looking `analysis.py`; from sightings to places in the apartment `sightings.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Literal
from uuid import uuid4

from services import topics
from services.bus import Message
from services.camera.bulletin import Bulletin
from services.camera.orders import ScanFor
from services.camera.places import Places
from services.camera.plan import Plan, attempt
from services.camera.ptz.skill import Skill
from services.camera.requests import GetPicture, Picture, Refused
from services.camera.scan import sightings
from services.camera.scan.analysis import Analysed, Analyst, Task
from services.camera.scan.route import shortest
from services.camera.scan.search import Frame, Scan, Take, snapshot
from services.camera.scan.sightings import Eye, Sought
from services.camera.scan.streamed import Streamed
from services.camera.settings import Config
from services.payloads import OrderState, Place, ScanResult, ScanState

STATE_S = 0.5  # between two states of a scan that runs


class Scanner:
    """At most one scan at a time. `analyst` makes the one that looks at frames, a new one for each scan."""

    def __init__(
        self, config: Config, skill: Skill, eye: Eye, analyst: Callable[[], Analyst], bulletin: Bulletin, places: Places
    ) -> None:
        self.config = config
        self.skill = skill
        self.eye = eye
        self.analyst = analyst
        self.bulletin = bulletin
        self.places = places
        self.targets = config.targets
        self.routine = config.routine
        self.show = False
        self.picture = Picture(config.picture.flip, config.picture.mirror, "color")
        self.seen_at: dict[int, str] = {}  # by marker, the place that showed it best
        self.frames = 0
        self.scan: Scan | None = None
        self._looking: Analyst | None = None
        self._state_at = 0.0

    @property
    def kind(self) -> Literal["ceiling", "shelf"]:
        """How the camera is mounted."""
        return self.config.kind

    def check(self, order: ScanFor) -> None:
        """Refused when it cannot be done."""
        self._visits(order)
        if not (order.targets or self.targets):
            raise Refused("no targets: give some with SetTarget or with the order")

    def plan(self, order: ScanFor, now: float) -> Plan[None]:
        """A new scan."""
        take = self._take()
        self.scan = Scan(
            name=uuid4().hex[:12],
            targets=order.targets or self.targets,
            routine=self._visits(order),
            limits=self.config.limits,
            skill=self.skill,
            began=now,
            frames=self.config.frames,
            settle_s=self.config.settle_s if take is snapshot else 0.0,  # a stream's pictures tell their time
            stop_early=self.config.stop_early,
            move_timeout_s=self.config.move_timeout_s,
            kind=self.kind,
            take=take,
        )
        self._looking = self.analyst()
        return self._run(self.scan)

    def take(self, analysed: Analysed) -> None:
        """What was found in a frame; nobody's when its scan has ended."""
        if self.scan is None or analysed.scan != self.scan.name:
            return
        self.scan.add(analysed)
        if analysed.jpeg is not None and self.show:
            self._publish(topics.CAMERA_SCAN_IMAGE.message(analysed.jpeg, cam=self.config.name))

    def tick(self, now: float) -> None:
        """Publishes how far it is."""
        if self.scan is None:
            if self._state_at == 0.0:
                self._state_at = now
                self._say(ScanState(state="idle", targets=list(self.targets)))
        elif now - self._state_at >= STATE_S:
            self._state_at = now
            self._say(self.scan.state("running", now))

    def ended(self, state: OrderState, error: str | None, now: float) -> None:
        """The order of the scan has ended: results, when it was done."""
        scan = self.scan
        self.close()
        if scan is None:
            return
        self.scan = None
        if state == "done":
            self._results(scan)
        last: Literal["done", "cancelled", "failed"] = (
            "done" if state == "done" else "cancelled" if state == "cancelled" else "failed"
        )
        self._say(scan.state(last, now, error or ""))

    def close(self) -> None:
        """Ends the processes that look at frames."""
        if self._looking is not None:
            self._looking.close()
            self._looking = None

    def _take(self) -> Take:
        """Where the frames come from."""
        video, lens = self.bulletin.video, self.eye.lens
        if self.config.scan_pictures == "snapshot" or video is None or not video.timed:
            return snapshot
        return Streamed(video, lens.width / lens.height if lens else None)

    def _run(self, scan: Scan) -> Plan[None]:
        yield from attempt(GetPicture())  # how the frames will be turned, as far as the camera tells
        yield from scan.plan(lambda frame, jpeg: self._look(scan, frame, jpeg))

    def _look(self, scan: Scan, frame: Frame, jpeg: bytes) -> None:
        self.frames += 1
        assert self._looking is not None
        task = Task(
            scan=scan.name,
            number=frame.number,
            jpeg=jpeg,
            flip=self.picture.flip,
            mirror=self.picture.mirror,
            kind=self.kind,
            dictionary=self.config.dictionary,
            targets=scan.targets,
            draw=self.show,
        )
        self._looking.submit(task)

    def _visits(self, order: ScanFor) -> dict[str, Place]:
        """The places to visit in their order; Refused when there are none, or one is not known."""
        names = order.places or self.routine
        if names is None:
            names = self._shortest(order.targets or self.targets)
        if not names:
            raise Refused("no places to visit: save some with SaveAs")
        return {self.places.find(name): self.places.get(name) for name in names}

    def _shortest(self, targets: Iterable[int]) -> tuple[str, ...]:
        """All places, first the one where a target was seen last."""
        named = self.places.named
        first = next((self.seen_at[one] for one in targets if self.seen_at.get(one) in named), None)
        return tuple(shortest(named, self.config.limits, self.bulletin.reading, self.skill, first=first))

    def remember(self, result: ScanResult) -> None:
        """A result, also of another life of this service: where that marker was seen last."""
        self.seen_at[result.marker] = result.place

    def _results(self, scan: Scan) -> None:
        for marker, seen in sorted(scan.seen.items()):
            sought = Sought(marker, self.config.markers.of(marker), self.config.markers.prior(marker))
            results = sightings.results(self.eye, sought, seen, scan.name, self.picture.mode)
            for result in results:
                self._publish(topics.CAMERA_SCAN_RESULT.message(result, cam=self.config.name))
            self._publish(topics.CAMERA_MARKER.message(results[0], cam=self.config.name, marker=marker))
            self.remember(results[0])

    def _say(self, state: ScanState) -> None:
        self.bulletin.say(topics.CAMERA_SCAN_STATE, state)

    def _publish(self, message: Message) -> None:
        self.bulletin.publish(message)
