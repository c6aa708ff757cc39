"""What `apartment scan --plot` draws: the rooms, the places in the order of their visits, and the results of a scan.

Not here: the order and its answers (`scan.py`), the drawing (`vision/chart.py`). Where markers truly are is known
of a simulated camera only, from its world's file; the camera's service never sees that.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from services import camera, topics
from services.bus import Message
from services.command_line.scan import newest
from services.config import Apartment
from services.payloads import Places, ScanResult, ScanState
from services.simulators import camera as simulated
from services.simulators.world import World, load
from services.topics import read
from services.vision import chart
from services.vision.chart import Mark, Plan
from services.vision.frames import Mount

NOWHERE = Mount((0.0, 0.0, 2.5))


def plot(apartment: Apartment, name: str, heard: Iterable[Message], file: Path, world: Path | None) -> None:
    """Draws a scan of the camera from what was heard of it, and writes the picture; OSError when that cannot be.

    `world` None: the simulated one's, where the configuration has a simulated camera, or else no rooms.
    """
    config = apartment.instances[f"camera-{name}"].config
    assert isinstance(config, camera.Config)
    simulator = _simulator(apartment, name)
    path = world or (simulator.folder / simulator.world if simulator else None)
    known = load(path) if path is not None else None
    mount = config.mount.mount() if config.mount else NOWHERE
    payloads = [read(message, message.received).payload for message in heard]
    file.write_bytes(chart.png(chart.draw(_plan(name, mount, payloads, known, simulated=simulator is not None))))


def _simulator(apartment: Apartment, name: str) -> simulated.Config | None:
    for instance in (f"simulated-camera-{name}", "simulated-camera"):
        found = apartment.instances.get(instance)
        if found is not None and isinstance(found.config, simulated.Config):
            return found.config
    return None


def _plan(name: str, mount: Mount, payloads: list[object], world: World | None, *, simulated: bool) -> Plan:
    results = newest(payloads)
    states = [one for one in payloads if isinstance(one, ScanState) and one.scan]
    places = next((one.root for one in payloads if isinstance(one, Places)), {})
    last = states[-1] if states else ScanState(state="done")
    visited = list(dict.fromkeys(one.place for one in states if one.place))
    order = [*visited, *(place for place in places if place not in visited)]
    true = {one.id: one.position[:2] for one in world.markers} if world and simulated else {}
    targets = dict.fromkeys([*results, *(one for one in last.targets if one in true)])
    title = (
        f"{name}: {len(results)} of {len(last.targets)} found, {last.frames_analysed} frames, {last.elapsed_s:.1f} s"
    )
    return Plan(
        title=title,
        rooms={one.label: one.polygon for one in world.rooms.values()} if world else {},
        walls=[(one.start, one.end) for one in world.walls] if world else [],
        mount=mount,
        places={place: (places[place].pan, places[place].tilt) for place in order if place in places},
        marks=[_mark(marker, results.get(marker), true.get(marker)) for marker in targets],
    )


def _mark(marker: int, result: ScanResult | None, true: tuple[float, float] | None) -> Mark:
    if result is None or result.position is None:
        return Mark(marker, true=true)
    covariance = np.array(result.covariance or np.zeros((3, 3)), float)[:2, :2]
    return Mark(marker, (result.position.x, result.position.y), covariance, true)


HEARD = (topics.CAMERA_SCAN_RESULT, topics.CAMERA_SCAN_STATE, topics.CAMERA_PLACES)
