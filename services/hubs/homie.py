"""The home as one device of the Homie convention 4.0: a node per item, each with the property `value`. Pure.

Not here: when it is said (`service.py`). The last will belongs to our service's own status topic, so `$state` does not
turn to `lost` by itself.
"""

from __future__ import annotations

from collections.abc import Iterator

from services import topics
from services.apartment.home import Home, Item
from services.bus import Message
from services.errors import BadMessage
from services.states import SPECIAL, base_type, plain, quantity

DEVICE = "apartment"
PROPERTY = "value"
BOOLEAN = {"ON": "true", "OFF": "false"}
ENUMS = {"Contact": ("OPEN", "CLOSED"), "Player": ("PLAY", "PAUSE", "NEXT", "PREVIOUS", "REWIND", "FASTFORWARD")}
DATATYPES = {
    "Switch": "boolean",
    "Contact": "enum",
    "Number": "float",
    "Dimmer": "integer",
    "Rollershutter": "integer",
    "Color": "color",
    "Player": "enum",
    "DateTime": "datetime",
    "String": "string",
    "Location": "string",
}


class Projection:
    """The home as a Homie device."""

    def __init__(self, home: Home) -> None:
        shown = [name for name, item in home.ros_items.items() if base_type(item.type) in DATATYPES]
        self._items = {name: home.items[name] for name in shown}
        self.nodes: dict[str, str] = {}  # item -> node
        for name in shown:
            self.nodes[name] = _node(name, set(self.nodes.values()))
        self.names = {node: name for name, node in self.nodes.items()}

    def description(self) -> Iterator[Message]:
        """Everything that says what there is; `$state` last."""
        yield _device("$state", "init")
        yield _device("$homie", "4.0.0")
        yield _device("$name", "Apartment")
        yield _device("$extensions", "")
        yield _device("$nodes", ",".join(self.nodes.values()))
        for name, item in self._items.items():
            node = self.nodes[name]
            for attribute, text in (("$name", item.label or name), ("$type", item.type), ("$properties", PROPERTY)):
                yield topics.HOMIE_NODE.message(text, device=DEVICE, node=node, attribute=attribute)
            for attribute, text in _attributes(name, item):
                yield topics.HOMIE_ATTRIBUTE.message(text, device=DEVICE, node=node, property=PROPERTY, trait=attribute)
        yield _device("$state", "ready")

    def state(self, name: str, text: str) -> Message | None:
        """The value that a state is in Homie; None for one that it has no word for."""
        if name not in self._items or text in SPECIAL:
            return None
        value = _value(self._items[name], text)
        return topics.HOMIE_VALUE.message(value, device=DEVICE, node=self.nodes[name], property=PROPERTY)

    def command(self, node: str, text: str) -> Message:
        """The command that a wish is on our bus; BadMessage when there is no such item."""
        if node not in self.names:
            raise BadMessage(f"no item behind the node {node!r}")
        name = self.names[node]
        words = {value: word for word, value in BOOLEAN.items()}
        kind = base_type(self._items[name].type)
        return topics.HOME_COMMAND.message(words.get(text, text) if kind == "Switch" else text, item=name)


def _node(name: str, taken: set[str]) -> str:
    node = name.lower().replace("_", "-").strip("-") or "item"
    while node in taken:
        node += "-x"
    return node


def _device(attribute: str, text: str) -> Message:
    return topics.HOMIE_DEVICE.message(text, device=DEVICE, attribute=attribute)


def _attributes(name: str, item: Item) -> Iterator[tuple[str, str]]:
    kind = base_type(item.type)
    listed = _choices(item)
    datatype = "enum" if listed else DATATYPES[kind]
    yield "$name", item.label or name
    yield "$datatype", datatype
    yield "$settable", "true" if item.takes_commands else "false"
    if listed:
        yield "$format", listed
    elif kind == "Color":
        yield "$format", "hsv"
    elif kind in ("Dimmer", "Rollershutter"):
        yield "$format", "0:100"
    elif kind == "Number" and item.range is not None:
        yield "$format", f"{plain(item.range.min)}:{plain(item.range.max)}"
    unit = "%" if kind in ("Dimmer", "Rollershutter") else item.unit if kind == "Number" else None
    if unit:
        yield "$unit", unit


def _choices(item: Item) -> str:
    """The values of an enum; nothing where they cannot be listed with commas."""
    kind = base_type(item.type)
    if kind in ENUMS:
        return ",".join(ENUMS[kind])
    listable = kind == "String" and item.options and all(state and "," not in state for state in item.options)
    return ",".join(item.options) if listable else ""


def _value(item: Item, text: str) -> str:
    kind = base_type(item.type)
    if kind == "Switch":
        return BOOLEAN.get(text, text)
    if kind == "Number":
        return plain(quantity(text)[0])
    if kind in ("Dimmer", "Rollershutter"):
        return str(round(quantity(text)[0])) if text[:1].isdigit() else text
    return text
