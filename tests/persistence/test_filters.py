"""Filters as openHAB's: what passes, against what was stored last."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from services.persistence.filters import Filter, Kept

S = 1_000_000


def number(num: float, time: int = 0) -> Kept:
    return Kept("Number", num, f"{num}", time)


ON, OFF, UNDEF = Kept("Switch", 1.0, "ON", 0), Kept("Switch", 0.0, "OFF", 0), Kept("Number", None, "UNDEF", 0)
PASSES = [
    ({"threshold": 0.5}, number(20.5), number(20.0), False),
    ({"threshold": 0.5}, number(20.6), number(20.0), True),
    ({"threshold": 0.5}, number(20.1), None, True),
    ({"threshold": 0.5}, UNDEF, number(20.0), True),
    ({"threshold": 0.5}, number(20.1), UNDEF, True),
    ({"threshold": 0.5}, ON, OFF, True),
    ({"threshold": 5}, Kept("Dimmer", 60.0, "60", 0), Kept("Dimmer", 58.0, "58", 0), False),
    ({"threshold": 5}, Kept("Color", 60.0, "1,2,60", 0), Kept("Color", 58.0, "200,2,58", 0), False),
    ({"relative": 10}, number(110), number(100), False),
    ({"relative": 10}, number(111), number(100), True),
    ({"relative": 10}, number(-111), number(-100), True),
    ({"relative": 10}, number(0.1), number(0), True),
    ({"time": "30 s"}, number(1, 30 * S), number(1, 0), True),
    ({"time": "30 s"}, number(1, 30 * S - 1), number(1, 0), False),
    ({"time": "1m"}, number(1, 0), None, True),
    ({"equals": ["ON", "OFF"]}, ON, None, True),
    ({"equals": ["ON"]}, OFF, None, False),
    ({"not_equals": ["UNDEF"]}, UNDEF, None, False),
    ({"not_equals": ["UNDEF"]}, number(1), None, True),
    ({"include": [0, 100]}, number(0), None, True),
    ({"include": [0, 100]}, number(100.1), None, False),
    ({"include": [0, 100]}, UNDEF, None, True),
    ({"exclude": [0, 100]}, number(0), None, True),
    ({"exclude": [0, 100]}, number(50), None, False),
    ({"exclude": [0, 100]}, number(101), None, True),
]


@pytest.mark.parametrize(("words", "new", "last", "passes"), PASSES)
def test_a_state_passes_as_the_filter_says(
    words: dict[str, object], new: Kept, last: Kept | None, passes: bool
) -> None:
    assert Filter.model_validate(words).passes(new, last) is passes


@pytest.mark.parametrize(
    "words", [{}, {"unit": "W"}, {"threshold": 1, "time": 1}, {"threshold": -1}, {"time": "long"}, {"include": [5, 1]},
              {"include": [1]}, {"minimum": 3}],
)  # fmt: skip
def test_a_filter_says_one_thing(words: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Filter.model_validate(words)
