"""Messages that crashed a service: after the second crash they are put aside, in a file, and the service goes on.

A kept session or a retained topic would bring such a message again at every start, for ever.
"""

from __future__ import annotations

import base64
import hashlib
import json
import traceback
from pathlib import Path
from typing import Any

from services.bus import Message
from services.payloads import stamp
from services.whole_file import write_whole

CRASHES = 2  # the first may have had another cause
MOST = 100  # files of a service; the oldest go
SHOWN = 20  # names in the service's info


class Aside:
    """The folder of one service, one file for each message that crashed it. `folder` None: kept in memory only."""

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = folder
        self._crashes: dict[str, int] = {}
        for file in sorted(folder.glob("*.json")) if folder and folder.is_dir() else ():
            self._crashes[file.stem] = int(json.loads(file.read_text(encoding="utf-8"))["crashes"])

    @property
    def any(self) -> bool:
        """Whether anything ever crashed the service."""
        return bool(self._crashes)

    def holds(self, message: Message) -> bool:
        """Whether this very message is put aside."""
        return self._crashes.get(_key(message), 0) >= CRASHES

    def names(self) -> list[str]:
        """The files of those put aside."""
        return [f"{key}.json" for key, crashes in self._crashes.items() if crashes >= CRASHES][-SHOWN:]

    def crashed(self, message: Message, now: float) -> None:
        """Notes that the exception being handled came from this message."""
        key = _key(message)
        self._crashes[key] = self._crashes.get(key, 0) + 1
        if self.folder is not None:
            record = json.dumps(_record(message, now, self._crashes[key]), indent=1)
            write_whole(self.folder / f"{key}.json", record)
            self._keep_the_newest()

    def _keep_the_newest(self) -> None:
        assert self.folder is not None
        files = sorted(self.folder.glob("*.json"), key=lambda file: file.stat().st_mtime)
        for file in files[:-MOST]:
            file.unlink()


def _key(message: Message) -> str:
    return hashlib.sha256(message.topic.encode() + b"\0" + message.payload).hexdigest()[:16]


def _record(message: Message, now: float, crashes: int) -> dict[str, Any]:
    return {
        "topic": message.topic,
        "payload_base64": base64.b64encode(message.payload).decode(),
        "retain": message.retain,
        "crashes": crashes,
        "last": stamp(now),
        "traceback": traceback.format_exc(),
    }
