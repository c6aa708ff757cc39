"""What a site's files are made of: the home, its cameras, the broker, and what else was asked for. Pure.

Not here: the configuration that it comes from; the command line passes plain values.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from services.apartment.home import GROUP_ROS, Home
from services.openhab.lines import identifier, unique
from services.openhab.versions import Version
from services.openhab.words import THING_WORDS

BusDesign = Literal["dsl", "js", "links"]
ALL = "All"  # the report's group of everything, which has ROS for a child
STATUS_ITEM = "ROS_Status"
BUS = "bus"  # the thing of the bus without rules


@dataclass(frozen=True)
class Camera:
    """A camera as OpenHAB shows it; the addresses are those of our proxy, None where it has no fixed one."""

    name: str
    places: tuple[str, ...] = ()
    targets: tuple[int, ...] = ()
    stream_url: str | None = None
    snapshot_url: str | None = None

    @property
    def label(self) -> str:
        """What people read."""
        return f"Camera {self.name}"


@dataclass(frozen=True)
class Broker:
    """The broker as OpenHAB reaches it; its thing is `mqtt:broker:<id>`."""

    host: str = "127.0.0.1"
    port: int = 1883
    secure: bool = False
    id: str = "apartment"
    public_key: str | None = None  # its hash, where it is known: `SHA-256:...`

    @property
    def uid(self) -> str:
        """Of the bridge thing."""
        return f"mqtt:broker:{self.id}"


@dataclass(frozen=True)
class Site:
    """Everything that the files are made of. `taken`: names and UIDs that files of others define, left out of ours."""

    home: Home
    version: Version
    cameras: tuple[Camera, ...] = ()
    broker: Broker = Broker()
    bus: BusDesign = "dsl"
    persistence: str | None = "jdbc"
    taken: frozenset[str] = field(default=frozenset())

    @cached_property
    def names(self) -> Names:
        """The names of what the home does not name itself."""
        return Names(self)


class Names:
    """Names of groups for rooms and things, and of a camera's items: none twice, none that the home has."""

    def __init__(self, site: Site) -> None:
        self._used = {*site.home.items, *site.home.groups, GROUP_ROS, ALL, STATUS_ITEM}
        self.rooms = {key: self._new(f"gRoom_{identifier(key)}") for key in site.home.rooms}
        self.things = {key: self._new(f"gThing_{identifier(key)}") for key in site.home.things}
        self.devices = self._device_ids(site)
        self._cameras = {camera.name: self._camera(camera.name) for camera in site.cameras}

    def _device_ids(self, site: Site) -> dict[str, str]:
        """The last parts of the UIDs of plain MQTT devices."""
        used = {BUS, *(f"camera_{camera.name}" for camera in site.cameras)}
        found: dict[str, str] = {}
        for key in site.home.things:
            found[key] = unique(identifier(key), used | THING_WORDS)
            used.add(found[key])
        return found

    def _new(self, wanted: str) -> str:
        name = unique(wanted, self._used)
        self._used.add(name)
        return name

    def _camera(self, camera: str) -> str:
        """A beginning that no other name has."""
        start = f"{camera[0].upper()}{camera[1:]}"
        while any(name == start or name.startswith(f"{start}_") for name in self._used):
            start = f"{start}_"
        self._used.add(start)
        return start

    def camera(self, camera: str, part: str = "") -> str:
        """The name of a camera's group, or of one of its items."""
        return f"{self._cameras[camera]}_{part}" if part else self._cameras[camera]
