"""The simulated home: it plays OpenHAB on the bus for whatever home the configuration describes.

It listens to `home/<item>/command` and `home/<item>/set` and says `home/<item>/state`: all of them once at the start,
then what changes. What an item does follows from its type and from the items it shares a thing with: power follows
the plug, a time follows the door, a room follows its thermostat. Not here: what devices do with a command
(`devices.py`), the air (`climate.py`), when things happen (`agenda.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from datetime import datetime
from functools import partial
from random import Random

from pydantic import Field

from services import topics
from services.bus import Message
from services.errors import BadMessage
from services.home import Home, Item
from services.runner import Post
from services.section import Section
from services.simulators import climate
from services.simulators.agenda import Agenda
from services.simulators.devices import Shutter, answer, convert, first_state, kept, predicted, unit_of
from services.states import base_type, check_command, check_state, moment_text, number, plain, quantity

STEP_S = 30.0  # how often sensors measure
SHUTTER_REPORT_S = 1.0  # how often a shutter says where it is while it moves
LAG_S = (0.2, 0.8)  # between a command and the device's report
VISIT_S = 240.0  # on average between two moves of somebody from room to room, by day
AWAKE_AT_NIGHT = 0.1  # how many of these happen at night
MOTION_S = (20.0, 60.0)  # how long a motion sensor stays on
DOOR_S = (4.0, 15.0)  # how long a door stays open
DOOR_USED = 0.3  # how often somebody in a room with a door uses it
STANDBY_W = 0.4  # of a plug whose switch is off


class Config(Section):
    """How the simulated home runs."""

    home: Home
    seed: int = 1  # the same seed and the same start make the same day
    speed: float = Field(default=1.0, gt=0)  # seconds of the home per second of the clock


@contextmanager
def start(config: Config, post: Post) -> Iterator[SimulatedHome]:
    """The service; it needs nothing that has to be closed."""
    yield SimulatedHome(config)


class SimulatedHome:
    """The service. `_devices` is what each device is at, `_states` what OpenHAB believes: `set` changes only that."""

    subscribes = (topics.HOME_COMMAND.filter, topics.HOME_SET.filter)

    def __init__(self, config: Config) -> None:
        self.due: float | None = 0.0
        self.counters = {"commands": 0, "updates": 0, "refused": 0}
        self._home, self._seed = config.home, config.seed
        self._zone = config.home.zone
        self._draw = Random(config.seed)
        self._agenda = Agenda(config.speed)
        self._states: dict[str, str] = {}
        self._devices = {name: first_state(item) for name, item in self._home.items.items() if item.thing}
        self._shutters = {name: Shutter() for name in self._devices if self._kind(name) == "Rollershutter"}
        self._reporting: set[str] = set()  # shutters that will say where they are
        self._visited: dict[str, float] = {}  # motion sensor -> when it goes off
        self._air: dict[str, climate.Room] = {}
        self._outdoor = 0.0
        self._said: list[Message] = []

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        """Takes a command or an update; BadMessage when the item or its device would not."""
        read = topics.read(message, now)
        time = self._begin(now)
        name, text = read.levels["item"], read.payload
        try:
            if name not in self._home.items:
                raise BadMessage("no such item")
            self._command(name, text, time) if read.topic is topics.HOME_COMMAND else self._set(name, text)
        except BadMessage as error:
            self.counters["refused"] += 1
            raise BadMessage(f"{message.topic}: {error}") from error
        return self._flush()

    def tick(self, now: float) -> Iterable[Message]:
        """Lets the home live up to `now`."""
        self._begin(now)
        self._agenda.run(now)
        return self._flush()

    def _flush(self) -> list[Message]:
        said, self._said = self._said, []
        self.due = self._agenda.due
        return said

    def _begin(self, now: float) -> float:
        time = self._agenda.time(now)
        if not self._states:
            self._outdoor = climate.outside(self._seed, self._local(time))
            for room in self._home.rooms:
                wanted = max(self._wanted(room, time), self._outdoor + climate.FREE_HEAT_K)
                self._air[room] = climate.Room(f"{self._seed}/{room}", wanted)
            for name in self._home.items:
                self._state(name, self._devices.get(name, "NULL"))
            self._said.clear()
            self._measure(time)
            self._said = [topics.HOME_STATE.message(text, item=name) for name, text in self._states.items()]
            self._agenda.at(time + STEP_S, self._live)
            self._agenda.at(time + self._draw.expovariate(1 / VISIT_S), self._visit)
        return time

    def _kind(self, name: str) -> str:
        return base_type(self._home.items[name].type)

    def _local(self, time: float) -> datetime:
        return datetime.fromtimestamp(time, self._zone)

    def _mates(self, name: str) -> Iterator[tuple[str, Item]]:
        """The other items of the same thing."""
        thing = self._home.items[name].thing
        for other, item in self._home.items.items():
            if thing is not None and item.thing == thing and other != name:
                yield other, item

    # States: what OpenHAB believes, and what devices report.

    def _state(self, name: str, text: str) -> None:
        if self._states.get(name) != text:
            self._states[name] = text
            self._said.append(topics.HOME_STATE.message(text, item=name))

    def _report(self, name: str, text: str) -> None:
        """A device says something new."""
        if self._devices[name] != text:
            self._devices[name] = text
            self._state(name, text)

    def _command(self, name: str, command: str, time: float) -> None:
        item = self._home.items[name]
        check_command(item.type, command)
        if not item.takes_commands and command != "REFRESH":
            raise BadMessage("it is read only; use `set` to post an update")
        state = self._devices.get(name)
        if state is not None and command != "REFRESH" and name not in self._shutters:
            self._devices[name] = answer(item, state, command, self._zone)
        self.counters["commands"] += 1
        guess = None if command == "REFRESH" else predicted(item, self._states[name], command, self._zone)
        if guess is not None:
            self._state(name, guess)
        if state is not None:
            self._answer_later(name, command, time)

    def _answer_later(self, name: str, command: str, time: float) -> None:
        when = time + self._draw.uniform(*LAG_S)
        if name not in self._shutters:
            self._agenda.at(when, partial(self._confirm, name))
            return
        if command != "REFRESH":
            self._shutters[name].command(command, time)
        if name not in self._reporting:
            self._reporting.add(name)
            self._agenda.at(when, partial(self._follow, name))

    def _confirm(self, name: str, time: float) -> None:
        """The device reports what it is at by now, and what else its thing measures."""
        self._state(name, self._devices[name])
        for other, item in self._mates(name):
            if item.type == "Number:Power":
                self._report(other, self._watts(other, item, time))

    def _follow(self, name: str, time: float) -> None:
        """A shutter says where it is, and again until it has arrived."""
        shutter = self._shutters[name]
        self._devices[name] = plain(float(round(shutter.at(time))))
        self._state(name, self._devices[name])
        if shutter.moving(time):
            self._agenda.at(time + SHUTTER_REPORT_S, partial(self._follow, name))
        else:
            self._reporting.discard(name)

    def _set(self, name: str, text: str) -> None:
        """Post an update: believed, and unknown to the device, whose next report corrects it."""
        item = self._home.items[name]
        check_state(item.type, text)
        self._state(name, kept(item, self._states[name], text, self._zone))
        self.counters["updates"] += 1

    # What happens by itself.

    def _live(self, time: float) -> None:
        self._outdoor = climate.outside(self._seed, self._local(time))
        for room, air in self._air.items():
            air.step(STEP_S, self._outdoor, self._wanted(room, time), time)
        self._measure(time)
        self._agenda.at(time + STEP_S, self._live)

    def _measure(self, time: float) -> None:
        for name, item in self._home.items.items():
            if item.read_only and item.thing and self._kind(name) == "Number":
                sensor = SENSORS.get((item.type, unit_of(item))) or SENSORS.get((item.type, ""), _anything)
                self._report(name, sensor(self, name, item, time))

    def _wanted(self, room: str, time: float) -> float:
        """What the room's heating aims at in °C: its thermostat's setpoint and mode, where it has one."""
        setpoint, mode = climate.COMFORT_C, "manual"
        for name, item in self._home.items.items():
            if item.read_only or name not in self._devices or self._home.room_of(name) != room:
                continue
            if item.type == "Number:Temperature":
                value, unit = quantity(self._devices[name])
                setpoint = convert(value, unit, "°C")
                modes = [other for other, mate in self._mates(name) if mate.type == "String" and mate.options]
                mode = self._devices[modes[0]] if modes else mode
        return climate.wanted(setpoint, mode, night=climate.is_night(self._local(time)))

    def _celsius(self, room: str | None) -> float:
        return self._air[room].celsius if room is not None else self._outdoor

    def _temperature(self, name: str, item: Item, time: float) -> str:
        unit = unit_of(item)
        return f"{convert(self._celsius(self._home.room_of(name)), '°C', unit):.1f} {unit}"

    def _humidity(self, name: str, item: Item, time: float) -> str:
        room = self._home.room_of(name)
        percent = climate.humidity(self._seed, room, self._celsius(room), self._outdoor, time)
        return f"{percent:.1f} %"

    def _watts(self, name: str, item: Item, time: float) -> str:
        """Standby, and what the thing takes at the level its switch, dimmer, lamp or player is at."""
        most = item.range.max if item.range else convert(100.0, "W", unit_of(item))
        rated = most * Random(f"{self._seed}/{name}").uniform(0.3, 0.8)
        level = 0.0
        for other, mate in self._mates(name):
            if base_type(mate.type) in ("Switch", "Dimmer", "Color", "Player") and not mate.read_only:
                level = max(level, _level(mate, self._devices[other]))
        noise = 1.0 + 0.03 * climate.wander(f"{self._seed}/{name}", 60.0 * time)
        return f"{max(convert(STANDBY_W, 'W', unit_of(item)), rated * level * noise):.1f} {unit_of(item)}"

    def _visit(self, time: float) -> None:
        """Somebody comes into a room; what is in no room sees everybody."""
        self._agenda.at(time + self._draw.expovariate(1 / VISIT_S), self._visit)
        room = self._draw.choice([*self._home.rooms, None] if not self._home.rooms else list(self._home.rooms))
        if climate.is_night(self._local(time)) and self._draw.random() > AWAKE_AT_NIGHT:
            return
        for name, item in self._home.items.items():
            if name not in self._devices or self._home.room_of(name) not in (room, None):
                continue
            if self._kind(name) == "Switch" and item.read_only:
                self._notice(name, "ON", "OFF", time, self._draw.uniform(*MOTION_S))
            elif self._kind(name) == "Contact" and self._draw.random() < DOOR_USED:
                self._notice(name, "OPEN", "CLOSED", time, self._draw.uniform(*DOOR_S))

    def _notice(self, name: str, on: str, off: str, time: float, seconds: float) -> None:
        """A sensor goes on for a while, and longer when it was on already; a time of its thing says since when."""
        if self._devices[name] != on:
            self._report(name, on)
            for other, item in self._mates(name):
                if item.type == "DateTime" and item.read_only:
                    self._report(other, moment_text(self._local(time)))
        self._visited[name] = time + seconds
        self._agenda.at(time + seconds, partial(self._calm, name, off))

    def _calm(self, name: str, off: str, time: float) -> None:
        if self._visited[name] <= time:
            self._report(name, off)


def _level(item: Item, state: str) -> float:
    """How far a switch, dimmer, lamp or player is on, 0 to 1."""
    return (number(item.type, state) or 0.0) / (100.0 if base_type(item.type) in ("Dimmer", "Color") else 1.0)


def _anything(home: SimulatedHome, name: str, item: Item, time: float) -> str:
    """A sensor of which nothing is known wanders in the middle of its range."""
    low, high = (item.range.min, item.range.max) if item.range else (0.0, 100.0)
    value = (low + high) / 2 + (high - low) / 4 * climate.wander(f"{home._seed}/{name}", time)
    return f"{value:.1f} {unit_of(item)}".rstrip()


# Item type and unit -> what such a sensor measures; an empty unit stands for every other.
SENSORS: dict[tuple[str, str], Callable[[SimulatedHome, str, Item, float], str]] = {
    ("Number:Temperature", ""): SimulatedHome._temperature,
    ("Number:Dimensionless", "%"): SimulatedHome._humidity,
    ("Number:Power", ""): SimulatedHome._watts,
}
