"""A robot's goals at its action servers (actionlib), one at a time: what is sent, and what each word of them means.

    goto --/goal, until the server's status names it--> accepted --result or status--> arrived | failed | cancelled

Sent goals and cancels carry no time: the robot's clock is another than ours, and a server takes an older stamp for an
older goal, and drops it. A goal that the server has not named yet is sent again under its id, which does no harm.
Messages of ROS get lost with a master or a server that is started anew, so every status counts like a result, and a
server that falls silent or has forgotten the goal ends it. A goal with our prefix that is not the one under way, such
as that of a bridge before us, is cancelled until it has ended, and told of. Pure. Not here: names of topics and types
(`actions.py`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from services.bridge.robots.actions import ENDED, ONGOING, Action
from services.bridge.rules import Fields
from services.payloads import LONGEST_ID
from services.payloads.robot import GotoResult

AGAIN_S = 1.0  # between two sendings of a goal that the server has not named
TAKEN_S = 4.0  # until it must have; who ordered it waits 5 s before he orders it again
SILENT_S = 5.0  # of the server's status, which comes five times a second
FORGOTTEN_S = 2.0  # of statuses without the goal
NAMELESS = "~"  # begins the name of a goal that has no id on the bus
LONGEST_TEXT = 400  # characters of a server's reason
REMEMBERED = 50  # goals whose end is told once more when they are ordered again


@dataclass(frozen=True)
class Send:
    """Something for a ROS topic."""

    topic: str
    fields: Fields


Said = Send | GotoResult


@dataclass(frozen=True)
class Goal:
    """The goal under way: the bus's id and ROS's, where and what it is, when it was sent, and last named."""

    id: str | None
    name: str
    action: Action
    fields: Fields
    began: float
    sent: float
    taken: bool = False
    named: float = 0.0  # when a status last had it
    heard: float = 0.0  # when there was any status of its server


class Goals:
    """Of one robot; `prefix` makes its goals' names its own. Times in seconds, of any clock."""

    def __init__(self, prefix: str) -> None:
        self._prefix = prefix
        self._count = 0
        self._ends: dict[str, GotoResult] = {}
        self._cancelled: dict[str, float] = {}  # goals that go on although they should not: when they were told so
        self.goal: Goal | None = None

    @property
    def under_way(self) -> tuple[str, str] | None:
        """Topic and name with which the goal can be cancelled by anybody."""
        return (self.goal.action.cancel, self.goal.name) if self.goal else None

    def order(self, goal_id: str | None, action: Action, fields: Fields, now: float) -> Iterator[Said]:
        """A new goal; the one under way ends. One that is known already is told of once more, and not sent."""
        if goal_id is not None and goal_id in self._ends:
            yield self._ends[goal_id]
            return
        if self.goal is not None and goal_id is not None and self.goal.id == goal_id:
            if self.goal.taken:
                yield GotoResult(id=goal_id, state="accepted")
            return
        if self.goal is not None:
            if self.goal.action != action:  # the same server ends the old one by itself when the new one comes
                yield _cancel(self.goal)
            yield self._end("cancelled", "another goal came")
        self._count += 1
        name = f"{self._prefix}{goal_id or f'{NAMELESS}{self._count}'}"
        self.goal = Goal(goal_id, name, action, fields, now, now, heard=now)
        yield self._goal_message()

    def refuse(self, goal_id: str | None, reason: str) -> GotoResult:
        """A goal that cannot even be sent."""
        refused = GotoResult(id=goal_id, state="failed", reason=reason)
        self._remember(refused)
        return refused

    def left(self, goal_id: str) -> GotoResult:
        """The goal of a bridge before us, which ended with it."""
        end = GotoResult(id=goal_id, state="cancelled", reason="the bridge was started anew")
        self._remember(end)
        return end

    def cancel(self, goal_id: str | None, reason: str) -> Iterator[Said]:
        """Ends the goal under way, with `goal_id` only that one. It ends for us at once: nobody waits for a server that
        is away, and what it says later of that goal is old."""
        if self.goal is not None and goal_id in (None, self.goal.id):
            yield _cancel(self.goal)
            yield self._end("cancelled", reason)

    def status(self, action: Action, statuses: Iterable[Fields], now: float) -> Iterator[Said]:
        """What a server says of all its goals."""
        if self.goal is not None and self.goal.action == action:
            self.goal = replace(self.goal, heard=now)
        for one in statuses:
            name, status, text = str(one["goal_id"]["id"]), int(one["status"]), str(one["text"])
            if self.goal is not None and (action, name) == (self.goal.action, self.goal.name):
                self.goal = replace(self.goal, named=now)
                yield from self._word(status, text)
            elif name.startswith(self._prefix):
                yield from self._old(action, name, status, text, now)

    def result(self, action: Action, status: Fields, now: float) -> Iterator[Said]:
        """What a server says at the end of a goal."""
        if self.goal is not None and self.goal.action == action and status["goal_id"]["id"] == self.goal.name:
            yield from self._word(int(status["status"]), str(status["text"]))

    def tick(self, now: float, *, listens: bool) -> Iterator[Said]:
        """What is due; `listens`: whether the server of the goal under way hears our goals."""
        goal = self.goal
        if goal is None:
            return
        if not goal.taken:
            if now >= goal.began + TAKEN_S:
                why = "does not take the goal" if listens else "is not there, or of another definition"
                yield from self._given_up(f"{goal.action.name} {why}")
            elif listens and now >= goal.sent + AGAIN_S:
                self.goal = replace(goal, sent=now)
                yield self._goal_message()
        elif now - goal.heard > SILENT_S:
            yield from self._given_up(f"{goal.action.name} has been silent for {now - goal.heard:.0f} s")
        elif goal.heard - goal.named > FORGOTTEN_S:
            yield from self._given_up(f"{goal.action.name} has forgotten the goal")

    def _old(self, action: Action, name: str, status: int, text: str, now: float) -> Iterator[Said]:
        """A goal of ours that is not under way for us."""
        if status in ONGOING and now >= self._cancelled.get(name, 0.0) + AGAIN_S:
            self._cancelled = {**dict(list(self._cancelled.items())[-REMEMBERED:]), name: now}
            yield Send(action.cancel, {"id": name})
        ours = name.removeprefix(self._prefix)
        if ours not in self._ends and not ours.startswith(NAMELESS) and len(ours) <= LONGEST_ID:
            end = _end(ENDED[status], text) if status in ENDED else ("cancelled", "nobody was there to follow it")
            told = GotoResult.model_validate({"id": ours, "state": end[0], "reason": end[1]})
            self._remember(told)
            yield told

    def _given_up(self, reason: str) -> Iterator[Said]:
        assert self.goal is not None
        yield _cancel(self.goal)
        yield self._end("failed", reason)

    def _word(self, status: int, text: str) -> Iterator[Said]:
        goal = self.goal
        assert goal is not None
        if status in ONGOING and not goal.taken:
            self.goal = replace(goal, taken=True)
            yield GotoResult(id=goal.id, state="accepted")
        elif status in ENDED:
            if not goal.taken:
                yield GotoResult(id=goal.id, state="accepted")
            yield self._end(*_end(ENDED[status], text))

    def _end(self, state: str, reason: str) -> GotoResult:
        assert self.goal is not None
        end = GotoResult.model_validate({"id": self.goal.id, "state": state, "reason": reason})
        self.goal = None
        self._remember(end)
        return end

    def _remember(self, end: GotoResult) -> None:
        if end.id is not None:
            self._ends[end.id] = end
            while len(self._ends) > REMEMBERED:
                del self._ends[next(iter(self._ends))]

    def _goal_message(self) -> Send:
        assert self.goal is not None
        return Send(self.goal.action.goal, {"goal_id": {"id": self.goal.name}, "goal": self.goal.fields})


def _cancel(goal: Goal) -> Send:
    return Send(goal.action.cancel, {"id": goal.name})


def _end(word: str, text: str) -> tuple[str, str]:
    """How a goal ended, for the bus, by the server's word."""
    text = text[:LONGEST_TEXT]
    if word == "succeeded":
        return "arrived", text
    if word in ("preempted", "recalled"):
        return "cancelled", text or f"{word} by somebody else"
    return "failed", text or word
