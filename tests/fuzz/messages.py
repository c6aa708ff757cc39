"""Messages that nobody should send, drawn from a seed over the whole table of topics."""

from __future__ import annotations

import random
import re

from services import topics
from services.apartment.home import Home
from services.bus import Message
from services.topic import CHOICES, Topic
from tests.fuzz.payloads import drawn

KEYS = (
    "Goto",
    "SaveAs",
    "Remove",
    "Move",
    "Zoom",
    "RTSP",
    "MJPEG",
    "AudioRec",
    "AudioPlay",
    "Mirror",
    "Flip",
    "Privacy",
    "VideoMode",
    "Scan",
    "ScanImgPub",
    "SetTarget",
    "AddTarget",
    "RemoveTarget",
    "SetRoutine",
    "Calibrate",
    "goto",
    "Nonsense",
)
LARGEST = 1_000_000  # bytes; a monster costs its sender the connection, which tests/attacks shows
STRANGE = ("", " ", "é", "x" * 300, "..", "$SYS", "-", "A", "0", "\U0001f600", "a b", "%2f", "\ud7ff")


class Source:
    """Draws one message after the other; `retained` are the topics under which it has left something."""

    def __init__(self, seed: int, home: Home, services: list[str]) -> None:
        self._rng = random.Random(seed)
        self._items, self._services = list(home.items), services
        self.retained: set[str] = set()

    def draw(self) -> tuple[Message, str]:
        """A message, and the role in which it is sent; the empty one may write everything."""
        rng = self._rng
        topic = ""
        while not topic or topic.endswith("/reload/set"):  # which would be carried out
            row = rng.choice(topics.TABLE)
            topic = self._topic(row)
        retain = rng.random() < 0.1
        role = rng.choice(["", "", "", *(role for role in row.writers if "<" not in role), "operator"])
        if retain:
            self.retained.add(topic)
        answers = {}
        if rng.random() < 0.1:
            answers = {
                "reply_to": rng.choice(["reply/a", "home/Kitchen_Light/command", "$SYS/x", "x" * 500]),
                "correlation": rng.randbytes(rng.choice([0, 8, 2000])),
            }
        return Message(topic, drawn(rng, row)[:LARGEST], retain, rng.randrange(3), **answers), role  # type: ignore[arg-type]

    def _topic(self, row: Topic) -> str:
        rng = self._rng
        topic = re.sub(r"<(\w+)>", lambda found: self._level(found[1]), row.pattern)
        chance = rng.random()
        if chance < 0.05:
            topic += rng.choice(["/", "/more", "//", "/" + rng.choice(STRANGE)])
        elif chance < 0.08:
            levels = topic.split("/")
            levels[rng.randrange(len(levels))] = rng.choice(STRANGE)
            topic = "/".join(levels)
        return topic.replace("+", "_").replace("#", "_").replace("\0", "_") or "/"

    def _level(self, name: str) -> str:
        """Mostly one that somebody has."""
        rng = self._rng
        known = {
            "item": self._items,
            "cam": ["ip1"],
            "robot": ["tiago"],
            "service": self._services,
            "key": list(KEYS),
            "marker": ["582", "17", "0", "9999", str(rng.randrange(10_000))],
            "trait": list(CHOICES["trait"]),
            "attribute": ["$state", "$name", "$nodes", f"${'x' * rng.randrange(1, 30)}"],
            "component": ["service/bridge", "camera/ip1", "bridge", f"x/{rng.randrange(3000)}"],
        }
        if rng.random() < 0.1:
            return rng.choice([*STRANGE, f"x{rng.randrange(3000)}", f"Name_{rng.randrange(3000)}"])
        return rng.choice(known.get(name, [f"a{rng.randrange(50)}", "apartment", "sensor", "kitchen-light"]))
