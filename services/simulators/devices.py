"""The devices of a simulated home, by item type: what a command makes of a state, and how a shutter moves.

Pure: texts and `now` in, texts out, in OpenHAB's string forms (`states.py`). Two things are told apart, as in OpenHAB:
what the item takes for its state (`kept`), and what the device answers (`answer`). Not here: the air (`climate.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import tzinfo

from services.apartment.home import Item
from services.errors import BadMessage
from services.states import SPECIAL, base_type, color, moment, moment_text, number, parts, percent, plain, quantity

STEP_PERCENT = 10.0  # INCREASE and DECREASE, where the range has no step
TRAVEL_S = 15.0  # a shutter from up to down
DEFAULT_UNITS = {"Temperature": "°C", "Power": "W", "Pressure": "hPa", "Illuminance": "lx"}  # OpenHAB's, metric
# Unit -> (what it measures, factor, offset): value * factor + offset is in the first unit of its kind.
UNITS = {
    "°C": ("temperature", 1.0, 0.0),
    "°F": ("temperature", 5 / 9, -160 / 9),
    "K": ("temperature", 1.0, -273.15),
    "W": ("power", 1.0, 0.0),
    "kW": ("power", 1000.0, 0.0),
    "hPa": ("pressure", 1.0, 0.0),
    "Pa": ("pressure", 0.01, 0.0),
}
FIRST = {"Switch": "OFF", "Contact": "CLOSED", "Dimmer": "0", "Rollershutter": "0", "Color": "0,0,0", "Player": "PAUSE"}
NOT_STATES = ("INCREASE", "DECREASE", "NEXT", "PREVIOUS", "STOP", "MOVE")  # commands that say no new state


def unit_of(item: Item) -> str:
    """The unit of an item's states; empty for a plain number."""
    return item.unit or DEFAULT_UNITS.get(item.type.partition(":")[2], "")


def convert(value: float, unit: str, wanted: str) -> float:
    """A value in another unit; without a unit it is in the wanted one already. BadMessage when the two do not fit."""
    if unit in ("", wanted):
        return value
    if unit not in UNITS or wanted not in UNITS or UNITS[unit][0] != UNITS[wanted][0]:
        raise BadMessage(f"expected a value in {wanted or 'no unit'}, got one in {unit[:20]}")
    _, factor, offset = UNITS[unit]
    _, wanted_factor, wanted_offset = UNITS[wanted]
    return round((value * factor + offset - wanted_offset) / wanted_factor, 6)


def _with_unit(item: Item, value: float) -> str:
    return f"{plain(value)} {unit_of(item)}".rstrip()


def _value(item: Item, text: str) -> float:
    value, unit = quantity(text)
    return convert(value, unit, unit_of(item)) if ":" in item.type else value


def _kept_color(state: str, text: str) -> str:
    hue, saturation, brightness = (0.0, 0.0, 0.0) if state in SPECIAL else color(state)
    if "," in text:
        hue, saturation, brightness = color(text)
    else:
        brightness = percent({"ON": "100", "OFF": "0"}.get(text, text))
    return ",".join(plain(part) for part in (hue, saturation, brightness))


def _kept_location(text: str) -> str:
    numbers = parts(text, 2, 3)
    return ",".join(plain(part) for part in (numbers[:2] if numbers[2:] == [0.0] else numbers))


def kept(item: Item, state: str, text: str, zone: tzinfo) -> str:
    """The form in which the item keeps a text that is a state of its type; `state` is what it has now.

    Raises BadMessage for a unit that does not fit.
    """
    kind = base_type(item.type)
    if text in SPECIAL:
        return text
    if kind == "Number":
        return _with_unit(item, _value(item, text))
    if kind in ("Dimmer", "Rollershutter"):
        return plain(number(kind, text) or 0.0)
    if kind == "Color":
        return _kept_color(state, text)
    if kind == "Location":
        return _kept_location(text)
    return moment_text(moment(text, zone)) if kind == "DateTime" else text


def _dimmed(item: Item, state: str, command: str, zone: tzinfo) -> str:
    """Percent and colour: up and down by steps, the rest as it is."""
    if command not in ("INCREASE", "DECREASE"):
        return kept(item, state, command, zone)
    step = item.range.step if item.range and item.range.step else STEP_PERCENT
    level = (number(item.type, state) or 0.0) + (step if command == "INCREASE" else -step)
    return kept(item, state, plain(min(100.0, max(0.0, level))), zone)


def _set_number(item: Item, state: str, command: str, zone: tzinfo) -> str:
    """What the device can do: within its range, at its steps."""
    value = _value(item, command)
    if item.range and not item.range.min <= value <= item.range.max:
        raise BadMessage(f"expected {plain(item.range.min)} to {plain(item.range.max)}, got {command[:80]!r}")
    if item.range and item.range.step:
        value = round(round(value / item.range.step) * item.range.step, 6)
    return _with_unit(item, value)


def _choose(item: Item, state: str, command: str, zone: tzinfo) -> str:
    if item.options and command not in item.options:
        raise BadMessage(f"expected one of {', '.join(item.options)}, got {command[:80]!r}")
    return command


def _play(item: Item, state: str, command: str, zone: tzinfo) -> str:
    return "PLAY" if command in ("NEXT", "PREVIOUS") else command


ANSWERS: dict[str, Callable[[Item, str, str, tzinfo], str]] = {
    "Dimmer": _dimmed,
    "Color": _dimmed,
    "Number": _set_number,
    "String": _choose,
    "Player": _play,
}


def answer(item: Item, state: str, command: str, zone: tzinfo) -> str:
    """The state of the device after a legal command; BadMessage when the device cannot do it."""
    return ANSWERS.get(base_type(item.type), kept)(item, state, command, zone)


def predicted(item: Item, state: str, command: str, zone: tzinfo) -> str | None:
    """OpenHAB's autoupdate: the state that the item takes before its device says anything; None when it waits.

    A shutter's binding forbids it, because the shutter is not yet where it was told to go.
    """
    if not item.autoupdate or command in NOT_STATES or base_type(item.type) == "Rollershutter":
        return None
    return kept(item, state, command, zone)


def first_state(item: Item) -> str:
    """What the device of an item says when the home starts; sensors are read later."""
    kind = base_type(item.type)
    if kind == "String" and item.options:
        return next(iter(item.options))
    if kind == "Number" and not item.only_told:
        low, high = (item.range.min, item.range.max) if item.range else (0.0, 100.0)
        usual = convert(21.0, "°C", unit_of(item)) if item.type == "Number:Temperature" else low
        return _with_unit(item, min(high, max(low, usual)))
    return FIRST.get(kind, "NULL")


@dataclass
class Shutter:
    """A roller shutter: percent, 0 is up and 100 down; it moves evenly from where it was at `since` to `goal`."""

    start: float = 0.0
    goal: float = 0.0
    since: float = 0.0

    def at(self, now: float) -> float:
        """Where it is, percent."""
        way = self.goal - self.start
        done = max(0.0, now - self.since) * 100.0 / TRAVEL_S
        return self.goal if done >= abs(way) else self.start + (done if way > 0 else -done)

    def moving(self, now: float) -> bool:
        """Whether it has not arrived."""
        return self.at(now) != self.goal

    def command(self, command: str, now: float) -> None:
        """UP, DOWN, STOP, MOVE (down, or up when it is down) or a percent."""
        here = self.at(now)
        if command == "MOVE":
            command = "UP" if here == 100.0 else "DOWN"
        goal = here if command == "STOP" else number("Rollershutter", command)
        self.start, self.goal, self.since = here, here if goal is None else goal, now
