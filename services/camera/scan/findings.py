"""What has come out of a scan so far: its frames, what was seen in them, and whether a place can add anything. Pure.

Not here: the scan itself (`search.py`), from what was seen to places in the apartment (`sightings.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

from services.camera.device import Reading
from services.camera.scan.analysis import Analysed
from services.camera.scan.sightings import Sighting, between
from services.camera.scan.source import Spot
from services.payloads import Place
from services.vision.frames import Kind

WELL = 2  # frames that must show a target before a scan may end early
NEARER_DEG = 3.0  # a place that looks less nearer than this is not worth the way


@dataclass(frozen=True)
class Frame:
    """When and where a picture was taken, at rest; its bytes are not kept."""

    number: int
    place: str
    reading: Reading
    at: float
    spot: Spot


@dataclass
class Findings:
    """`frames`: how many are wanted at each place."""

    targets: tuple[int, ...]
    frames: int
    kind: Kind = "ceiling"
    taken: list[Frame] = field(default_factory=list)
    analysed: int = 0
    unreadable: dict[str, str] = field(default_factory=dict)  # by place, why
    seen: dict[int, list[Sighting]] = field(default_factory=dict)
    modes: dict[int, list[str]] = field(default_factory=dict)  # of the picture, for each of these

    def take(self, spot: Spot, at: float) -> Frame:
        """One more frame has come."""
        frame = Frame(len(self.taken), spot.place, spot.reading, at, spot)
        self.taken.append(frame)
        return frame

    def add(self, analysed: Analysed) -> bool:
        """Takes in what was found in one frame; tells whether a target is now seen well enough, and was not before."""
        before = sum(map(self.found, self.targets))
        self.analysed += 1
        frame = self.taken[analysed.number]
        if analysed.error:
            frame.spot.got -= 1
            self.unreadable[frame.place] = analysed.error
        cut_off = analysed.cut_off or (False,) * len(analysed.detections)
        for detection, one in zip(analysed.detections, cut_off, strict=True):
            if detection.marker in self.targets:
                sighting = Sighting(detection, frame.place, frame.reading, frame.at, analysed.size, cut_off=one)
                self.seen.setdefault(detection.marker, []).append(sighting)
                self.modes.setdefault(detection.marker, []).append(frame.spot.mode)
        return sum(map(self.found, self.targets)) > before

    @property
    def all_found(self) -> bool:
        """Whether every target was seen well enough."""
        return all(self.found(target) for target in self.targets)

    def found(self, target: int) -> bool:
        """Whether a target was seen well enough."""
        return len(self.seen.get(target, ())) >= min(WELL, self.frames)

    def worth(self, place: Place) -> bool:
        """Whether a place is still to be visited: a target is missing, or it looks nearer to one than any so far."""
        return any(not self.found(target) or self._nearer(place, self.seen[target]) for target in self.targets)

    def mode_of(self, marker: int) -> str:
        """The picture mode in which most frames show a marker."""
        modes = self.modes[marker]
        return max(dict.fromkeys(modes), key=modes.count)

    def _nearer(self, place: Place, seen: list[Sighting]) -> bool:
        best = min(seen, key=lambda sighting: sighting.off_centre)
        there = best.bearing(self.kind)
        return between(there, (place.pan, place.tilt)) + NEARER_DEG < between(
            there, (best.reading.pan, best.reading.tilt)
        )
