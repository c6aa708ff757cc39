"""The camera service as the runner drives it, against a simulated camera on the network (loopback), in real time."""

from __future__ import annotations

import json
import queue
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx

from services import camera as real
from services import simulators
from services.bus import Message
from services.camera.service import CameraService
from services.errors import BadMessage
from services.simulators import camera as simulated
from services.simulators.world import World, load

SHIPPED = Path(simulators.__file__).parents[2] / "config"
PASSWORD = "secret123"


@dataclass
class Bench:
    """One service and one simulated camera; `turn` is the runner's."""

    service: CameraService
    inbox: queue.Queue[Message]
    camera: simulated.Simulated
    world: World
    said: list[Message] = field(default_factory=list)

    def until(self, happened: Callable[[], bool], limit_s: float) -> None:
        end = time.monotonic() + limit_s
        while not happened():
            assert time.monotonic() < end, f"not within {limit_s} s: {[m.payload[:300] for m in self.said[-3:]]}"
            self.turn()

    def turn(self) -> None:
        due = self.service.due or 0.0
        try:
            message = self.inbox.get(timeout=min(0.5, max(0.0, due - time.time())) or 0.001)
        except queue.Empty:
            pass
        else:
            with suppress(BadMessage):
                self.said += self.service.handle(message, time.time())
        self.said += self.service.tick(time.time())

    def order(self, key: str, value: Any, order_id: str) -> None:
        payload = json.dumps({"value": value, "id": order_id}).encode()
        self.inbox.put(Message(f"camera/ip1/order/{key}", payload, received=time.time()))

    def look(self, order_id: str, **readings: float) -> None:
        payload = json.dumps({**readings, "id": order_id}).encode()
        self.inbox.put(Message("camera/ip1/position/set", payload, received=time.time()))

    def payloads(self, topic: str) -> list[Any]:
        return [json.loads(one.payload) for one in self.said if one.topic == f"camera/ip1/{topic}"]

    def end_of(self, order_id: str, limit_s: float) -> dict[str, Any]:
        def last() -> dict[str, Any] | None:
            ends = ("done", "failed", "refused", "cancelled")
            results = self.payloads("order_result")
            return next((one for one in results if one["id"] == order_id and one["state"] in ends), None)

        self.until(lambda: last() is not None, limit_s)
        found = last()
        assert found is not None
        return found

    def truth(self) -> dict[str, Any]:
        state: dict[str, Any] = httpx.get(f"{self.camera.side_door_url}/state", timeout=30).json()
        return state

    def tell(self, path: str, **content: object) -> None:
        httpx.post(f"{self.camera.side_door_url}/{path}", json=content, timeout=30).raise_for_status()


def settings(camera: simulated.Simulated, folder: Path, world: World, **changes: Any) -> real.Config:
    """The camera's section as a user writes it, with the true mount."""
    values = {
        "name": "ip1",
        "folder": folder,
        "url": camera.url,
        "user": "ros",
        "password": PASSWORD,
        "camera_info": "ip1/ost.yaml",
        "places": "ip1",
        "targets": [582],
        "markers": {"size": 0.14, "sizes": {17: 0.10, 100: 0.12}},
        "mount": world.cameras["ip1"].mount.model_dump(),
        **changes,
    }
    return real.Config.model_validate(values)


@contextmanager
def simulator(**changes: Any) -> Iterator[simulated.Simulated]:
    """A simulated camera with the shipped apartment."""
    config = simulated.Config.model_validate({"folder": SHIPPED, "user": "ros", "password": PASSWORD, **changes})
    with simulated.start(config) as camera:
        yield camera


@contextmanager
def bench(folder: Path, camera: simulated.Simulated, **changes: Any) -> Iterator[Bench]:
    """The service for that camera, online."""
    if not (folder / "ip1").exists():
        shutil.copytree(SHIPPED / "ip1", folder / "ip1")
    world = load(SHIPPED / "world.yaml")
    inbox: queue.Queue[Message] = queue.Queue()
    with real.start(settings(camera, folder, world, **changes), inbox.put) as service:
        here = Bench(service, inbox, camera, world)
        here.until(lambda: service.health.online, 10)
        yield here
