"""The newest message of each topic, as many as there is room for. Not here: who is shown them (`hub.py`)."""

from __future__ import annotations

from collections import UserDict

from services import topics
from services.bus import topic_matches
from services.dashboard.view import Entry

MOST_TOPICS = 20_000
MOST_TEXT = 8_000_000  # characters: an apartment has some hundred thousand, and the service may have 300 MB in all
ANSWERS = tuple(row.filter for row in topics.TABLE if "id" in row.names)  # each has a topic of its own, used once


class Latest(UserDict[str, Entry]):
    """By topic, what was said longest ago first.

    Without room events and commands go before states, and the oldest of them first. What the dashboard says itself
    (its topics begin with `/`) is little, and always stays: without `/dashboard/broker` nothing could be ordered.
    """

    def __init__(self) -> None:
        super().__init__()
        self._passing: dict[str, None] = {}  # topics of what is no state
        self._text = 0

    def __setitem__(self, topic: str, entry: Entry) -> None:
        self.pop(topic, None)  # so that it is the youngest
        if entry.kind != "s":
            if any(topic_matches(one, topic) for one in ANSWERS):
                return
            self._passing[topic] = None
        self.data[topic] = entry
        self._text += _length(entry)
        while len(self) > MOST_TOPICS or self._text > MOST_TEXT:
            del self[next(iter(self._passing), "") or next(one for one in self.data if not one.startswith("/"))]

    def __delitem__(self, topic: str) -> None:
        self._text -= _length(self.data.pop(topic))
        self._passing.pop(topic, None)


def _length(entry: Entry) -> int:
    return 0 if entry.topic.startswith("/") else len(entry.topic) + len(entry.text)
