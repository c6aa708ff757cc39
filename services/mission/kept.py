"""Missions under way, kept in a file a robot, so that a service that begins anew goes on where it was."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from services.mission.state import Mission
from services.payloads.robot import MissionOrder
from services.whole_file import write_whole

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Book:
    """One robot's: the mission under way, when that was last said, and the orders that wait."""

    mission: Mission | None = None
    at: float = 0.0
    waiting: tuple[MissionOrder, ...] = field(default=())


FORM = TypeAdapter(Book)


class Kept:
    """One robot's file; without a folder nothing is kept."""

    def __init__(self, folder: Path | None, robot: str) -> None:
        self.file = folder / "missions" / f"{robot}.json" if folder else None

    def read(self) -> Book:
        """What is kept; an empty book when there is none, or none that can be read."""
        if self.file is None or not self.file.exists():
            return Book()
        try:
            return FORM.validate_json(self.file.read_bytes())
        except (OSError, ValidationError) as error:
            log.warning("%s: not read, and begun anew: %s", self.file, error)
            return Book()

    def write(self, book: Book) -> None:
        """Replaces the file in one step; a disk that is full costs the memory over a restart, not the mission."""
        if self.file is None:
            return
        try:
            write_whole(self.file, FORM.dump_json(book))
        except OSError as error:
            log.error("%s: not written: %s", self.file, error)
