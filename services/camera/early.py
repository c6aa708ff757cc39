"""Orders that come before the camera was met: they wait for that, so that nobody is refused for being quick. Pure.

Met: it has told where it looks, who it is and how its picture stands, or it was found to be away. An order that is too
old by then is refused like any other late one. A stop does not wait.
"""

from __future__ import annotations

from services.camera.answers import Answers, Job
from services.camera.orders import Command
from services.topic import lateness


class Early:
    """Holds orders in the order in which they came, while it `waits`."""

    def __init__(self, answers: Answers) -> None:
        self.answers = answers
        self.waits = True
        self._jobs: list[tuple[Job, Command]] = []

    def keep(self, job: Job, command: Command) -> None:
        """It is taken later."""
        self._jobs.append((job, command))

    def call_off(self, why: str) -> None:
        """Those that wait are not to be done any more."""
        for job, _ in self._jobs:
            self.answers.tell(job, "cancelled", why)
        self._jobs.clear()

    def tick(self, now: float) -> None:
        """Refuses those that have become too old."""
        for job, _ in self._jobs:
            if late := lateness(job.message.received, now):
                self.answers.tell(job, "refused", f"{late}: the camera was not met so soon")
        self._jobs = [(job, command) for job, command in self._jobs if not job.ended]

    def met(self, now: float) -> list[tuple[Job, Command]]:
        """Nothing waits any longer: what is to be done now."""
        self.tick(now)
        self.waits = False
        jobs, self._jobs = self._jobs, []
        return jobs
