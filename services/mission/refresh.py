"""Sightings that are too old when somebody asks for them: the house looks again, and tells once more what it knows.

Whoever asks is answered at once with what is known. Not here: what is known (`memory.py`), and a mission's own scans
(`plan.py`), beside which none of these is begun.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from services import topics
from services.bus import Message
from services.payloads import Order, OrderResult
from services.payloads.robot import Where

FINAL_STATES = ("done", "failed", "refused", "cancelled")
Asked = tuple[str, Where]  # by way of which robot, and what


@dataclass
class _Look:
    """The scans for one marker, who waits for them, and until when."""

    scans: set[str]
    asked: list[Asked]
    until: float


class Refresh:
    """`fresh_s`: how old a sighting may be, and how soon after one look in vain the next is worth it; `longest_s`: of a
    look. Times are seconds since 1970."""

    def __init__(self, fresh_s: float, longest_s: float) -> None:
        self._fresh_s, self._longest_s = fresh_s, longest_s
        self._looks: dict[int, _Look] = {}
        self._began: dict[int, float] = {}
        self._count = 0

    @property
    def due(self) -> float | None:
        """When the next look has taken too long."""
        return min((look.until for look in self._looks.values()), default=None)

    def wanted(self, marker: int, newest: float | None, now: float) -> bool:
        """Whether a look is worth it for a marker that was seen at `newest`, or one is under way."""
        if marker in self._looks:
            return True
        last = max((at for at in (newest, self._began.get(marker)) if at is not None), default=None)
        return last is None or now - last > self._fresh_s

    def begin(self, robot: str, asked: Where, cameras: Iterable[str], now: float) -> Iterator[Message]:
        """Orders the scans, unless they are under way; whoever asked is told of by `ended` or `late`."""
        look = self._looks.get(asked.marker)
        if look is not None:
            look.asked.append((robot, asked))
            return
        self._count += 1
        scans = {camera: f"where-{asked.marker}-{int(now)}-{self._count}-{camera}"[:64] for camera in cameras}
        self._looks[asked.marker] = _Look(set(scans.values()), [(robot, asked)], now + self._longest_s)
        self._began[asked.marker] = now
        for camera, ours in scans.items():
            order = Order(value={"targets": [asked.marker]}, id=ours, by="mission")
            yield topics.CAMERA_ORDER.message(order, cam=camera, key="Scan")

    def ended(self, result: OrderResult) -> list[Asked]:
        """A camera answers: who is to be told again, when that was the last scan of a look."""
        told: list[Asked] = []
        for marker, look in list(self._looks.items()):
            if result.id in look.scans and result.state in FINAL_STATES:
                look.scans.remove(result.id)
                if not look.scans:
                    told += self._looks.pop(marker).asked
        return told

    def late(self, now: float) -> list[Asked]:
        """Who is to be told again because the looking has taken too long."""
        over = [marker for marker, look in self._looks.items() if now >= look.until]
        return [asked for marker in over for asked in self._looks.pop(marker).asked]
