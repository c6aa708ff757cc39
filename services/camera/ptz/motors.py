"""Who has the motors: one order at a time, and a stop between two of them.

A human's newest order wins, then a mission's, then a scan's; the loser ends `cancelled`. An order that fails or is
cancelled is followed by a stop that is sent until it is confirmed; nothing else moves the camera before that. A stop
that was confirmed and had no effect shows in the readings that follow.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from services.camera import orders
from services.camera.answers import Answers, Job
from services.camera.device import Reading, Refused, Reply
from services.camera.orders import Command, MoveBy
from services.camera.plan import Plan, Run, Stage
from services.camera.ptz.move import Arrival
from services.camera.ptz.skill import Skill
from services.camera.ptz.stand import Hold, halt, stop
from services.camera.scan.wish import ScanFor
from services.payloads import OrderState
from services.topic import lateness

STOP_LIMIT_S = 10.0  # a Stop order that is not confirmed by then has failed; the stopping goes on
TURNS_ON = 2  # readings in a row, after the end of an order, that are unlike the one before: its stop had no effect

log = logging.getLogger(__name__)

MakePlan = Callable[[Command, float], Plan[Any]]
Ended = Callable[[Job, OrderState, str | None, Reading | None, float], None]


class Motors:
    """The one that may start motions. `ended` hears of every order that had the motors, and where a move ended."""

    def __init__(self, stage: Stage, answers: Answers, make_plan: MakePlan, ended: Ended) -> None:
        self.stage = stage
        self.answers = answers
        self.make_plan = make_plan
        self.ended = ended
        self.jobs: list[Job] = []  # the order that runs, and those that prolong it
        self.hold: Hold | None = None
        self.skill: Skill | None = None  # what is known of them
        self._run: Run | None = None
        self._halting: Run | None = None
        self._next: Job | None = None
        self._stops: list[tuple[Job, float]] = []
        self._turns: int | None = None  # such readings since the last order; None: it was seen at rest since then

    @property
    def busy(self) -> bool:
        """Whether a motion or a stop is under way."""
        return self._run is not None or self._halting is not None

    @property
    def scanning(self) -> bool:
        """Whether a scan runs, or is the next."""
        return any(isinstance(job.command, ScanFor) for job in (*self.jobs[:1], self._next) if job is not None)

    def order(self, job: Job, now: float) -> None:
        """Takes an accepted order: it begins, or waits for a stop, or loses."""
        assert job.command is not None
        if self.jobs and self._prolong(job, job.command, now):
            return
        rival = self._next or (self.jobs[0] if self.jobs else None)
        if rival is not None and rival.command is not None:
            holder = orders.holder(rival.by, rival.command)
            if not orders.wins(job.by, holder):
                self.answers.tell(job, "cancelled", f"the {holder}'s order {rival.key} goes first")
                return
        self._cancel(f"the {job.by}'s order {job.key} goes first", now)
        if self._halting is None:
            self._begin(job, now)
        else:
            self._next = job

    def halt(self, job: Job, now: float) -> None:
        """Ends whatever runs; the order is done when the camera stands."""
        self._cancel(f"stopped by the order {job.key}", now)
        self.answers.tell(job, "running")
        self._stops.append((job, now + STOP_LIMIT_S))
        if self._halting is not None:
            self.stage.drop(self._halting)
        self._halt(halt(now), now)

    def give_up(self, why: str, now: float) -> None:
        """Ends whatever runs or waits, with a stop, although nobody ordered it."""
        self._cancel(why, now)

    def see(self, reply: Reply, *, turning: bool) -> None:
        """An answer to a look while nobody has the motors: what turns on after an order is stopped again."""
        if self.busy or self._turns is None or reply.error is not None:
            return
        self._turns = self._turns + 1 if turning else None
        if self._turns == TURNS_ON:
            log.warning("the camera turns on after its stop, which is sent again")
            self._turns = 0
            self._halt(halt(reply.received), reply.received)

    def make_sure(self, now: float) -> None:
        """Stops what somebody else may have started."""
        if not self.busy:
            self._halt(halt(now, every=True), now)

    def tick(self, now: float) -> None:
        """Gives up waiting for a stop that is not confirmed; what was to come after it is too late then."""
        if self._next is not None and (late := lateness(self._next.message.received, now)):
            self._call_off_next(f"{late}: the camera has not confirmed the stop before it", "refused")
        for job, limit in list(self._stops):
            if now > limit:
                self._stops.remove((job, limit))
                self.answers.tell(job, "failed", "the camera has not confirmed the stop; it is sent again and again")

    def _prolong(self, job: Job, command: Command, now: float) -> bool:
        running = self.jobs[0].command
        if self.hold is None or not isinstance(command, MoveBy) or running is None:
            return False
        if not orders.prolongs(command, running) or job.by != self.jobs[0].by:
            return False
        if self.hold.over:  # it is being stopped: the same again begins when that is done
            self._call_off_next(f"the {job.by}'s order {job.key} goes first")
            self._next = job
            return True
        self.hold.prolong(command.seconds, now)
        self.jobs.append(job)
        self.answers.tell(job, "running")
        return True

    def _begin(self, job: Job, now: float) -> None:
        assert job.command is not None
        self.jobs = [job]
        try:
            plan = self._plan(job.command, now)
        except Refused as error:
            self._end("refused", str(error), now)
            return
        self.answers.tell(job, "running")
        self._turns = 0
        run = self.stage.begin(plan, now, self._plan_ended)
        self._run = None if run.done else run

    def _plan(self, command: Command, now: float) -> Plan[Any]:
        if isinstance(command, MoveBy):
            self.hold = Hold(command.direction, command.speed, command.seconds, self.skill)
            return self.hold.plan()
        return self.make_plan(command, now)

    def _plan_ended(self, run: Run, now: float) -> None:
        self._run = None
        if run.error is not None:
            self._end("failed", str(run.error), now)
            self._halt(stop(now), now)
            return
        self._end("done", None, now, run.result if isinstance(run.result, Arrival) else None)
        self._begin_next(now)

    def _end(self, state: OrderState, error: str | None, now: float, arrival: Arrival | None = None) -> None:
        jobs, self.jobs, self.hold = self.jobs, [], None
        rest = arrival.reading if arrival is not None else None
        for job in jobs:
            self.ended(job, state, error, rest, now)  # first: who hears that a scan is done has heard its results
            self.answers.tell(job, state, error, clamped=arrival is not None and arrival.clamped)

    def _cancel(self, why: str, now: float) -> None:
        """Ends what runs or waits, with a stop where there may be motion."""
        self._call_off_next(why)
        if self._run is not None:
            run, self._run = self._run, None
            self._halt(stop(now), now)
            self.stage.drop(run)  # after it: what a plan has learnt is written at its end
            self._end("cancelled", why, now)

    def _call_off_next(self, why: str, state: OrderState = "cancelled") -> None:
        if self._next is not None:
            waiting, self._next = self._next, None
            self.answers.tell(waiting, state, why)

    def _begin_next(self, now: float) -> None:
        if self._next is not None:
            job, self._next = self._next, None
            self._begin(job, now)

    def _halt(self, plan: Plan[Any], now: float) -> None:
        run = self.stage.begin(plan, now, self._halted)
        self._halting = None if run.done else run

    def _halted(self, run: Run, now: float) -> None:
        self._halting = None
        stops, self._stops = self._stops, []
        for job, _ in stops:
            self.answers.tell(job, "done")
        self._begin_next(now)
