"""The orders about sound as plans: what is recorded under which name, what may be played.

Not here: the recording and playing (`desk.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import cast

from services import topics
from services.bus import Message
from services.camera.commands import PlaySound, RecordSound
from services.camera.device import Refused
from services.camera.errands import EndRecording, Play, Record, Recorded
from services.camera.plan import Plan, ask
from services.payloads import Audio


class Takes:
    """One camera's audio folder."""

    def __init__(self, camera: str, folder: Path, publish: Callable[[Message], None]) -> None:
        self.camera, self.folder, self.publish = camera, folder, publish

    def record(self, order: RecordSound, now: float) -> Plan[None]:
        """Records, and tells the file; 0 s ends the recording that runs."""
        if order.seconds == 0:
            yield from ask(EndRecording())
            return
        name = f"{self.camera}_{datetime.fromtimestamp(now, UTC):%Y%m%dT%H%M%S%fZ}.wav"
        reply = yield from ask(Record(order.seconds, self.folder / name))
        made = cast(Recorded, reply.result)
        told = Audio(file=name, seconds=made.seconds, bytes=made.bytes)
        self.publish(topics.CAMERA_AUDIO.message(told, cam=self.camera))

    def play(self, order: PlaySound, now: float) -> Plan[None]:
        """Plays a file; Refused when it is not in the folder, or a link that leads out of it."""
        file = self.folder / order.file
        if not file.is_file() or file.resolve().parent != self.folder.resolve():
            raise Refused(f"no file {order.file[:80]!r} in the audio folder")
        yield from ask(Play(file))
