"""Whether a camera that was away has restarted meanwhile: none of them says so, it is judged by what was seen. Pure.

A network that was cut leaves the camera as it was: it still takes the login that it took before. One that starts again
knows none; and while it does, it turns connections away.
"""

from __future__ import annotations

from dataclasses import dataclass

from services.camera.device import Away, Identity, Reply

BOOT_S = 20.0  # 40 to 105 s were seen; so long nobody is turned away for another reason


@dataclass
class Absence:
    """What was seen since the camera was met."""

    known: bool = False  # it was met before: only then it can have *re*started
    ordered: bool = False
    began: float | None = None  # when the first request without an answer was sent
    lasted_s: float = 0.0
    turned_away: bool = False

    def take(self, reply: Reply) -> None:
        """A request that was not answered."""
        if isinstance(reply.error, Away):
            self.began = reply.sent if self.began is None else self.began
            self.lasted_s = reply.received - self.began
            self.turned_away |= reply.error.turned_away

    def signs(self, identity: object) -> tuple[str, ...]:
        """It is met again, and that is what it said: the signs of a restart; none when it was just away."""
        remembers = identity.remembers if isinstance(identity, Identity) else None
        slow = self.turned_away and self.lasted_s >= BOOT_S
        if not self.known or self.began is None:
            return ()
        if not (self.ordered or remembers is False or (remembers is None and slow)):
            return ()
        signs = {
            "as ordered": self.ordered,
            f"away for {self.lasted_s:.0f} s": True,
            "it turned connections away": self.turned_away,
            "it knows no login from before": remembers is False,
        }
        return tuple(sign for sign, seen in signs.items() if seen)
