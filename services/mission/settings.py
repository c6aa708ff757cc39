"""The mission's section of the configuration: its robots, and how long and how often things are tried."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from services.mission.state import Rules
from services.section import Section
from services.topic import RobotName


class RobotSettings(Section):
    """One robot: the file of its points and its map."""

    places: Path


class Config(Section):
    """`folder`, `state` and `cameras` are given by the program."""

    folder: Path = Path()
    state: Path | None = None  # where missions under way are kept; None: nowhere
    cameras: tuple[str, ...] = ()
    robots: dict[RobotName, RobotSettings]
    sure: int = Field(default=2, ge=1, le=20)  # views of the marker by the robot that confirm it
    blank: int = Field(default=4, ge=1, le=50)  # pictures without it that end a look before its time
    look_s: float = Field(default=4.0, gt=0, le=60)  # at each stand
    drive_s: float = Field(default=120.0, gt=0, le=3600)  # to a stand
    scan_s: float = Field(default=240.0, gt=0, le=3600)
    fresh_s: float = Field(default=600.0, ge=0)  # an older sighting is not believed without a new scan
    answer_s: float = Field(default=5.0, gt=0, le=60)  # until a robot says that it has taken a goal
    resume_s: float = Field(default=900.0, ge=0)  # a mission left alone for longer is not taken up again

    @property
    def rules(self) -> Rules:
        """What the state machine needs of it."""
        return Rules(sure=self.sure, blank=self.blank, look_s=self.look_s, drive_s=self.drive_s, scan_s=self.scan_s)
