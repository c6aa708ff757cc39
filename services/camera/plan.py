"""Plans: work with the camera as generators, and the stage that advances them.

A plan yields a Request and is sent its Reply, or yields Until and is sent the time. It never waits, so the service
stays free; a plan that is dropped gets no word after that, and whoever drops one that moves the camera stops it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any, TypeVar, cast

from services.camera.device import Reply, Request
from services.errors import DeviceError

T = TypeVar("T")


@dataclass(frozen=True)
class Until:
    """Come back at this time, seconds since 1970."""

    at: float


Step = Request | Until
Plan = Generator[Step, Any, T]


def attempt(request: Request) -> Plan[Reply]:
    """Sends and returns the reply, good or bad."""
    return cast(Reply, (yield request))


def ask(request: Request) -> Plan[Reply]:
    """Sends and returns the reply; raises its error."""
    reply = yield from attempt(request)
    if reply.error is not None:
        raise reply.error
    return reply


def wait(at: float) -> Plan[float]:
    """Waits and returns the time."""
    return cast(float, (yield Until(at)))


class Run:
    """A plan that is under way; when it is `done`, `result` or `error` tells how it went."""

    def __init__(self, plan: Plan[Any], ended: Callable[[Run, float], None]) -> None:
        self.plan = plan
        self.ended = ended
        self.ticket: int | None = None
        self.until: float | None = None
        self.done = False
        self.result: Any = None
        self.error: DeviceError | None = None


class Stage:
    """Advances plans: hands their requests to the device, and the replies and the time to them."""

    def __init__(self, submit: Callable[[Request, int], None]) -> None:
        self.submit = submit
        self.asked: set[int] = set()  # tickets of requests that have no answer yet, dropped plans' too
        self._tickets = itertools.count(1)
        self._runs: list[Run] = []

    def begin(self, plan: Plan[Any], now: float, ended: Callable[[Run, float], None]) -> Run:
        """Starts a plan; `ended(run, now)` is called once when it ends by itself."""
        run = Run(plan, ended)
        self._runs.append(run)
        self._advance(run, None, now)
        return run

    def drop(self, run: Run) -> None:
        """Ends a plan from outside; `ended` is not called."""
        run.done = True
        if run in self._runs:
            self._runs.remove(run)
        run.plan.close()

    def reply(self, reply: Reply, now: float) -> None:
        """Hands a reply to the plan that asked; nobody's when that was dropped."""
        self.asked.discard(reply.ticket)
        for run in self._runs:
            if run.ticket == reply.ticket:
                self._advance(run, reply, now)
                return

    def tick(self, now: float) -> None:
        """Wakes the plans whose time has come."""
        for run in list(self._runs):
            if run.until is not None and run.until <= now and not run.done:
                self._advance(run, now, now)

    @property
    def due(self) -> float | None:
        """When the next plan wants to be woken."""
        return min((run.until for run in self._runs if run.until is not None), default=None)

    def _advance(self, run: Run, answer: Reply | float | None, now: float) -> None:
        run.ticket = run.until = None
        try:
            step = run.plan.send(answer)
        except StopIteration as stop:
            run.result = stop.value
            self._end(run, now)
        except DeviceError as error:
            run.error = error
            self._end(run, now)
        else:
            self._take(run, step)

    def _take(self, run: Run, step: Step) -> None:
        if isinstance(step, Until):
            run.until = step.at
        else:
            run.ticket = next(self._tickets)
            self.asked.add(run.ticket)
            self.submit(step, run.ticket)

    def _end(self, run: Run, now: float) -> None:
        run.done = True
        self._runs.remove(run)
        run.ended(run, now)
