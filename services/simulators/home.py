"""The simulated home: it plays OpenHAB on the bus for whatever home the configuration describes.

It listens to `home/<item>/command` and `home/<item>/set` and says `home/<item>/state`: all of them once at the start,
then what changes. Not here: what devices do with a command (`devices.py`), what happens by itself (`life.py`), the
air (`climate.py`), when things happen (`agenda.py`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from random import Random

from pydantic import Field

from services import topics
from services.apartment.home import Home
from services.bus import Message
from services.errors import BadMessage
from services.runner import Post
from services.section import Section
from services.simulators.agenda import Agenda
from services.simulators.devices import Shutter, answer, first_state, kept, predicted
from services.simulators.life import Life
from services.states import base_type, check_command, check_state, plain

SHUTTER_REPORT_S = 1.0  # how often a shutter says where it is while it moves
LAG_S = (0.2, 0.8)  # between a command and the device's report, as radio devices have it


class Config(Section):
    """How the simulated home runs."""

    home: Home
    seed: int = 1  # the same seed and the same start make the same day
    speed: float = Field(default=1.0, gt=0, le=3600)  # seconds of the home per second of the clock


@contextmanager
def start(config: Config, post: Post) -> Iterator[SimulatedHome]:
    """The service; it holds nothing that has to be closed."""
    yield SimulatedHome(config)


class SimulatedHome:
    """The service. `_devices` is what each device is at, `_states` what OpenHAB believes; `set` changes only that."""

    subscribes = (topics.HOME_COMMAND.filter, topics.HOME_SET.filter)

    def __init__(self, config: Config) -> None:
        self.due: float | None = 0.0
        self.counters = {"commands": 0, "updates": 0, "refused": 0}
        self._items, self._zone = config.home.items, config.home.zone
        self._draw = Random(config.seed)
        self._agenda = Agenda(config.speed)
        self._awake = False
        self._said: list[Message] = []
        self._states: dict[str, str] = {}
        self._devices = {name: first_state(item) for name, item in self._items.items() if item.thing}
        self._shutters = {name: Shutter() for name in self._devices if self._is_shutter(name)}
        self._following: set[str] = set()  # shutters that will say where they are
        self._life = Life(config.home, config.seed, self._devices, self._agenda, self._report)

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        """Takes a command or an update; BadMessage when the item or its device does not."""
        read = topics.read(message, now)
        time = self._begin(now)
        name, text = read.levels["item"], read.payload
        try:
            if name not in self._items:
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

    def _begin(self, now: float) -> float:
        """The home's time; the first time it is asked for, the home wakes up and says all its states."""
        time = self._agenda.time(now)
        if not self._awake:
            self._awake = True
            self._life.begin(time)
            for name in self._items:
                self._state(name, self._devices.get(name, "NULL"))
        return time

    def _flush(self) -> list[Message]:
        said, self._said = self._said, []
        self.due = self._agenda.due
        return said

    def _is_shutter(self, name: str) -> bool:
        return base_type(self._items[name].type) == "Rollershutter"

    def _state(self, name: str, text: str) -> None:
        if self._states.get(name) != text:
            self._states[name] = text
            self._said.append(topics.HOME_STATE.message(text, item=name))

    def _report(self, name: str, text: str) -> None:
        """A device says something new."""
        if self._devices[name] != text:
            self._devices[name] = text
            self._state(name, text)

    def _set(self, name: str, text: str) -> None:
        """Posts an update: believed, and unknown to the device, whose next report corrects it."""
        item = self._items[name]
        check_state(item.type, text)
        self._state(name, kept(item, self._states[name], text, self._zone))
        self.counters["updates"] += 1

    def _command(self, name: str, command: str, time: float) -> None:
        item = self._items[name]
        check_command(item.type, command)
        if command != "REFRESH":
            if not item.takes_commands:
                raise BadMessage("it is read only; use `set` to post an update")
            if name in self._devices:
                self._move(name, command, time)
            guess = predicted(item, self._states[name], command, self._zone)
            if guess is not None:
                self._state(name, guess)
        self.counters["commands"] += 1
        if name in self._devices and name not in self._following:
            self._agenda.at(time + self._draw.uniform(*LAG_S), partial(self._answer, name))
            if name in self._shutters:
                self._following.add(name)

    def _move(self, name: str, command: str, time: float) -> None:
        """The device does it at once; it tells so later."""
        if name in self._shutters:
            self._shutters[name].command(command, time)
        else:
            self._devices[name] = answer(self._items[name], self._devices[name], command, self._zone)

    def _answer(self, name: str, time: float) -> None:
        """The device reports what it is at by now; a shutter again until it has arrived."""
        if shutter := self._shutters.get(name):
            self._devices[name] = plain(float(round(shutter.at(time))))
            if shutter.moving(time):
                self._agenda.at(time + SHUTTER_REPORT_S, partial(self._answer, name))
            else:
                self._following.discard(name)
        self._state(name, self._devices[name])
        self._life.settle(name, time)
