"""Where the camera can look: the ranges, the dead arc as the ends of one interval, and goals within them.

Pan is unwrapped once: readings up to the middle of the dead arc stay, those above lose 360. The legal pans are then
one interval, the travel between two is their difference, and no motion inside it can cross the arc.
"""

from __future__ import annotations

from dataclasses import dataclass

from services.camera.device import Reading, Refused

Pose = tuple[float, float, float]  # unwrapped pan and tilt in degrees, zoom in levels
EDGE_DEG = 0.2  # goals keep this far from a stop, so that nothing pushes against it


@dataclass(frozen=True)
class Goal:
    """A pose to reach; `clamped`: it was inside the dead arc and is now at its nearer edge.

    `near`: pan and tilt may end so many degrees from it, where that is more than what a reading can tell.
    """

    pose: Pose
    clamped: bool = False
    near: float = 0.0

    def __str__(self) -> str:
        pan, tilt, zoom = self.pose
        return f"pan {pan % 360:.1f} tilt {tilt:.1f} zoom {zoom:g}"


@dataclass(frozen=True)
class Limits:
    """The camera's ranges, as it reads them: the dead arc of pan, the ends of tilt and of zoom."""

    dead_arc: tuple[float, float] = (179.0, 186.0)
    tilt: tuple[float, float] = (-10.0, 108.0)
    zoom: tuple[float, float] = (0.0, 8.0)

    def unwrap(self, pan: float) -> float:
        """The pan on the interval without a gap."""
        turned = pan % 360
        return turned if turned <= sum(self.dead_arc) / 2 else turned - 360

    def pose(self, reading: Reading) -> Pose:
        """A reading as a pose."""
        return self.unwrap(reading.pan), reading.tilt, reading.zoom

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """From where to where each axis can go, pan unwrapped."""
        return (self.dead_arc[1] - 360, self.dead_arc[0]), self.tilt, self.zoom

    def within(self, reading: Reading) -> Pose:
        """A reading as one that lies within the ranges."""
        told = reading.pan % 360, reading.tilt, reading.zoom
        pan, tilt, zoom = (
            min(high, max(low, value)) for value, (_, (low, high)) in zip(told, self._may_be, strict=True)
        )
        return pan, tilt, zoom

    @property
    def words(self) -> str:
        """What a goal may be."""
        return ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in self._may_be)

    @property
    def _may_be(self) -> tuple[tuple[str, tuple[float, float]], ...]:
        return ("pan", (0.0, 360.0)), ("tilt", self.tilt), ("zoom", self.zoom)

    def goal(self, pan: float, tilt: float, zoom: float) -> Goal:
        """A goal given as readings; Refused, naming the range, when no camera position answers to it."""
        for value, (name, (low, high)) in zip((pan, tilt, zoom), self._may_be, strict=True):
            if not low <= value <= high:  # also false for what is not a number
                raise Refused(f"{name} {value:g} is out of range {low:g} to {high:g}")
        wanted = self.unwrap(pan)
        low, high = self.ranges[0]
        clamped = not low <= wanted <= high
        reachable = min(high - EDGE_DEG, max(low + EDGE_DEG, wanted))
        return Goal((reachable, tilt, zoom), clamped)
