"""Whether the home answers: a robot's command that no state followed in time is told on the diagnostics."""

from __future__ import annotations

from services import topics
from services.bridge.part import Part, status
from services.bridge.rules import Fields, Heard
from services.bus import Message

ANSWER_S = 5.0  # from a command to a state of its item; a shutter says that it moves at once
SHOWN_S = 60.0  # how long a missing answer shows
OK, WARN = 0, 1


class Confirm(Part):
    """Knows commands that came through the bridge; what others command is not its business."""

    rows = (topics.HOME_STATE,)

    def __init__(self) -> None:
        self._states: dict[str, str] = {}
        self._waiting: dict[str, tuple[float, str]] = {}  # item: when it was commanded what
        self._missing: dict[str, tuple[float, str]] = {}
        self.confirmed = 0

    def said(self, message: Message, now: float) -> None:
        """See `Part`."""
        parts = message.topic.split("/")
        if len(parts) == 3 and parts[0] == "home" and parts[2] == "command":
            command = message.payload.decode()
            if self._states.get(parts[1]) != command:  # it is so already, and need not be said again
                self._waiting[parts[1]] = (now, command)

    def hear(self, heard: Heard, now: float) -> None:
        """See `Part`."""
        item = heard.levels["item"]
        self._states[item] = str(heard.payload)
        if self._waiting and self._waiting.pop(item, None) is not None:
            self.confirmed += 1
            self._missing.pop(item, None)

    def statuses(self, now: float) -> list[Fields]:
        """See `Part`."""
        for item, (at, _) in list(self._waiting.items()):
            if now - at >= ANSWER_S:
                self._missing[item] = self._waiting.pop(item)
        self._missing = {item: one for item, one in self._missing.items() if now - one[0] < SHOWN_S}
        unanswered = [f"{item} {command}" for item, (_, command) in self._missing.items()]
        text = f"no state followed: {', '.join(unanswered)}" if unanswered else "every command was answered"
        values = {"waiting": str(len(self._waiting)), "confirmed": str(self.confirmed)}
        values |= {item: f"{command}, {now - at:.0f} s ago" for item, (at, command) in self._missing.items()}
        return [status(WARN if unanswered else OK, "iot: commands", text[:400], "iot", **values)]
