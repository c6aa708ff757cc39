"""Health on both sides: every `diagnostics/#` as a DiagnosticStatus, and the bridge's own `diagnostics/bridge`."""

from __future__ import annotations

from dataclasses import dataclass

from services.bridge.node import Link
from services.bridge.rules import Fields
from services.payloads import Diagnostic

OK, WARN, ERROR, STALE = range(4)  # diagnostic_msgs/DiagnosticStatus
STALE_AFTER_S = 5.0  # diagnostic_aggregator's own default
WARN_FOR_S = 10.0  # how long a refused message shows


@dataclass(frozen=True)
class News:
    """The newest diagnostic of a component, and when it came."""

    diagnostic: Diagnostic
    received: float


class Health:
    """What was heard of every component, and how the bridge itself is."""

    def __init__(self) -> None:
        self._news: dict[str, News] = {}
        self._refused = (float("-inf"), "")
        self.link = Link(up=False, text="not yet")

    def note(self, component: str, diagnostic: Diagnostic, now: float) -> None:
        """Keeps the newest of a component."""
        self._news[component] = News(diagnostic, now)

    def refused(self, text: str, now: float) -> None:
        """A message from ROS was refused: a warning for a while."""
        self._refused = (now, text)

    def own(self, now: float, counters: dict[str, int]) -> Diagnostic:
        """`diagnostics/bridge`: the master's absence is the worse news."""
        level, text = OK, f"ROS: {self.link.text}"
        if now - self._refused[0] < WARN_FOR_S:
            level, text = WARN, f"refused: {self._refused[1]}"
        elif self.link.advice:
            level, text = WARN, self.link.advice
        if not self.link.up:
            level, text = ERROR, f"no ROS master: {self.link.text}"
        values = {"ros_up": str(self.link.up), "registrations": str(self.link.registrations)}
        values |= {name: str(count) for name, count in counters.items()}
        return Diagnostic(level=level, message=text[:400], values=values, hardware_id="bridge")

    def statuses(self, now: float) -> list[Fields]:
        """A DiagnosticStatus of each component; what has been silent for a while is stale."""
        return [_status(component, news, now) for component, news in sorted(self._news.items())]


def _status(component: str, news: News, now: float) -> Fields:
    device, _, aspect = component.partition("/")
    silent_s = now - news.received
    level, text = news.diagnostic.level, news.diagnostic.message
    if silent_s > STALE_AFTER_S:
        level, text = STALE, f"silent for {silent_s:.0f} s; before that: {text}"
    return {
        "level": level,
        "name": f"{device}: {aspect or 'health'}",
        "message": text,
        "hardware_id": news.diagnostic.hardware_id or device,
        "values": [{"key": key, "value": value} for key, value in news.diagnostic.values.items()],
    }
