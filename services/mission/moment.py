"""One turn of a mission under work: as it becomes, and what is to be done meanwhile. The turns are in `plan.py`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from services.mission.events import Action
from services.mission.state import NEVER, Around, Mission, Told
from services.payloads.robot import MissionStep


@dataclass
class Moment:
    """One call of `advance`."""

    mission: Mission
    now: float
    around: Around
    actions: list[Action] = field(default_factory=list)

    def change(self, **fields: object) -> None:
        """Other values of the mission's fields."""
        self.mission = replace(self.mission, **fields)  # type: ignore[arg-type]

    def enter(self, step: MissionStep, text: str, lasts: float = NEVER) -> None:
        """A new step, told in the story."""
        told = Told(round(self.now - self.mission.began, 3), step, text)
        story = (*self.mission.story, told)
        self.change(step=step, since=self.now, deadline=self.now + lasts, reason=text, story=story)

    def do(self, action: Action) -> None:
        """To be done for it."""
        self.actions.append(action)
