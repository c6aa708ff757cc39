"""Runs scans: hands frames to the ones who look for markers, and publishes how far it is and what came out.

The scan itself is `search.py`; looking `analysis.py`; from sightings to places in the apartment `sightings.py`.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from typing import Literal
from uuid import uuid4

from services import topics
from services.bus import Message
from services.camera.bulletin import Bulletin
from services.camera.device import Away, Picture, Refused
from services.camera.places import Places
from services.camera.plan import Plan, wait
from services.camera.ptz.skill import Skill
from services.camera.scan import sightings
from services.camera.scan.album import Album
from services.camera.scan.analysis import Analysed, Analyst, Task
from services.camera.scan.findings import Findings, Frame
from services.camera.scan.live import Live
from services.camera.scan.modes import Modes
from services.camera.scan.route import shortest
from services.camera.scan.search import Scan
from services.camera.scan.sightings import Eye, Sought
from services.camera.scan.source import Moving, Source
from services.camera.scan.wish import ScanFor
from services.camera.settings import Config
from services.errors import DeviceError
from services.memory import give_back
from services.payloads import OrderState, Place, ScanResult, ScanState

STATE_S = 0.5  # between two states of a scan that runs and finds nothing
GATHER_S = 0.1  # between two looks whether frames have come
RESTORE_S = 5.0  # between two tries to restore the picture

log = logging.getLogger(__name__)


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
        self.modes = Modes(config.state and config.state / "cameras" / f"{config.name}-picture.json")
        self.album = Album(config.state and config.state / "cameras" / f"{config.name}-seen", config.hits)
        self.due: float | None = None  # when frames are to be handed on
        self.begin: Callable[[Plan[None], float], None] = lambda plan, now: None  # a plan whose end nobody waits for
        self.moving: Moving | None = None  # another stream than the camera's own: in virtual time
        self._moving: Moving | None = None
        self._looking: Analyst | None = None
        self._state_at = 0.0
        self._news = False  # something was found that is not told yet

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
        self.modes.forget()
        self.album.begin()
        routine, targets = self._visits(order), order.targets or self.targets
        self.scan = Scan(
            name=uuid4().hex[:12],
            findings=Findings(targets, order.frames or self.config.frames, self.kind),
            routine=routine,
            limits=self.config.limits,
            skill=self.skill,
            began=now,
            source=Source(self._stream(), self.skill, self.config.settle_s),
            modes=self.modes,
            stop_early=self.config.stop_early and not order.full,
            second="always" if order.full else self.config.second_turn,
            mode=self.picture.mode,
            near=self.bulletin.at_rest(now),
            slack=self.eye.slack_deg,
            move_timeout_s=self.config.move_timeout_s,
            likely=next(
                (place for place in map(self.seen_at.get, order.targets or self.targets) if place in routine), None
            ),
        )
        self._looking = self.analyst()
        scan = self.scan
        return scan.plan(lambda frame, jpeg: self._look(scan, frame, jpeg))

    def take(self, analysed: Analysed) -> None:
        """What was found in a frame; nobody's when its scan has ended."""
        if self.scan is None or analysed.scan != self.scan.name:
            return
        self._news = self.scan.findings.add(analysed) or self._news
        if analysed.jpeg is not None and analysed.detections:
            frame = self.scan.findings.taken[analysed.number]
            markers = sorted({one.marker for one in analysed.detections})
            self.album.keep(frame.place, id(frame.spot), markers, frame.at, analysed.jpeg)
        if analysed.jpeg is not None and self.show:
            self._publish(topics.CAMERA_SCAN_IMAGE.message(analysed.jpeg, cam=self.config.name))

    def tick(self, now: float) -> None:
        """Publishes how far it is, and hands on the frames that have come."""
        if self.scan is None:
            self.due = None
            if self._state_at == 0.0:
                self._state_at = now
                self._say(ScanState(state="idle", targets=list(self.targets)))
            return
        self.due = now + GATHER_S
        self.scan.gather()
        if self._news or now - self._state_at >= STATE_S:
            self._state_at, self._news = now, False
            self._say(self.scan.state("running", now))

    def ended(self, state: OrderState, error: str | None, now: float) -> None:
        """The order of the scan has ended: results, unless it was cancelled."""
        scan = self.scan
        self.close()
        if scan is None:
            return
        scan.source.close()
        self.scan = None
        give_back()
        if self.modes.changed:
            self.begin(self.restored(), now)
        if state != "cancelled":
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
        if self._moving is not None:
            self._moving.close()

    def restored(self) -> Plan[None]:
        """The picture as it was before a scan changed it, also one of another life; tried until the camera takes it.

        Who finds another at it leaves it to him.
        """
        while self.modes.changed and not self.modes.leaving and (self.scan is None or self.scan.turn == 1):
            try:
                yield from self.modes.leave()
            except DeviceError as error:
                log.warning("%s: the picture is not yet as it was: %s", self.config.name, error)
                if not isinstance(error, Away):
                    return
                yield from wait((yield from wait(0.0)) + RESTORE_S)

    def _stream(self) -> Moving | None:
        """The camera's moving picture, where frames are to come from it."""
        if self.config.scan_pictures == "snapshot":
            return None
        if self.moving is not None:
            self._moving = self.moving
        elif self._moving is None and self.bulletin.video is not None:
            lens = self.eye.lens
            self._moving = Live(self.bulletin.video, lens.width / lens.height if lens else None)
        return self._moving

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
            targets=scan.findings.targets,
            draw=self.show,
            still=id(frame.spot),
            of=frame.spot.wanted,
        )
        self._looking.submit(task)

    def _visits(self, order: ScanFor) -> dict[str, Place]:
        """The places to visit in their order; Refused when there are none, or one is not known."""
        names = order.places or self.routine
        if names is None:
            turns = 2 if order.full or self.config.second_turn == "always" else 1
            names = self._shortest(order.targets or self.targets, turns)
        if not names:
            raise Refused("no places to visit: save some with SaveAs")
        return {self.places.find(name): self.places.get(name) for name in names}

    def _shortest(self, targets: Iterable[int], turns: int) -> tuple[str, ...]:
        """All places; first the one where a target was seen last, if the scan may end there."""
        named, first = self.places.named, None
        if turns == 1 and self.config.stop_early:
            first = next((self.seen_at[one] for one in targets if self.seen_at.get(one) in named), None)
        reading = self.bulletin.reading
        return tuple(shortest(named, self.config.limits, reading, self.skill, first=first, turns=turns))

    def remember(self, result: ScanResult) -> None:
        """A result, also of another life of this service: where that marker was seen last."""
        self.seen_at[result.marker] = result.place

    def _results(self, scan: Scan) -> None:
        for marker, seen in sorted(scan.findings.seen.items()):
            sought = Sought(marker, self.config.markers.of(marker), self.config.markers.prior(marker))
            results = sightings.results(self.eye, sought, seen, scan.name, scan.findings.mode_of(marker))
            for result in reversed(results):  # so that the newest is the last
                self._publish(topics.CAMERA_SCAN_RESULT.message(result, cam=self.config.name))
            self._publish(topics.CAMERA_MARKER.message(results[0], cam=self.config.name, marker=marker))
            self.remember(results[0])

    def _say(self, state: ScanState) -> None:
        self.bulletin.say(topics.CAMERA_SCAN_STATE, state)

    def _publish(self, message: Message) -> None:
        self.bulletin.publish(message)
