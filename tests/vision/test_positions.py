"""Positions over random flats of the simulator are exact and honest; `make soak PART=positions` has more of them."""

from __future__ import annotations

import pytest

from tests import bounds
from tests.vision.positions import Figures, Outcome, Refusals, kinds, scene

SCENES, EACH, ZOOMED = range(8), 7, 1


@pytest.fixture(scope="module")
def outcomes() -> dict[str, list[Outcome]]:
    refused = Refusals()
    found = kinds([one for seed in SCENES for one in scene(seed, EACH, ZOOMED, refused)])
    assert len(refused) <= 2, refused
    return found


@pytest.mark.parametrize(
    ("kind", "bound"),
    [
        ("wide, exact", bounds.EXACT_MM),
        ("wide, calibrated", bounds.NOISY_MM),
        ("zoomed, exact", bounds.EXACT_MM),
        ("zoomed, calibrated", bounds.NOISY_MM),
    ],
)
def test_markers_are_where_they_are_said_to_be(
    outcomes: dict[str, list[Outcome]], kind: str, bound: tuple[float, float]
) -> None:
    figures = Figures.of(outcomes[kind])
    assert figures.median_mm <= bound[0]
    assert figures.most_mm <= bound[1]


@pytest.mark.parametrize("kind", ["wide, exact", "wide, noisy"])
def test_the_ellipsoid_holds_what_it_promises(outcomes: dict[str, list[Outcome]], kind: str) -> None:
    """56 sightings tell it to within a tenth; the soak tells it to a few hundredths."""
    assert abs(Figures.of(outcomes[kind]).inside - bounds.INSIDE) <= 0.1


def test_what_is_said_to_be_certain_is_not_flipped(outcomes: dict[str, list[Outcome]]) -> None:
    every = Figures.of([one for ones in outcomes.values() for one in ones])
    assert every.sure > 0.8 * every.count
    assert every.flipped <= bounds.FLIPPED


def test_the_magnification_of_zoomed_pictures_is_exact(outcomes: dict[str, list[Outcome]]) -> None:
    off = Figures.of(outcomes["zoomed, exact"]).magnification
    assert off is not None
    assert off <= bounds.MAGNIFICATION
