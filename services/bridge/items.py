"""The items of the home on the diagnostics, by room: what each one's value is, and which have none."""

from __future__ import annotations

from services import topics
from services.apartment.home import Home
from services.bridge.part import Part, status
from services.bridge.rules import Fields, Heard

OK, WARN, STALE = 0, 1, 3
NOTHING = ("UNDEF", "NULL")
ELSEWHERE = "outside"  # the room of what is in none


class Items(Part):
    """One status per item of group ROS, named `home <room>: <item>`."""

    rows = (topics.HOME_STATE,)

    def __init__(self, home: Home) -> None:
        self._rooms = {name: home.room_of(name) or ELSEWHERE for name in home.ros_items}
        self._said: dict[str, tuple[float, str]] = {}

    def hear(self, heard: Heard, now: float) -> None:
        """See `Part`."""
        self._said[heard.levels["item"]] = (now, str(heard.payload))

    def statuses(self, now: float) -> list[Fields]:
        """See `Part`."""
        return [self._status(item, room, now) for item, room in self._rooms.items()]

    def _status(self, item: str, room: str, now: float) -> Fields:
        name = f"home {room}: {item}"
        if item not in self._said:
            return status(STALE, name, "no state was ever said", "home")
        at, value = self._said[item]
        level, text = (WARN, f"it has no value: {value}") if value in NOTHING else (OK, value)
        return status(level, name, text[:400], "home", state=value[:400], age_s=f"{now - at:.0f}")
