"""The goal under way, kept in a file: a bridge that begins anew tells of the goal that ended with the one before."""

from __future__ import annotations

import logging
from pathlib import Path

from services.whole_file import write_whole

log = logging.getLogger(__name__)


class Kept:
    """`file` None: nothing is kept."""

    def __init__(self, file: Path | None) -> None:
        self._file = file
        self._known: str | None = None

    def read(self) -> str | None:
        """The goal that was under way when the bridge ended."""
        try:
            self._known = self._file.read_text(encoding="utf-8") if self._file else None
        except FileNotFoundError:
            return None
        except (OSError, UnicodeDecodeError) as error:
            log.warning("%s: %s", self._file, error)
            return None
        return self._known or None

    def write(self, goal: str | None) -> None:
        """The goal under way from now on; None: there is none."""
        if self._file is None or goal == self._known:
            return
        self._known = goal
        try:
            write_whole(self._file, goal or "")
        except OSError as error:  # then a restart is told of by the robot's own status alone
            log.warning("%s: %s", self._file, error)
