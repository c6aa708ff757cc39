"""One robot's missions: orders wait their turn, what happens goes to the plan, what it wants goes out as messages.

Not here: what a mission does next (`plan.py`), and which message is meant for which robot (`service.py`).
"""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf

from services import topics
from services.bus import Message
from services.errors import BadMessage
from services.mission import telling
from services.mission.chart import Chart
from services.mission.events import (
    Arrived,
    Begin,
    Cancel,
    Event,
    Go,
    Halt,
    NotReached,
    Resumed,
    ScanEnded,
    Seen,
    Sighted,
)  # fmt: skip
from services.mission.events import Late as TimeIsUp
from services.mission.kept import Book, Kept
from services.mission.memory import Memory, Sighting
from services.mission.plan import advance
from services.mission.settings import Config
from services.mission.standing import Pose
from services.mission.state import XYZ, Around, Lead, Mission, Stand
from services.payloads import Diagnostic, OrderResult, stamp
from services.payloads.robot import GotoResult, MissionOrder, MissionState, RobotPose, RobotSeen

HEALTH_EVERY_S = 1.0
SILENT_S = 10.0  # a robot that has said nothing for so long is away
ASKED_AGAIN = 3  # times that a goal is sent until the robot takes it
MOST_WAITING = 20
UNHEARD_S = 60.0  # that an order waits for a robot which does not say where it is


@dataclass(frozen=True)
class _Waits:
    """An order whose turn comes later; when there is no mission, until then, and why it is over afterwards."""

    order: MissionOrder
    until: float
    why: str


@dataclass(frozen=True)
class _Sent:
    """The goal under way: what was sent when, how often, and whether the robot has taken it."""

    goal: int
    stand: Stand
    at: float
    times: int = 1
    taken: bool = False


