"""What a mission is at a moment: leads, stands, rules, and all that a service which begins anew needs to go on.

Not here: what becomes of it by what happens (`plan.py`, with the theory of operation; `events.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from services.payloads.robot import MissionStep

XYZ = tuple[float, float, float]
NEVER = 1e300  # a deadline that JSON can carry
HERE, ROUND = "here", "round"  # leads that nobody gave: from the spot, and along the map's points
ENDS: tuple[MissionStep, ...] = ("found", "not_found", "failed", "cancelled")


@dataclass(frozen=True)
class Stand:
    """Where the robot may stand to look: a pose in the map frame (metres, degrees), or a point that its map names."""

    x: float = 0.0
    y: float = 0.0
    yaw_deg: float = 0.0
    point: str | None = None
    away: bool = True  # False: it stands there already

    def __str__(self) -> str:
        return self.point or f"({self.x:.2f}, {self.y:.2f})"


@dataclass(frozen=True)
class Lead:
    """A belief of where the marker may be: `by` whom, since when (seconds since 1970), and where to look from."""

    by: str
    stands: tuple[Stand, ...]
    place: str | None = None
    position: XYZ | None = None  # apartment frame, metres
    stamp: float = 0.0

    @property
    def by_house(self) -> bool:
        """Whether a camera of the house gave it."""
        return self.by not in (HERE, ROUND)


@dataclass(frozen=True)
class Rules:
    """How long and how often; seconds and metres."""

    sure: int = 2  # views of the marker in one look
    blank: int = 4  # pictures without it that end a look early
    look_s: float = 4.0
    drive_s: float = 120.0
    scan_s: float = 240.0
    tries: int = 2  # of one stand
    scans: int = 2
    glimpses: int = 2  # stops on the way because it saw something
    moved_m: float = 0.5  # a sighting farther than this from the lead says that the marker was carried away


@dataclass(frozen=True)
class Around:
    """What there is besides the mission: cameras that can be used, and the leads that need nobody."""

    rules: Rules = Rules()
    cameras: tuple[str, ...] = ()
    here: Lead | None = None
    known: Callable[[], tuple[Lead, ...]] = tuple  # recent sightings by the house, newest first
    round: Callable[[], tuple[Lead, ...]] = tuple


@dataclass(frozen=True)
class Told:
    """One line of the mission's story: when (seconds since it began), in which step, what."""

    at_s: float
    step: MissionStep
    text: str


@dataclass(frozen=True)
class Mission:
    """Everything that a mission is; what a service that begins anew needs to go on. Times in seconds since 1970."""

    id: str
    marker: int
    began: float
    step: MissionStep = "idle"
    since: float = 0.0
    deadline: float = NEVER
    leads: tuple[Lead, ...] = ()  # still to follow; the first one now
    stand: int = 0  # of the first lead
    tries: int = 0  # drives to that stand
    glimpses: int = 0  # times that it stopped on the way because it saw something
    passing: bool = False  # it looks where it happens to be, on its way
    goal: int = 0  # number of the robot's newest goal
    known_used: bool = False
    round_used: bool = False
    scan: int = 0  # number of the newest scan
    scanning: tuple[str, ...] = ()  # cameras whose scan has not ended
    missed: bool = False  # a camera's sighting led to a place where it was not
    looked: bool = False  # from a stand of the lead that it follows
    unreached: str = ""  # a camera's sighting that the robot did not get to
    looks: int = 0  # in which the robot's camera said anything
    heard: bool = False  # whether it did in this look
    blanks: int = 0  # pictures without the marker in this look
    views: int = 0  # of the marker in this look
    position: XYZ | None = None  # apartment frame, as the robot or the house sees it
    obstacle: str = ""  # why the robot did not get somewhere
    reason: str = ""
    story: tuple[Told, ...] = ()

    @property
    def over(self) -> bool:
        """Whether it has ended."""
        return self.step in ENDS

    @property
    def lead(self) -> Lead | None:
        """What it follows now."""
        return self.leads[0] if self.leads else None

    @property
    def place(self) -> str | None:
        """Where it goes or looks, for people."""
        if self.lead is None or self.step == "scan":
            return None
        return self.lead.place or (str(self.lead.stands[self.stand]) if self.lead.stands else None)
