"""Pictures of what a scan has seen, the marker drawn into them: a folder for each camera, the oldest go first.

Not here: the same on the bus, while ScanImgPub is on (`scanner.py`).
"""

from __future__ import annotations

import logging
from datetime import UTC, datetime
from pathlib import Path

log = logging.getLogger(__name__)


class Album:
    """At most `limit` pictures; none where there is no folder."""

    def __init__(self, folder: Path | None, limit: int) -> None:
        self.folder = folder if limit > 0 else None
        self.limit = limit
        self._kept: set[tuple[str, int, int]] = set()

    def begin(self) -> None:
        """A new scan: of each marker at each visit one picture is kept."""
        self._kept.clear()

    def keep(self, place: str, visit: int, markers: list[int], at: float, jpeg: bytes) -> None:
        """A frame with these markers in it; the name of its file tells when, where and which."""
        fresh = {(place, visit, marker) for marker in markers} - self._kept
        if self.folder is None or not fresh:
            return
        self._kept |= fresh
        when = datetime.fromtimestamp(at, UTC).strftime("%Y%m%dT%H%M%S.%fZ")
        where = "".join(one if one.isalnum() else "-" for one in place)
        name = f"{when}_{where}_{'+'.join(str(marker) for _, _, marker in sorted(fresh))}.jpg"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            (self.folder / name).write_bytes(jpeg)
            for old in sorted(self.folder.glob("*.jpg"))[: -self.limit]:
                old.unlink(missing_ok=True)
        except OSError as error:
            log.warning("a picture of what was seen is not kept: %s", error)
