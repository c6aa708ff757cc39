"""Which box is drawn before which, so that what is nearer covers what is farther. Geometry only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.simulators.camera.view.solids import NORMALS, Box
from services.vision.frames import Array

TOUCHING_M = 0.001  # boxes may overlap by this much and still count as apart: things lie on tables
Indexes = NDArray[np.intp]


class Order:
    """The boxes of a scene, and what separates them from each other."""

    def __init__(self, boxes: list[Box]) -> None:
        self.sides = np.array([box.sides() for box in boxes])  # (n, 6, 3, 3): corner, right, down
        self.corners = np.array([box.corners for box in boxes])  # (n, 8, 3)
        self._normals = np.array([NORMALS @ box.pose.rotation.T for box in boxes])  # (n, 6, 3)
        self._offsets = np.einsum("nsk,nsk->ns", self._normals, self.sides[:, :, 0])
        heights = np.einsum("nsk,mck->nsmc", self._normals, self.corners) - self._offsets[:, :, None, None]
        self._beyond = (heights > -TOUCHING_M).all(axis=3)  # (n, side, m): box m lies beyond that side of box n

    def facing(self, eye: Array) -> NDArray[np.bool_]:
        """(n, 6): the sides that can be seen from there."""
        return np.asarray(np.einsum("nsk,k->ns", self._normals, eye) - self._offsets > 0.0)

    def overlapping(self) -> list[tuple[int, int]]:
        """The pairs of boxes that no side of either separates; their order is left to chance."""
        apart = self._beyond.any(axis=1)
        return [(int(a), int(b)) for a, b in np.argwhere(~(apart | apart.T)) if a < b]

    def back_to_front(self, chosen: Indexes, eye: Array) -> list[int]:
        """An order of the chosen boxes in which none is drawn over one that hides it.

        A may come before B without harm when a side of A has B beyond it and the eye too, or a side of B has A
        beyond it and the eye not. A box that must wait for others comes as soon as they are drawn.
        """
        apart, faces = self._beyond[np.ix_(chosen, np.arange(6), chosen)], self.facing(eye)[chosen]
        harmless = (apart & faces[:, :, None]).any(axis=1) | (apart & ~faces[:, :, None]).any(axis=1).T
        waits_for = ~harmless & harmless.T  # [a, b]: a must come after b
        left, order = np.arange(len(chosen)), []
        while len(left):
            waiting = waits_for[np.ix_(left, left)].sum(axis=1)
            ready = waiting == waiting.min()
            order += [int(i) for i in chosen[left[ready]]]
            left = left[~ready]
        return order
