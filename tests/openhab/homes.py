"""Homes for the tests: the shipped one, a large one, and random ones with every sign that people type."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from hypothesis import strategies as st

from services.apartment import forms
from services.apartment.home import NO_MQTT, Home
from services.openhab.site import Camera

SHIPPED = Path(__file__).parents[2] / "config" / "home.yaml"
PLACES = ("Kitchen", "Living room", 'the "big" table', "Tür, links", "a=b", "back\\slash", "// not a comment")
CAMERAS = (
    Camera("ip1", PLACES, (582, 17), "http://192.0.2.1:8081/camera/ip1/stream.mjpg", None),
    Camera("ip2", ("Hall",), (), None, "http://192.0.2.1:8081/camera/ip2/snapshot.jpg"),
)
TYPES = (
    "Switch", "Contact", "Number", "Number:Temperature", "Number:Power", "Number:Dimensionless", "String", "Dimmer",
    "Rollershutter", "Color", "DateTime", "Location", "Player", "Call", "Image",
)  # fmt: skip
ICONS = (None, "light", "motion", "f7:house", "Switch", "humidity", "soundvolume", "not an icon", "climate")
UNITS = (None, "°C", "%", "W", "lx", "µg/m³")
words = st.text(st.characters(exclude_categories=("Cs",)), max_size=30) | st.sampled_from(PLACES)
names = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,8}", fullmatch=True) | st.sampled_from(
    ("Color", "Group", "AND", "T", "s", "Switch", "true", "Text", "All", "ROS_Status", "default", "gRoom_a", "Ip1")
)


def shipped() -> Home:
    """The home that comes with the project."""
    return Home.model_validate(yaml.safe_load(SHIPPED.read_text(encoding="utf-8")))


def sized(count: int) -> Home:
    """A home of so many items of all types."""
    kinds = [TYPES[index % len(TYPES)] for index in range(count)]
    items = {f"Item_{index}": _sized(index, kind) for index, kind in enumerate(kinds)}
    typed = {"label": "On", "type": "Switch", "function": "OR", "arguments": ["ON", "OFF"]}
    return Home.model_validate(
        {
            "rooms": {f"room {index}": {"label": f"Room {index}"} for index in range(9)},
            "things": {f"thing_{one}": {"label": f"Thing {one}", "room": f"room {one % 9}"} for one in range(40)},
            "groups": {"gSome": "Some", "gTyped": typed},
            "items": items,
        }
    )  # fmt: skip


def _sized(index: int, kind: str) -> dict[str, Any]:
    fields: dict[str, Any] = {"type": kind, "label": f"Label {index}", "thing": f"thing_{index % 40}"}
    fields["groups"] = ["gSome"] if index % 3 == 0 else ["gTyped"]
    if kind in ("Switch", "Dimmer", "Contact") and index % 2:
        fields["alexa"] = {}
    if kind.startswith("Number"):
        fields |= {"range": {"min": -5.5, "max": 100, "step": 0.5}, "unit": "°C" if "Temp" in kind else None}
    if kind == "String":
        fields["options"] = {"a": "A", "b c": "B, C", 'd"': "D"}
    return fields


@st.composite
def items(draw: st.DrawFn, rooms: list[str], things: dict[str, str], groups: list[str]) -> dict[str, Any]:
    """One item with anything that the model allows; `things` with their kinds."""
    fields: dict[str, Any] = {"type": draw(st.sampled_from(TYPES)), "label": draw(words)}
    fields["thing"] = draw(st.sampled_from([None, *things]))
    fields["room"] = draw(st.sampled_from([None, *rooms]))
    fields["groups"] = draw(st.lists(st.sampled_from(groups), unique=True, max_size=2)) if groups else []
    fields["unit"] = draw(st.sampled_from(UNITS))
    fields["icon"] = draw(st.sampled_from(ICONS))
    fields["options"] = draw(st.dictionaries(words, words, max_size=3))
    low = draw(st.floats(-1e6, 1e6, allow_nan=False))
    fields["range"] = draw(st.sampled_from([None, {"min": low, "max": low + 10, "step": 0.25}, {"min": 0, "max": 1e9}]))
    fields["read_only"] = draw(st.booleans())
    fields["autoupdate"] = draw(st.booleans())
    fields["ros"] = draw(st.booleans())
    stored = st.lists(st.sampled_from(["everyChange", "everyUpdate", "restoreOnStartup"]), unique=True)
    fields["persist"] = draw(stored.filter(lambda one: one != ["restoreOnStartup"]))
    fields["alexa"] = draw(st.sampled_from([None, {}, {"name": "Küche, 2"}]))
    fields["ga"] = draw(st.sampled_from([None, "Light"]))
    fields["expire"] = draw(st.sampled_from([None, "5m", "2d,UNDEF"]))
    fields["tags"] = draw(st.sampled_from([None, [], ["Point", 'a "tag"']]))
    state = forms.CONTROL.sub("", draw(words)).replace("+", "").replace("#", "") or "a"
    topics: dict[str, Any] = {"state": state, "on": draw(words)}
    topics |= draw(st.sampled_from([{}, {"command": "dev/set"}, {"settings": {"qos": 1, "retained": True}}]))
    fields["mqtt"] = draw(st.sampled_from([None, topics])) if things.get(fields["thing"]) == "mqtt" else None
    fields["channels"] = draw(
        st.sampled_from([{}, {"zwave:device:c:node2:switch": {}}, {"a:b:c:d#e-f": {"profile": "follow", "x": -1.5}}])
    )
    if fields["type"] in NO_MQTT:
        fields["mqtt"] = None
    return fields


@st.composite
def homes(draw: st.DrawFn) -> Home:
    """Any home whose references are whole."""
    rooms = draw(st.lists(words.filter(bool), unique=True, max_size=3))
    kinds = st.sampled_from(["zwave", "mqtt"])
    things = draw(st.dictionaries(words.filter(bool), kinds, max_size=3))
    groups = draw(st.lists(names.filter(lambda name: name != "ROS"), unique=True, max_size=3))
    own = draw(st.lists(names.filter(lambda name: name not in (*groups, "ROS")), unique=True, min_size=1, max_size=8))
    return Home.model_validate(
        {
            "timezone": draw(st.sampled_from(["UTC", "Europe/Madrid"])),
            "rooms": {key: {"label": draw(words)} for key in rooms},
            "things": {key: {"label": draw(words), "room": draw(st.sampled_from([None, *rooms])),
                             "kind": kind, "alexa": draw(st.sampled_from([None, {}]))}
                       for key, kind in things.items()},
            "groups": {key: draw(words) for key in groups},
            "items": {name: draw(items(rooms, things, groups)) for name in own},
        }
    )  # fmt: skip
