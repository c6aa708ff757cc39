"""The process for pictures: a ROS node of its own, so that pixels never delay a message. Here is what it does inside.

It has the cameras' topics and the map, and hears from the bridge where the streams are. How it is started and kept
running: `pictures.py`.
"""

from __future__ import annotations

import logging
import os
import signal
import threading
from multiprocessing.connection import Connection

from services.bridge import images, mapfile, viewer
from services.bridge.hatch import Done, Told, Wanted
from services.bridge.node import CALLED, Call, Outlet, Ports, Server
from services.bridge.ros import RosNode
from services.bridge.rules import Fields
from services.bridge.viewer import Viewer
from services.bus import Message

MAP, META, STATIC_MAP = "/map", "/map_metadata", "/static_map"
LEAVE_S = 2.0  # saying goodbye to a master that may hang
LOG_FORMAT = "%(asctime)s.%(msecs)03d %(levelname)-7s %(name)s: %(message)s"

log = logging.getLogger(__name__)


def run(wanted: Wanted, connection: Connection, every_s: float) -> None:
    """The whole life of the process: until the bridge closes its end, or dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is meant for the bridge, which tells us
    signal.signal(signal.SIGTERM, lambda *_: os._exit(0))
    logging.basicConfig(level=logging.INFO, format=LOG_FORMAT, datefmt="%Y-%m-%dT%H:%M:%S")
    images.one_thread()
    grid = mapfile.load(wanted.map) if wanted.map else None
    links: list[Message] = []
    node = RosNode(wanted.node, wanted.master_uri, _ports(wanted, grid), lambda said: _posted(said, grid, links))
    if grid is not None:
        node.publish(MAP, grid)
        node.publish(META, grid["info"])
    viewers = {cam: Viewer(cam, prefix, lens, node) for cam, (prefix, lens) in wanted.cameras.items()}
    stopping = threading.Event()
    threading.Thread(
        target=_report, args=(wanted.node, connection, viewers, links, stopping, every_s), daemon=True
    ).start()
    _listen(connection, viewers)
    stopping.set()
    for one in viewers.values():
        one.end()
    leaving = threading.Thread(target=node.close, daemon=True)
    leaving.start()
    leaving.join(LEAVE_S)
    os._exit(0)  # threads of rospy would hold up the end


def _listen(connection: Connection, viewers: dict[str, Viewer]) -> None:
    try:
        while isinstance(told := connection.recv(), Told):
            viewers[told.cam].zoom = told.zoom
            viewers[told.cam].tell(told.url)
    except (EOFError, OSError):  # the bridge has ended
        return


def _report(
    node: str,
    connection: Connection,
    viewers: dict[str, Viewer],
    links: list[Message],
    stopping: threading.Event,
    every_s: float,
) -> None:
    """A thread's body."""
    while not stopping.wait(every_s):
        link = links[-1].value if links else None
        if getattr(link, "ended", False):
            log.error("%s: %s", node, getattr(link, "text", ""))
            os._exit(1)  # the bridge starts another
        shown, decoded = (sum(getattr(one, name) for one in viewers.values()) for name in ("shown", "decoded"))
        try:
            connection.send(Done(shown, decoded, getattr(link, "text", "not yet"), bool(getattr(link, "up", False))))
        except OSError:
            return


def _ports(wanted: Wanted, grid: Fields | None) -> Ports:
    outlets = [outlet for prefix, _ in wanted.cameras.values() for outlet in viewer.outlets(prefix)]
    if grid is None:
        return Ports(tuple(outlets))
    maps = (Outlet(MAP, "nav_msgs/OccupancyGrid", latch=True), Outlet(META, "nav_msgs/MapMetaData", latch=True))
    return Ports((*outlets, *maps), servers=(Server(STATIC_MAP, "nav_msgs/GetMap"),))


def _posted(said: Message, grid: Fields | None, links: list[Message]) -> None:
    """On threads of rospy and the registrar: calls are answered at once, news of the link kept."""
    if said.topic == CALLED + STATIC_MAP and isinstance(said.value, Call):
        said.value.answer({"map": grid or {}})
    else:
        links[:] = [said]
