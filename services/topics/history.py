"""Topics of the history: a question and its answer."""

from __future__ import annotations

from services.payloads import history as p
from services.topic import Kind, Topic
from services.topics.roles import SHOWN, STEERS

HISTORY_GET = Topic(
    "history/get",
    Kind.COMMAND,
    p.HistoryGet,
    (*STEERS, "openhab"),
    ("history",),
    "a question about what was stored; answered on `history/reply/<id>`, and to the MQTT 5 response topic",
)
HISTORY_REPLY = Topic(
    "history/reply/<id>", Kind.EVENT, p.HistoryReply, ("history",), (*SHOWN, *STEERS, "openhab"), "the answer"
)
