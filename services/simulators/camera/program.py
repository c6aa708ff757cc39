"""Starts one simulated camera: its configuration, its two ports, and its end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from socketserver import BaseServer
from threading import Event, Thread

from pydantic import Field, SecretStr, field_validator

from services.errors import ConfigError
from services.section import Section
from services.simulators.camera.device import Device
from services.simulators.camera.digest import Door
from services.simulators.camera.http import CameraServer
from services.simulators.camera.picture import Pictures
from services.simulators.camera.profiles import PROFILES
from services.simulators.camera.scene import Scene
from services.simulators.camera.side_door import SideDoor
from services.simulators.world import World, load

POLL_S = 0.1  # how long a port may take to notice that it is to close


class Config(Section):
    """A simulated camera; ports may be 0 for any free one."""

    folder: Path = Path()  # given by the configuration: what `world` is relative to
    world: Path = Path("world.yaml")
    camera: str = "ip1"  # which one of the world's cameras
    host: str = "127.0.0.1"
    port: int = Field(default=0, ge=0, le=65535)
    side_door_port: int = Field(default=0, ge=0, le=65535)
    user: str = "ros"
    password: SecretStr = SecretStr("")
    profile: str = "ip3m-941w-2019"
    latency_s: float | None = Field(default=None, ge=0)  # of each request; None: the profile's
    seed: int = 1  # of textures, noise and nonces

    @field_validator("profile")
    @classmethod
    def is_known(cls, name: str) -> str:
        if name not in PROFILES:
            raise ValueError(f"expected one of {', '.join(PROFILES)}, got {name!r}")
        return name


@dataclass(frozen=True)
class Simulated:
    """Where a running simulated camera is."""

    url: str
    port: int
    side_door_port: int
    rtsp_port: int | None
    server: CameraServer

    @property
    def side_door_url(self) -> str:
        return f"http://127.0.0.1:{self.side_door_port}"


@contextmanager
def start(config: Config, *, clock: Callable[[], float] = time.time) -> Iterator[Simulated]:
    """Runs a camera in threads of this process until the context ends. ConfigError: no such world or camera."""
    world = load(config.folder / config.world)
    if config.camera not in world.cameras:
        raise ConfigError([f"camera: expected one of {', '.join(world.cameras)}, got {config.camera!r}"])
    with ExitStack() as stack:
        server = _server(config, world, clock)
        stack.callback(server.server_close)
        stack.callback(server.switch_off)
        stack.enter_context(_served(server))
        side = SideDoor(("127.0.0.1", config.side_door_port), server)
        stack.callback(side.server_close)
        stack.enter_context(_served(side))
        port = server.server_address[1]
        yield Simulated(f"http://{config.host}:{port}", port, side.server_address[1], None, server)


def serve(config: Config, ready: Callable[[Simulated], None], stopped: Event) -> None:
    """Runs a camera until `stopped` is set; `ready` is told where it is. The command `simulate camera`."""
    with start(config) as camera:
        ready(camera)
        stopped.wait()


def _server(config: Config, world: World, clock: Callable[[], float]) -> CameraServer:
    camera, profile = world.cameras[config.camera], PROFILES[config.profile]
    device = Device(camera, profile, clock())
    realm, password = f"Login to {camera.serial}", config.password.get_secret_value()
    door = Door(realm, config.user, password, profile, Random(config.seed))
    pictures = Pictures(Scene(world, camera.lens, config.seed), camera, device.tables, device.motion, config.seed)
    server = CameraServer((config.host, config.port), device, door, pictures, clock)
    if config.latency_s is not None:
        server.latency_s = config.latency_s
    return server


@contextmanager
def _served(server: BaseServer) -> Iterator[None]:
    thread = Thread(target=server.serve_forever, args=(POLL_S,), name=type(server).__name__)
    thread.start()
    try:
        yield
    finally:
        server.shutdown()
        thread.join()
