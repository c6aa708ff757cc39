"""What can happen to a mission, and what it then wants done. Which of it when is in `plan.py`."""

from __future__ import annotations

from dataclasses import dataclass

from services.mission.state import XYZ, Lead, Stand


@dataclass(frozen=True)
class Begin:
    """The mission's turn has come."""


@dataclass(frozen=True)
class Seen:
    """The robot's camera looked; whether the marker was in the picture, and where in the apartment if it knows."""

    marker: bool
    position: XYZ | None = None


@dataclass(frozen=True)
class Sighted:
    """A camera of the house saw the marker."""

    lead: Lead


@dataclass(frozen=True)
class Arrived:
    """The robot stands where goal number `goal` wanted it."""

    goal: int


@dataclass(frozen=True)
class NotReached:
    """The robot could not get there."""

    goal: int
    reason: str


@dataclass(frozen=True)
class ScanEnded:
    """A camera's scan number `scan` is over, with the reason where it was not completed."""

    camera: str
    scan: int
    reason: str = ""


@dataclass(frozen=True)
class Late:
    """The step's time is up."""


@dataclass(frozen=True)
class Cancel:
    """Somebody wants it to end."""

    reason: str = "cancelled by order"


@dataclass(frozen=True)
class Resumed:
    """The service began anew in the middle of it."""


Event = Begin | Seen | Sighted | Arrived | NotReached | ScanEnded | Late | Cancel | Resumed


# What is to be done.


@dataclass(frozen=True)
class Go:
    """Send the robot."""

    goal: int
    stand: Stand


@dataclass(frozen=True)
class Halt:
    """Stop the robot where it is."""

    goal: int


@dataclass(frozen=True)
class Scan:
    """Let a camera look for the marker."""

    camera: str
    scan: int


@dataclass(frozen=True)
class StopScan:
    """That scan is not needed any more."""

    camera: str
    scan: int


Action = Go | Halt | Scan | StopScan
