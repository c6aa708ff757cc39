"""The order of a scan's places: the best of all orders, by the measured speeds, never across the dead arc."""

from __future__ import annotations

import random
from itertools import pairwise, permutations

import pytest

from services.camera.device import Reading
from services.camera.ptz.goal import Limits
from services.camera.ptz.skill import Skill
from services.camera.scan.route import detours, hop_s, shortest
from services.payloads import Place

LIMITS = Limits()


def random_places(count: int, seed: int) -> dict[str, Place]:
    rng = random.Random(seed)
    pans = [rng.choice((rng.uniform(0, 178), rng.uniform(187, 359))) for _ in range(count)]
    return {f"P{number}": Place(pan=pan, tilt=rng.uniform(0, 80), zoom=0.0) for number, pan in enumerate(pans)}


def seconds(order: list[str], places: dict[str, Place], here: Reading, skill: Skill) -> float:
    way = [LIMITS.pose(here), *(LIMITS.pose(Reading(places[n].pan, places[n].tilt, 0.0)) for n in order)]
    return sum(hop_s(a, b, skill, drives=False) for a, b in pairwise(way))


@pytest.mark.parametrize("seed", range(5))
def test_no_other_order_is_shorter(seed: int) -> None:
    places, skill, here = random_places(7, seed), Skill(), Reading(20.0, 20.0, 0.0)
    found = seconds(shortest(places, LIMITS, here, skill), places, here, skill)
    best = min(seconds(list(order), places, here, skill) for order in permutations(places))
    assert found == pytest.approx(best)


def test_a_dozen_places_are_ordered_at_least_as_well_as_by_reversals() -> None:
    places, skill, here = random_places(12, 3), Skill(), Reading(300.0, 20.0, 0.0)
    exact = seconds(shortest(places, LIMITS, here, skill), places, here, skill)
    assert exact <= seconds(shortest(places, LIMITS, here, skill, exact=0), places, here, skill) + 1e-9


def test_many_places_are_all_visited_once() -> None:
    places = random_places(30, 1)
    assert sorted(shortest(places, LIMITS, None, Skill())) == sorted(places)


def test_the_way_never_leads_across_the_dead_arc() -> None:
    pans = {"West": 178.0, "East": 187.0, "North": 90.0, "South": 270.0}
    places = {name: Place(pan=pan, tilt=20.0, zoom=0.0) for name, pan in pans.items()}
    order = shortest(places, LIMITS, Reading(175.0, 20.0, 0.0), Skill())
    assert order == ["West", "North", "South", "East"]


def test_the_measured_speeds_decide() -> None:
    places = {"Far in pan": Place(pan=60.0, tilt=20.0, zoom=0.0), "Far in tilt": Place(pan=30.0, tilt=60.0, zoom=0.0)}
    quick, slow = Skill(), Skill()
    slow.paces[1].mean[:8] /= 10  # tilt creeps
    here = Reading(30.0, 20.0, 0.0)
    assert shortest(places, LIMITS, here, slow)[0] == "Far in pan"
    creeping = hop_s((0.0, 0.0, 0.0), (0.0, 40.0, 0.0), slow, drives=False)
    assert creeping > 5 * hop_s((0.0, 0.0, 0.0), (0.0, 40.0, 0.0), quick, drives=False)


def test_a_detour_costs_what_the_way_gets_longer() -> None:
    pans = {"West": 90.0, "Middle": 60.0, "East": 30.0, "Far east": 0.0}
    places = {name: Place(pan=pan, tilt=20.0, zoom=0.0) for name, pan in pans.items()}
    way, skill, stop = ["West", "Middle", "East", "Far east"], Skill(), Place(pan=62.0, tilt=20.0, zoom=0.0)
    more = detours(stop, list(places.values()), LIMITS, skill)
    with_stop = places | {"Stop": stop}

    def lasts(order: list[str]) -> float:
        return seconds(order, with_stop, Reading(90.0, 20.0, 0.0), skill)

    assert more == pytest.approx(
        [lasts([*way[: after + 1], "Stop", *way[after + 1 :]]) - lasts(way) for after in range(len(way))]
    )
    assert min(more) == min(more[:2]), "it is on the way there, or just behind"


def test_the_last_known_place_of_a_target_comes_first() -> None:
    places = random_places(9, 2)
    order = shortest(places, LIMITS, Reading(20.0, 20.0, 0.0), Skill(), first="P5")
    assert order[0] == "P5"
    assert sorted(order) == sorted(places)


def test_no_places_have_no_order() -> None:
    assert shortest({}, LIMITS, None, Skill()) == []
