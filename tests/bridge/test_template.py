"""What becomes of templates with names in them."""

from __future__ import annotations

from typing import Any

import pytest

from services.bridge.template import Absent, as_text, fill, given, places, walk
from services.errors import BadMessage

VALUES = {"item": "Lamp", "n": 2.5, "on": True, "deep": {"list": [{"x": 1}, 7]}, "nothing": {"here": None}}


def look(path: tuple[str, ...]) -> Any:
    return walk(VALUES, path)


@pytest.mark.parametrize(
    ("template", "filled"),
    [
        ("plain", "plain"),
        ("{item}", "Lamp"),
        ("{n}", 2.5),
        ("{on}", True),
        ("a {item} of {n}", "a Lamp of 2.5"),
        ("{on}!", "true!"),
        ("{deep.list.0.x}", 1),
        ("{deep.list.1}", 7),
        ("{deep}", {"list": [{"x": 1}, 7]}),
        ("as text: {deep.list}", 'as text: [{"x": 1}, 7]'),
        ({"a": ["{item}", 3, {"b": "{n}"}]}, {"a": ["Lamp", 3, {"b": 2.5}]}),
        ("no {} place { item } here {1}", "no {} place { item } here {1}"),
        ("", ""),
        (None, None),
    ],
)
def test_placeholders_become_values_or_text(template: Any, filled: Any) -> None:
    assert fill(template, look) == filled


@pytest.mark.parametrize("path", ["unknown", "item.x", "deep.list.2", "deep.list.-1", "deep.list.x", "n.x"])
def test_a_part_that_is_not_there_is_told(path: str) -> None:
    with pytest.raises(BadMessage, match="expected"):
        walk(VALUES, tuple(path.split(".")))


@pytest.mark.parametrize("template", ["{nothing.here}", "{nothing.here.x}", ["{item}", "{nothing.here}"]])
def test_null_means_that_there_is_nothing_to_say(template: Any) -> None:
    with pytest.raises(Absent):
        fill(template, look)


def test_all_places_are_found() -> None:
    assert set(places({"a": "{b} and {c.d}", "e": ["{f}", 1]})) == {("b",), ("c", "d"), ("f",)}


def test_one_name_can_be_given_for_good() -> None:
    assert given({"a": ["{cam}/{key}", 1]}, "cam", "ip1") == {"a": ["ip1/{key}", 1]}


@pytest.mark.parametrize("value", [float("nan"), float("inf"), b"bytes", {"x": float("nan")}])
def test_what_has_no_text_is_refused(value: Any) -> None:
    with pytest.raises(BadMessage, match="expected"):
        as_text(value)
