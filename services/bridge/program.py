"""Puts the bridge together: the rules, the node, the parts. What it does is in `service.py`."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path

from services import __version__
from services.apartment import robot_places
from services.apartment.robot_places import Relation
from services.bridge import arguments, mapfile, messages, robots, rulebook
from services.bridge.confirm import Confirm
from services.bridge.hatch import Wanted
from services.bridge.items import Items
from services.bridge.lenses import Lenses
from services.bridge.missions import Missions
from services.bridge.node import Outlet, Ports, ports
from services.bridge.part import Part
from services.bridge.pictures import Pictures
from services.bridge.robots import Where
from services.bridge.ros import RosNode
from services.bridge.rules import Rule
from services.bridge.service import Bridge
from services.bridge.settings import Config
from services.bridge.simulated import SimulatedNode
from services.bridge.snapshots import Snapshots
from services.bridge.tree import Tree
from services.errors import ConfigError
from services.runner import Post


def check(config: Config) -> None:
    """ConfigError with every fault of the rules; their types are checked where ROS is installed."""
    known = _types(config) if importlib.util.find_spec("genpy") else rulebook.unchecked
    faults: list[str] = []
    loads: list[Callable[[], object]] = [
        lambda: rulebook.load(config.folder / config.rules, config.cameras, known),
        lambda: _relation(config),
        lambda: mapfile.load(shown) if (shown := _map(config)) else None,
        *(partial(robots.check, one, config.folder) for one in config.robots.values()),
    ]
    for load in loads:
        try:
            load()
        except ConfigError as error:
            faults += error.faults
    if faults:
        raise ConfigError(faults)


@contextmanager
def start(config: Config, post: Post) -> Iterator[Bridge]:
    """The service with its node; ConfigError when the rules cannot be used, or ROS is not installed."""
    rules = rulebook.load(config.folder / config.rules, config.cameras, _types(config))
    parts = _parts(config)
    with closing(_node(config, _all_ports(config, rules, parts), post)) as node:
        try:
            yield Bridge(config.home, rules, node, parts)
        finally:
            for part in parts:
                part.close()


def _types(config: Config) -> rulebook.Check:
    return rulebook.unchecked if config.simulated else messages.faults


def _parts(config: Config) -> tuple[Part, ...]:
    parts: list[Part] = [Items(config.home), Confirm()]
    if config.cameras:
        mounts = {cam: one.mount for cam, one in config.camera_sections.items() if one.mount is not None}
        snapshots = config.state / "snapshots" if config.state else None
        parts += [Tree(config.cameras, mounts, _relation(config)), Snapshots(config.cameras, snapshots)]
        parts.append(Lenses(config.cameras))
    if config.robot is not None:
        parts.append(Missions(config.robot))
    if not config.simulated:  # without ROS the robot is on the bus itself
        where = Where(arguments.name(config.node), config.master_uri, config.folder, config.state)
        parts += [robots.part(name, one, where) for name, one in config.robots.items()]
    if not config.simulated and (config.cameras or _map(config)):
        parts.append(Pictures(_wanted(config)))
    return tuple(parts)


def _wanted(config: Config) -> Wanted:
    """What the process for pictures is to do."""
    files = {cam: one.camera_info for cam, one in config.camera_sections.items() if one.camera_info is not None}
    cameras = {
        cam: ("" if cam == config.cameras[0] else f"/{cam}", config.folder / files[cam] if cam in files else None)
        for cam in config.cameras
    }
    return Wanted(f"{arguments.name(config.node)}_pictures", config.master_uri, cameras, _map(config))


def _relation(config: Config) -> Relation:
    """Where the apartment lies in the robot's map; its own origin where nobody says."""
    if config.places is None:
        return Relation()
    return robot_places.places(config.folder / config.places).apartment_to_map


def _map(config: Config) -> Path | None:
    """The map that is shown: the bridge's own, else the robot's."""
    if config.map is not None or config.places is None:
        return config.folder / config.map if config.map else None
    file = config.folder / config.places
    named = robot_places.places(file).map
    return file.parent / named if named else None


def _all_ports(config: Config, rules: tuple[Rule, ...], parts: tuple[Part, ...]) -> Ports:
    own = ports(rules)
    more = [part.ports for part in parts]
    array = Outlet(rulebook.DIAGNOSTICS, "diagnostic_msgs/DiagnosticArray")
    return Ports(
        (*own.outlets, array, *(outlet for one in more for outlet in one.outlets)),
        (*own.inlets, *(inlet for one in more for inlet in one.inlets)),
        tuple(server for one in more for server in one.servers),
        {f"/{config.node}/version": __version__, f"/{config.node}/cameras": list(config.cameras),
         f"/{config.node}/items": {name: item.type for name, item in config.home.ros_items.items()}},
    )  # fmt: skip


def _node(config: Config, all_ports: Ports, post: Post) -> SimulatedNode | RosNode:
    if config.simulated:
        return SimulatedNode(all_ports, post)
    return RosNode(arguments.name(config.node), config.master_uri, all_ports, post)
