"""Who commands the goal under way, as far as the bus tells, and whether he is gone for good. Pure.

A goal of the mission under way is the mission service's; that one may be started anew, and goes on then. Any other
goal is somebody's who has no life on the bus.
"""

from __future__ import annotations

from services.payloads.robot import MissionState

SERVICE = "mission"
GONE_S = 15.0  # a service that was killed is back within three


class Commander:
    """Of one robot. Times in seconds."""

    def __init__(self) -> None:
        self._mission: str | None = None
        self._since: float | None = None  # when the mission service was heard to have ended

    @property
    def wants(self) -> bool:
        """Whether there is a mission."""
        return self._mission is not None

    def orders(self, state: MissionState) -> None:
        """The robot's mission, as the mission service says."""
        self._mission = state.id

    def lives(self, status: str, now: float) -> None:
        """The mission service is `online`, or not."""
        if status == "online":
            self._since = None
        elif self._since is None:
            self._since = now

    def is_gone(self, goal_id: str | None, now: float) -> bool:
        """Whether nobody will follow a goal of this id any more."""
        ours = self._mission is not None and (goal_id or "").startswith(f"{self._mission[:40]}-")
        return ours and self._since is not None and now >= self._since + GONE_S
