"""What the parts of a hop by a relative form are parts of, and how large that is at each zoom.

No firmware tells: it may be a point of the picture, an angle of view, or a turn, each a law of its own. By every law a
Kalman filter keeps the logarithms of how large the whole is for pan and tilt, and how much less at each level of zoom:
one hop teaches both axes and all levels, each as far as it tells. The law that has foretold hops best is believed.
Pure. What a hop tells: `scale.py`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import atan, degrees, exp, hypot, log, radians, sin, sqrt, tan

import numpy as np

from services.camera.ptz.pace import Vector, taught

LEVELS = 9  # 0 to 8
LEVEL_DOUBT, ALONE_DOUBT, APART = 0.1, 0.02, 3.0  # of a level's magnification: with its neighbours, on its own
AGE, TURN_AGE = 0.005, 0.0005  # more doubt about each with every hop; of what zoom does not change
BENT = 0.2  # of what was off: a tangent is no straight line
AXES = 2
FORGETS = 0.95  # what a law has foretold counts so much with each hop more
UNLIKELY = 2.0  # a law that is not the first one, before anything was seen; a logarithm
STRAYED, FIRST_LOOKS, MOST_LOOKS = 0.6, 8, 20  # a guess that counts as so many looks; more are not remembered
FLYING_LOOKS = 4  # the same of hops in flight, of which there are fewer
MARGIN, LEAST_SHARE = 1.25, 0.12  # experience leaves so much more doubt than it shows, and at least so much
OUT = 3.0  # standard deviations: what is farther off tells no more against a law


@dataclass(frozen=True)
class Law:
    """`guess`: the whole of pan and tilt at the widest zoom, a tangent where `bent`, else degrees; `doubt`: a share.

    `zooms`: it shrinks as the picture grows.
    """

    name: str
    guess: tuple[float, float]
    doubt: float
    bent: bool = False
    zooms: bool = True


POINT = Law("point", (1.0, 0.56), 0.5, bent=True)
VIEW = Law("view", (45.0, 29.0), 0.5)
TURN = Law("turn", (180.0, 180.0), 1.0, zooms=False)


def larger(zoom: float) -> float:
    """How much the picture grows with zoom, about."""
    return 1.0 + zoom / 4.0


def _doubts(doubt: float) -> Vector:
    levels = np.arange(LEVELS)
    apart = (levels[:, None] - levels[None, :]) / APART
    cov = np.zeros((AXES + LEVELS, AXES + LEVELS))
    cov[:AXES, :AXES] = doubt**2 * np.eye(AXES)
    cov[AXES:, AXES:] = LEVEL_DOUBT**2 * np.exp(-np.square(apart) / 2) + ALONE_DOUBT**2 * np.eye(LEVELS)
    return cov


@dataclass
class Planes:
    """By one law: the logarithms of both wholes over the guess, then of each level's; and their covariance."""

    law: Law = POINT
    likely: float = 0.0  # the logarithm of how likely the law is, by its last hops
    mean: Vector = field(default_factory=lambda: np.zeros(AXES + LEVELS))

    def __post_init__(self) -> None:
        self.cov = _doubts(self.law.doubt)

    def at(self, zoom: float) -> tuple[float, float]:
        """The wholes of pan and tilt at a zoom."""
        shrinks = larger(zoom) if self.law.zooms else 1.0
        pan, tilt = (
            guess * exp(float(self.weights(axis, zoom) @ self.mean)) / shrinks
            for axis, guess in enumerate(self.law.guess)
        )
        return pan, tilt

    def angle(self, axis: int, part: float, zoom: float) -> float:
        """How far a part goes, degrees."""
        whole = self.at(zoom)[axis]
        return degrees(atan(part * whole)) if self.law.bent else part * whole

    def part(self, axis: int, way: float, zoom: float) -> float:
        """The part that goes so many degrees."""
        return (tan(radians(way)) if self.law.bent else way) / self.at(zoom)[axis]

    def bends(self, way: float) -> float:
        """By how much a way changes, degrees, when the logarithm of the whole changes by 1."""
        return degrees(sin(2 * radians(way))) / 2 if self.law.bent else way

    def growth(self, zoom: float) -> float:
        """By which share the whole shrinks there with one level more."""
        return 1.0 / (4.0 + zoom) if self.law.zooms else 0.0

    def weights(self, axis: int, zoom: float) -> Vector:
        """How far each number counts for a whole's logarithm."""
        found = np.zeros(AXES + LEVELS)
        found[axis] = 1.0
        if self.law.zooms:
            at = min(LEVELS - 1.0, max(0.0, zoom))
            below = min(LEVELS - 2, int(at))
            found[AXES + below], found[AXES + below + 1] = 1.0 - (at - below), at - below
        return found

    def doubt(self, slope: Vector) -> float:
        """The standard deviation of what changes so with each number."""
        return float(np.sqrt(slope @ self.cov @ slope))

    def age(self) -> None:
        """A hop is over: where zoom stands in a level is not always the same."""
        self.cov = self.cov + (AGE if self.law.zooms else TURN_AGE) ** 2 * np.eye(len(self.mean))

    def learn(self, slope: Vector, wrong: float, noise: float) -> None:
        """Something that changes so with each number was off by that much; `noise` is one standard deviation."""
        spread = hypot(self.doubt(slope), noise)
        self.likely = FORGETS * self.likely - min(OUT, abs(wrong) / spread) ** 2 / 2 - log(spread)
        self.mean, self.cov = taught(self.mean, self.cov, slope, wrong, hypot(noise, BENT * wrong))


@dataclass
class Strays:
    """How far off looks showed hops, over how far off they may be by all that is learnt.

    `square`: the mean of its square, and `looks`: of so many.
    """

    square: float = STRAYED**2
    looks: float = FIRST_LOOKS

    @property
    def share(self) -> float:
        """Of all doubt about the end of hops, what experience leaves."""
        return min(1.0, max(LEAST_SHARE, MARGIN * sqrt(self.square)))

    def add(self, off: float) -> None:
        """A look showed one so far off."""
        self.looks = min(MOST_LOOKS, self.looks + 1)
        self.square += (min(1.0, off * off) - self.square) / self.looks


@dataclass
class Scale:
    """One form, by each law that it may follow; `off`: how far from where they should its hops end, over their way.

    `rested`, `flying`: what looks showed of hops that began at rest, and in flight: those begin less exactly.
    """

    laws: tuple[Planes, ...]
    off: float = 0.0
    rested: Strays = field(default_factory=Strays)
    flying: Strays = field(default_factory=lambda: Strays(looks=FLYING_LOOKS))

    @property
    def planes(self) -> Planes:
        """By the law that is believed; the first of those that are as likely."""
        return max(self.laws, key=lambda one: one.likely)


def scale_of(*laws: Law) -> Scale:
    """A form of which nothing is known but which law is the most likely: the first."""
    return Scale(tuple(Planes(law, likely=-UNLIKELY if number else 0.0) for number, law in enumerate(laws)))
