"""Every service of a configuration on one memory bus, driven by one clock that jumps to what is due next."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, ExitStack, nullcontext
from pathlib import Path
from typing import Any, Self

from services import camera
from services.aside import Aside
from services.bus.memory import Hub, MemoryBus
from services.camera.address import Address
from services.camera.brands.amcrest import Amcrest
from services.camera.calibration.study import Studio
from services.camera.program import eye
from services.camera.scan.analysis import Inline
from services.camera.service import CameraService
from services.camera.web.gate import Gate
from services.client import Client
from services.config import Instance, load
from services.payloads import OrderResult, PositionSet
from services.runner import Post, Runner
from services.simulators.camera.program import Inside, inside
from services.simulators.camera.settings import Config as CameraSimulator
from services.topics import CAMERA_ORDER_RESULT, CAMERA_STATUS, SERVICE_STATUS, read
from services.virtual.film import Film
from services.virtual.link import Lane, Link
from services.virtual.wire import Wire

READY_S = 60.0
START = 1_768_000_000.0  # a January morning; only the simulated weather cares


class VirtualApartment(AbstractContextManager["VirtualApartment"]):
    """`now` is the only clock; `client` hears everything."""

    def __init__(self, config: Path, environment: Mapping[str, str]) -> None:
        self.now = START
        self.hub = Hub(self.clock)
        self.apartment = load(config, environment=environment)
        self.client = Client(MemoryBus(self.hub))
        self.client.subscribe("#")
        self.links: list[Link] = []
        self.insides: dict[str, Inside] = {}  # by camera: what is true of it
        self.films: dict[str, Film] = {}
        self._stack = ExitStack()
        instances = self.apartment.instances.values()
        self.runners = [
            self._runner(one) for one in instances if one.row.on_bus and one.name != "dashboard"
        ]  # nobody looks at virtual time

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def __enter__(self) -> Self:
        """Lets time pass until every camera is online; TimeoutError after READY_S of it."""
        if not self.until(lambda: all(map(self._online, self.apartment.cameras)), READY_S):
            raise TimeoutError(f"the cameras are not online after {READY_S:.0f} s of virtual time")
        return self

    def _online(self, camera_name: str) -> bool:
        said = self.hub.retained.get(CAMERA_STATUS.name(cam=camera_name))
        return said is not None and read(said, self.now).payload.state == "online"

    def clock(self) -> float:
        """Seconds since 1970, here."""
        return self.now

    def until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Lets time pass until the condition holds, at most so long; whether it held."""
        end = self.now + seconds
        while not condition():
            self._settle()
            due = min([end, *(runner.due for runner in self.runners), *(link.due for link in self.links)])
            if due >= end:
                self.now = end
                return condition()
            self.now = max(self.now, due)
            for link in self.links:
                link.deliver(self.now)
        return True

    def order(self, camera_name: str, key: str, value: str = "", seconds: float = 600.0) -> OrderResult | None:
        """Gives a camera an order and lets time pass until its end; None when it has none."""
        return self._ordered(camera_name, key, f"camera/{camera_name}/order/{key}", value, seconds)

    def look(self, camera_name: str, seconds: float = 600.0, **axes: float) -> OrderResult | None:
        """Sends a camera to readings (pan, tilt, zoom) and lets time pass until it is there; None when it never is."""
        topic = f"camera/{camera_name}/position/set"
        return self._ordered(camera_name, "Position", topic, PositionSet(**axes).model_dump_json(), seconds)

    def _ordered(self, camera_name: str, key: str, topic: str, payload: str, seconds: float) -> OrderResult | None:
        self.client.forget()
        answer = CAMERA_ORDER_RESULT.name(cam=camera_name)
        ended: list[OrderResult] = []

        def over() -> bool:
            answers = [read(message, self.now).payload for message in self.client.pump() if message.topic == answer]
            ended.extend(one for one in answers if one.final and one.key == key)
            return bool(ended)

        self.client.say(topic, payload)
        return ended[0] if self.until(over, seconds) else None

    def restart(self, name: str) -> None:
        """A service dies without a word and is begun anew, as the supervisor would do it; a camera's motors go on."""
        index = next(at for at, runner in enumerate(self.runners) if runner.name == name)
        dead = self.runners[index].bus
        assert isinstance(dead, MemoryBus)
        dead.lose()
        self.hub.clients.remove(dead)
        self.runners[index] = self._runner(self.apartment.instances[name])

    def _settle(self) -> None:
        """Turns until nobody has anything to do at this moment."""
        busy = True
        while busy:
            busy = sum(runner.turn() for runner in self.runners) > 0

    def _runner(self, instance: Instance) -> Runner:
        birth, will = (SERVICE_STATUS.message(text, service=instance.name) for text in ("online", "offline"))
        bus = MemoryBus(self.hub, birth, will, durable=instance.row.durable)
        service = self._stack.enter_context(self._start(instance, bus.post))
        return Runner(instance.name, service, bus, self.clock, Aside())

    def _start(self, instance: Instance, post: Post) -> AbstractContextManager[Any]:
        if isinstance(instance.config, camera.Config):
            return nullcontext(self._camera(instance.config, post))
        started: AbstractContextManager[Any] = importlib.import_module(instance.row.module).start(instance.config, post)
        return started

    def _camera(self, config: camera.Config, post: Post) -> CameraService:
        """The service as it is, on a wire to the simulated camera of this configuration."""
        simulator = self.apartment.instances["simulated-camera"].config
        assert isinstance(simulator, CameraSimulator)
        behind = inside(simulator, self.now)
        gate = Gate(clock=self.clock, pause=lambda seconds: None)
        link = Link(*(self._lane(behind, config.address, post, gate) for _ in range(2)))
        self.links.append(link)
        sender = Studio(link, post, self.clock, at_once=True)
        service = CameraService(config, sender, lambda: Inline(post), eye(config))
        self.insides[config.name] = behind
        if simulator.rtsp_port is not None:
            service.scanner.moving = self.films[config.name] = Film(behind, self.clock)
        return service

    def _lane(self, behind: Inside, address: Address, post: Post, gate: Gate) -> Lane:
        wire = Wire(behind)
        return Lane(Amcrest(address, wire, gate), wire, post, self.clock)