class Desk:
    """One robot's. All times are seconds since 1970."""

    def __init__(self, robot: str, config: Config, chart: Chart, memory: Memory) -> None:
        self.robot, self.config, self.chart, self.memory = robot, config, chart, memory
        self.cameras: dict[str, bool] = dict.fromkeys(config.cameras, False)  # whether each can be used
        self.kept = Kept(config.state, robot)
        book = self.kept.read()
        self.mission: Mission | None = book.mission
        left_s = config.resume_s
        self.waiting = [_Waits(one, book.at + left_s, f"nobody was at it for {left_s:.0f} s") for one in book.waiting]
        self._left_at: float | None = book.at if book.mission else None
        self.pose: Pose | None = None
        self.heard = -inf  # when the robot said anything
        self._sent: _Sent | None = None
        self._said: MissionState | None = None
        self._health_due = 0.0

    @property
    def due(self) -> float:
        """When `tick` is wanted."""
        times = [self._health_due]
        if self.mission is not None:
            times.append(self.mission.deadline)
        if self._sent is not None and not self._sent.taken:
            times.append(self._sent.at + self.config.answer_s)
        return min(times)

    def knows(self, order_id: str | None) -> bool:
        """Whether an order of that id runs or waits."""
        known = [one.id for one in self._orders] + ([self.mission.id] if self.mission else [])
        return order_id in known

    @property
    def _orders(self) -> list[MissionOrder]:
        return [one.order for one in self.waiting]

    # What comes.

    def order(self, order: MissionOrder, now: float) -> Iterator[Message]:
        """A marker to find, or an end to it; BadMessage for an id that it knows, whose answer is that order's."""
        if order.cancel:
            yield from self._cancel(order, now)
            return
        named = order.model_copy(update={"id": order.id or uuid.uuid4().hex[:12]})
        if self.knows(named.id):
            raise BadMessage(f"{topics.MISSION_ORDER.name(robot=self.robot)}: {named.id!r} runs or waits already")
        if len(self.waiting) >= MOST_WAITING:
            yield telling.refused(self.robot, named.id, named.find, f"{MOST_WAITING} orders wait already", now)
            return
        self.waiting.append(self._in_turn(named, now))
        self._keep(now)
        yield from self.tick(now)

    def _cancel(self, order: MissionOrder, now: float) -> Iterator[Message]:
        for one in [one for one in self.waiting if order.id in (None, one.order.id)]:
            self.waiting.remove(one)
            yield telling.withdrawn(self.robot, one.order, "cancelled by order", now)
        if self.mission is not None and order.id in (None, self.mission.id):
            yield from self._happens(Cancel(), now)
        self._keep(now)
        yield from self._say(now)

    def stands_at(self, pose: RobotPose, now: float) -> None:
        """The robot says where it is."""
        self.pose, self.heard = Pose(pose.x, pose.y, pose.yaw_deg), now

    def sees(self, seen: RobotSeen, now: float) -> Iterator[Message]:
        """The robot's own camera looked."""
        self.heard = now
        relation = self.chart.places.apartment_to_map
        spots: dict[int, XYZ | None] = {}
        for one in seen.markers:
            at = one.position
            spots[one.marker] = None if at is None else (*relation.to_apartment(at.x, at.y), at.z)
            self.memory.note(Sighting(self.robot, one.marker, "", now, spots[one.marker]), now)
        if self.mission is not None:
            wanted = self.mission.marker
            yield from self._happens(Seen(wanted in spots, spots.get(wanted)), now)

    def goal_ended(self, result: GotoResult, now: float) -> Iterator[Message]:
        """The robot says what became of a goal."""
        self.heard = now
        if self.mission is None or self._sent is None or result.id != telling.goal_id(self.mission, self._sent.goal):
            return
        goal = self._sent.goal
        self._sent = replace(self._sent, taken=True)
        if result.state == "arrived":
            yield from self._happens(Arrived(goal), now)
        elif result.state != "accepted":
            yield from self._happens(NotReached(goal, result.reason or result.state), now)

    def sighted(self, sighting: Sighting, now: float) -> Iterator[Message]:
        """A camera of the house saw a marker."""
        if self.mission is not None and sighting.marker == self.mission.marker:
            lead = self._lead(sighting)
            if lead is not None:
                yield from self._happens(Sighted(lead), now)

    def scan_ended(self, camera: str, result: OrderResult, now: float) -> Iterator[Message]:
        """A camera answers one of our scans."""
        mission = self.mission
        if mission is not None and result.final and result.id == telling.scan_id(mission, camera, mission.scan):
            reason = "" if result.state == "done" else f"the scan is {result.state}: {result.error or 'no reason'}"
            yield from self._happens(ScanEnded(camera, mission.scan, reason), now)

    def camera_gone(self, camera: str, now: float) -> Iterator[Message]:
        """A camera's service has ended: it answers no scan any more."""
        self.cameras[camera] = False
        if self.mission is not None:
            yield from self._happens(ScanEnded(camera, self.mission.scan, "its service has ended"), now)

    def tick(self, now: float) -> Iterator[Message]:
        """What is due: a step's time is up, a goal is sent again, the next order's turn has come, health."""
        if self.mission is None or self._left_at is not None:
            yield from self._give_up(now)
        if self._left_at is not None and self.mission is not None:
            yield from self._take_up(self.mission, self._left_at, now)
        if self.mission is not None and now >= self.mission.deadline:
            yield from self._happens(TimeIsUp(), now)
        yield from self._remind(now)
        if self.mission is None and self.waiting and self.pose is not None:
            order = self.waiting.pop(0).order
            assert order.find is not None
            assert order.id is not None
            self.mission = Mission(order.id, order.find, now, since=now)
            yield from self._happens(Begin(), now)
        yield from self._say(now)
        if now >= self._health_due:
            self._health_due = now + HEALTH_EVERY_S
            yield topics.DIAGNOSTICS.message(self._health(now), component=f"mission/{self.robot}")

    def _in_turn(self, order: MissionOrder, now: float) -> _Waits:
        return _Waits(order, now + UNHEARD_S, f"{self.robot} has not said where it is for {UNHEARD_S:.0f} s")

    def _give_up(self, now: float) -> Iterator[Message]:
        """Orders that have waited for too long: whoever gave them has not stayed."""
        late = [one for one in self.waiting if now >= one.until]
        for one in late:
            self.waiting.remove(one)
            yield telling.withdrawn(self.robot, one.order, one.why, now)
        if late:
            self._keep(now)

    def _take_up(self, mission: Mission, left_at: float, now: float) -> Iterator[Message]:
        """After a restart, when the robot and the cameras have been heard: go on, unless too much time has passed."""
        if now - left_at > self.config.resume_s:
            self._left_at = None
            yield from self._happens(Cancel(f"nobody was at it for {now - left_at:.0f} s"), now)
        elif self.pose is not None:
            self._left_at = None
            yield from self._happens(Resumed(), now)

    def _remind(self, now: float) -> Iterator[Message]:
        """A goal that the robot has not taken is sent again, under the same id."""
        sent, mission = self._sent, self.mission
        if mission is None or sent is None or sent.taken or now < sent.at + self.config.answer_s:
            return
        if sent.times >= ASKED_AGAIN:
            self._sent = replace(sent, taken=True)
            yield from self._happens(NotReached(sent.goal, "the robot does not answer"), now)
        else:
            self._sent = replace(sent, at=now, times=sent.times + 1)
            yield telling.goto(self.robot, mission, sent.goal, sent.stand)

    # What goes out.

    def _happens(self, event: Event, now: float) -> Iterator[Message]:
        """Hands an event to the plan, and does what it wants."""
        if self.mission is None or (self._left_at is not None and not isinstance(event, Cancel)):
            return
        before = self.mission
        self.mission, actions = advance(before, event, now, self._around(now))
        for action in actions:
            if isinstance(action, Go):
                self._sent = _Sent(action.goal, action.stand, now)
            elif isinstance(action, Halt):
                self._sent = None
            yield telling.wanted(self.robot, self.mission, action)
        if self.mission.over:
            yield telling.ended(self.robot, self.mission, now)
            self.mission = self._sent = self._left_at = None
            self.waiting = [self._in_turn(one.order, now) for one in self.waiting]
        if self.mission is None or self.mission.story != before.story or self.mission.goal != before.goal:
            self._keep(now)
            yield from self._say(now)

    def _around(self, now: float) -> Around:
        """What there is besides the mission."""
        pose, usable = self.pose, tuple(name for name, can in self.cameras.items() if can)
        if pose is None:
            return Around(self.config.rules, usable)
        return Around(
            self.config.rules, usable, self.chart.here(pose), lambda: self._known(now), lambda: self.chart.round(pose)
        )

    def _known(self, now: float) -> tuple[Lead, ...]:
        """Where the house saw the marker lately."""
        seen = self.memory.of(self.mission.marker) if self.mission else []
        recent = [one for one in seen if one.by in self.cameras and now - one.at <= self.config.fresh_s]
        return tuple(lead for one in recent if (lead := self._lead(one)) is not None)

    def _lead(self, one: Sighting) -> Lead | None:
        robot = self.pose or Pose(0.0, 0.0, 0.0)
        return self.chart.lead(one.by, one.place, one.position, one.normal, one.at, robot)

    def _say(self, now: float) -> Iterator[Message]:
        """The state, when it has changed."""
        since = self._said.since if self._said and self._said.state == "idle" else stamp(now)
        state = telling.state(self.mission, self._orders, since)
        if state != self._said:
            self._said = state
            yield topics.MISSION_STATE.message(state, robot=self.robot)

    def _keep(self, now: float) -> None:
        self.kept.write(Book(self.mission, now, tuple(self._orders)))

    def _health(self, now: float) -> Diagnostic:
        silent = now - self.heard > SILENT_S
        usable = [name for name, can in self.cameras.items() if can]
        return Diagnostic(
            level=1 if silent or not usable else 0,
            message=f"{self.robot} is silent" if silent else "ready" if self.mission is None else self.mission.reason,
            values={"cameras": ", ".join(usable), "waiting": str(len(self.waiting))},
            hardware_id=self.robot,
        )
