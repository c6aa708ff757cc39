"""What happens by itself in a simulated home: the air changes, sensors measure, people walk about and use doors.

It works for any home: a sensor is what is read only and belongs to a thing; a room follows the thermostat in it,
power follows the switch of the same thing, a time follows the door of the same thing. Pure but for what it is given:
times come from the agenda, chance from the seed. Not here: commands and OpenHAB's states (`home.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from functools import partial
from random import Random

from services.apartment.home import Home, Item
from services.simulators import climate
from services.simulators.agenda import Agenda
from services.simulators.devices import convert, unit_of
from services.states import base_type, moment_text, number, quantity

STEP_S = 30.0  # how often sensors measure
VISIT_S = 240.0  # on average between two moves of somebody from room to room, by day
AWAKE_AT_NIGHT = 0.1  # how many of these happen at night
MOTION_S = (20.0, 60.0)  # how long a motion sensor stays on
DOOR_S = (4.0, 15.0)  # how long a door stays open
DOOR_USED = 0.3  # how often somebody in a room with a door uses it
STANDBY_W = 0.4  # of a plug whose switch is off
LIT = ("Switch", "Dimmer", "Color", "Player")  # what draws power

Report = Callable[[str, str], None]  # a device of this item says this state


class Life:
    """The home between two commands. `devices` is what each device is at; it is read here and changed by `report`."""

    def __init__(self, home: Home, seed: int, devices: Mapping[str, str], agenda: Agenda, report: Report) -> None:
        self._home, self._seed, self._zone = home, seed, home.zone
        self._devices, self._agenda, self._report = devices, agenda, report
        self._draw = Random(f"{seed}/people")
        self._air: dict[str, climate.Room] = {}
        self._outdoor = self._damp = 0.0  # the weather: °C, and vapour pressure in Pa
        self._until: dict[str, float] = {}  # motion sensor or door -> when it goes off again
        self._sensors = [name for name in devices if home.items[name].only_told and self._kind(name) == "Number"]
        self._setpoints = {
            home.room_of(name): name
            for name in devices
            if home.items[name].type == "Number:Temperature" and not home.items[name].only_told
        }

    def begin(self, time: float) -> None:
        """The home as it is at that time: warm rooms, and every sensor read once."""
        self._look_outside(time)
        for room in self._home.rooms:
            warm = max(self._wanted(room, time), self._outdoor + climate.FREE_HEAT_K)
            self._air[room] = climate.Room(f"{self._seed}/{room}", warm, self._damp + climate.FREE_VAPOUR_PA)
        self._measure(time)
        self._agenda.at(time + STEP_S, self._step)
        self._agenda.at(time + self._draw.expovariate(1 / VISIT_S), self._visit)

    def settle(self, name: str, time: float) -> None:
        """Measures what follows at once from a new state of that device: the power its thing takes."""
        for other, item in self._mates(name):
            if item.type == "Number:Power":
                self._report(other, self._watts(other, time))

    def _kind(self, name: str) -> str:
        return base_type(self._home.items[name].type)

    def _local(self, time: float) -> datetime:
        return datetime.fromtimestamp(time, self._zone)

    def _mates(self, name: str) -> Iterator[tuple[str, Item]]:
        """The other items of the same thing."""
        thing = self._home.items[name].thing
        return ((other, self._home.items[other]) for other in self._devices
                if other != name and self._home.items[other].thing == thing)  # fmt: skip

    def _look_outside(self, time: float) -> None:
        self._outdoor = climate.outside(self._seed, self._local(time))
        self._damp = climate.vapour_outside(self._seed, self._local(time))

    def _step(self, time: float) -> None:
        self._look_outside(time)
        for room, air in self._air.items():
            air.step(STEP_S, self._outdoor, self._damp, self._wanted(room, time), time)
        self._measure(time)
        self._agenda.at(time + STEP_S, self._step)

    def _wanted(self, room: str, time: float) -> float:
        """What the room's heating aims at in °C: its thermostat's setpoint and mode, else the house's programme."""
        setpoint, mode = climate.COMFORT_C, "auto"
        if name := self._setpoints.get(room):
            setpoint = convert(*quantity(self._devices[name]), "°C")
            modes = [other for other, mate in self._mates(name) if mate.type == "String" and mate.options]
            mode = self._devices[modes[0]] if modes else "manual"
        return climate.wanted(setpoint, mode, night=climate.is_night(self._local(time)))

    def _measure(self, time: float) -> None:
        for name in self._sensors:
            self._report(name, self._reading(name, time))

    def _reading(self, name: str, time: float) -> str:
        item = self._home.items[name]
        if item.type == "Number:Power":
            return self._watts(name, time)
        room, unit = self._home.room_of(name), unit_of(item)
        air = climate.Room("", self._outdoor, self._damp) if room is None else self._air[room]
        if item.type == "Number:Temperature":
            value = convert(air.celsius, "°C", unit)
        elif item.type == "Number:Dimensionless" and unit == "%":
            value = climate.relative(air.vapour, air.celsius)
        else:
            low, high = (item.range.min, item.range.max) if item.range else (0.0, 100.0)
            value = (low + high) / 2 + (high - low) / 4 * climate.wander(f"{self._seed}/{name}", time)
        return f"{value:.1f} {unit}".rstrip()

    def _watts(self, name: str, time: float) -> str:
        """Standby, and what the thing takes at the level its switch, dimmer, lamp or player is at."""
        item = self._home.items[name]
        unit = unit_of(item)
        rated = (item.range.max if item.range else 100.0) * Random(f"{self._seed}/{name}").uniform(0.3, 0.8)
        noise = 1.0 + 0.03 * climate.wander(f"{self._seed}/{name}", 60.0 * time)
        levels = [
            _level(mate, self._devices[other])
            for other, mate in self._mates(name)
            if base_type(mate.type) in LIT and not mate.only_told
        ]
        return f"{max(convert(STANDBY_W, 'W', unit), rated * max(levels, default=1.0) * noise):.1f} {unit}"

    def _visit(self, time: float) -> None:
        """Somebody comes into a room; what is in no room sees everybody."""
        self._agenda.at(time + self._draw.expovariate(1 / VISIT_S), self._visit)
        room = self._draw.choice([*self._home.rooms] or [None])
        if climate.is_night(self._local(time)) and self._draw.random() > AWAKE_AT_NIGHT:
            return
        for name in self._devices:
            if self._home.room_of(name) not in (room, None):
                continue
            if self._kind(name) == "Switch" and self._home.items[name].only_told:
                self._notice(name, "ON", "OFF", time, self._draw.uniform(*MOTION_S))
            elif self._kind(name) == "Contact" and self._draw.random() < DOOR_USED:
                self._notice(name, "OPEN", "CLOSED", time, self._draw.uniform(*DOOR_S))

    def _notice(self, name: str, on: str, off: str, time: float, seconds: float) -> None:
        """A sensor goes on for a while, or stays on for longer; a time of its thing says since when."""
        if self._devices[name] != on:
            self._report(name, on)
            for other, item in self._mates(name):
                if item.type == "DateTime" and item.only_told:
                    self._report(other, moment_text(self._local(time)))
        self._until[name] = time + seconds
        self._agenda.at(time + seconds, partial(self._calm, name, off))

    def _calm(self, name: str, off: str, time: float) -> None:
        if self._until[name] <= time:
            self._report(name, off)


def _level(item: Item, state: str) -> float:
    """How far a switch, dimmer, lamp or player is on, 0 to 1."""
    return (number(item.type, state) or 0.0) / (100.0 if base_type(item.type) in ("Dimmer", "Color") else 1.0)
