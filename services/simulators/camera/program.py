"""Starts one simulated camera: its ports, and its end. Its settings are in `settings`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from random import Random
from socketserver import BaseServer
from threading import Thread

from services.errors import ConfigError
from services.simulators.camera import rtsp
from services.simulators.camera.device import Device
from services.simulators.camera.digest import Door, realm
from services.simulators.camera.http import CameraServer
from services.simulators.camera.latency import Latency
from services.simulators.camera.onvif.service import Onvif
from services.simulators.camera.settings import Config
from services.simulators.camera.side_door import SideDoor
from services.simulators.camera.view.picture import Pictures
from services.simulators.camera.view.scene import Scene
from services.simulators.world import load

WATCH_S = 0.1  # between two looks of the motion detection
POLL_S = 0.1  # how long a port may take to notice that it is to close


@dataclass(frozen=True)
class Inside:
    """What a camera is made of behind its wire."""

    device: Device
    door: Door
    pictures: Pictures


@dataclass(frozen=True)
class Simulated:
    """Where a running simulated camera is."""

    url: str
    port: int
    side_door_port: int
    rtsp_port: int | None
    server: CameraServer

    @property
    def addresses(self) -> dict[str, str | int]:
        """What a program that attaches wants to know."""
        ports = {"port": self.port, "side_door_port": self.side_door_port}
        return {"url": self.url, **ports, **({} if self.rtsp_port is None else {"rtsp_port": self.rtsp_port})}

    @property
    def side_door_url(self) -> str:
        """Where the tests' way in is."""
        return f"http://127.0.0.1:{self.side_door_port}"


@contextmanager
def start(config: Config, *, clock: Callable[[], float] = time.time) -> Iterator[Simulated]:
    """Runs a camera in threads of this process until the context ends. ConfigError: no such world or camera."""
    with ExitStack() as stack:
        server = _server(config, clock)
        stack.callback(server.server_close)
        stack.callback(server.switch_off)
        stack.enter_context(_served(server))
        stack.enter_context(_watching(server))
        side = SideDoor(("127.0.0.1", config.side_door_port), server)
        stack.callback(side.server_close)
        stack.enter_context(_served(side))
        port, live = server.server_address[1], stack.enter_context(rtsp.served(server, config.rtsp_port))
        if live is not None:
            server.device.tables.fix("RTSP.Port", str(live.port))
        rtsp_port = live.port if live else None
        if server.onvif is not None:
            server.onvif.rtsp_port = rtsp_port
        yield Simulated(f"http://{config.host}:{port}", port, side.server_address[1], rtsp_port, server)


def inside(config: Config, now: float) -> Inside:
    """A camera without its network. ConfigError: no such world or camera."""
    world = load(config.folder / config.world)
    if config.camera not in world.cameras:
        raise ConfigError([f"camera: expected one of {', '.join(world.cameras)}, got {config.camera!r}"])
    camera, profile = world.cameras[config.camera], config.switches
    device = Device(camera, profile, now, Latency(profile, config.latency_s, Random(config.seed)))
    password = config.password.get_secret_value()
    door = Door(realm(profile, camera.serial), config.user, password, profile, Random(config.seed))
    scene = Scene(world, camera.lens, config.seed)
    pictures = Pictures(scene, camera, device.tables, device.motion, device.rest, config.seed)
    return Inside(device, door, pictures)


def _server(config: Config, clock: Callable[[], float]) -> CameraServer:
    behind = inside(config, clock())
    server = CameraServer((config.host, config.port), behind.device, behind.door, behind.pictures, clock)
    if behind.device.profile.onvif:
        server.onvif = Onvif(behind.device, config.user, config.password.get_secret_value())
    return server


@contextmanager
def _watching(server: CameraServer) -> Iterator[None]:
    """Looks for motion while the camera runs."""

    def watch() -> None:
        while not server.closing.wait(WATCH_S):
            server.device.watch(server.clock())

    thread = Thread(target=watch, name="motion detection")
    thread.start()
    try:
        yield
    finally:
        server.closing.set()
        thread.join()


@contextmanager
def _served(server: BaseServer) -> Iterator[None]:
    thread = Thread(target=server.serve_forever, args=(POLL_S,), name=type(server).__name__)
    thread.start()
    try:
        yield
    finally:
        server.shutdown()
        thread.join()
