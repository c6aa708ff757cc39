"""The node over rospy: topics made on a thread of their own, and registered again at every new ROS master.

rospy's traps are met here, each where it bites: registration (`services/ros/master.py`), Python's logging
(`services/ros/node.py`), the writing of what is published (`outgoing.py`). Not here: what a message
means (`rules.py`, `messages.py`).
"""

from __future__ import annotations

import importlib
import logging
import os
import queue
import threading
import time
from functools import partial
from typing import Any

from services.bridge import arguments, definitions, messages, reach
from services.bridge.doubled import doubled
from services.bridge.latched import Latched
from services.bridge.node import ANY, CALL_S, CALLED, FROM_ROS, LINK, Call, Inlet, Link, Outlet, Ports, Say, Server
from services.bridge.outgoing import Outgoing
from services.bridge.rules import Fields
from services.bridge.simtime import SimulatedTime
from services.bus import Message
from services.errors import ConfigError, Unavailable
from services.ros import node as ros_node
from services.ros.master import Master, register, rival
from services.runner import Post

POLL_S = 0.5  # of the master's pid; a new master knows us again within this time and some milliseconds
LEAVE_S = 2.0  # saying goodbye to a master that hangs must not hold up our end
LARGE = 2**24  # bytes; rospy drops older pictures only when they fit into its buffer together
PACKAGES = (
    "python3-rospy python3-diagnostic-msgs python3-geometry-msgs python3-sensor-msgs python3-std-srvs "
    "python3-tf2-msgs python3-nav-msgs python3-actionlib-msgs"
)

log = logging.getLogger(__name__)


class RosNode:
    """One per process: rospy's node cannot be started again in the same one.

    `publish` works before the master is there: what replay and latch keep is sent to those who come.
    """

    def __init__(self, name: str, master_uri: str | None, ports: Ports, post: Post) -> None:
        arguments.hand_to_rospy(name)
        self._rospy = _rospy()
        if master_uri is not None:
            os.environ["ROS_MASTER_URI"] = master_uri
        rosgraph = importlib.import_module("rosgraph")
        self._name = name
        caller = rosgraph.names.resolve_name(name, rosgraph.names.make_caller_id("unnamed"))
        self._master = Master(rosgraph.get_master_uri() or "http://localhost:11311", caller)
        self._ports = ports
        self._outlets = {outlet.topic: outlet for outlet in ports.outlets}
        self._classes = {outlet.topic: _class(outlet) for outlet in ports.outlets}
        self._outgoing = {outlet.topic: Outgoing(outlet.queue) for outlet in ports.outlets}
        self._post = post
        self._clock = SimulatedTime(self._rospy)
        self._latched = Latched()
        self._opened = False
        self._stopping = threading.Event()
        self._registered_with: int | None = None
        self._link = Link(up=False, text="not yet")
        self._registrar = threading.Thread(target=self._register, name="ros-registrar", daemon=True)
        self._registrar.start()

    def prepare(self, topic: str, fields: Fields, key: str = "") -> Say:
        """See `Node`."""
        outlet = self._outlets[topic]
        message = messages.build(self._classes[topic], fields)
        self._clock.move(message)
        kept = (key if outlet.replay else "") if outlet.replay or outlet.latch else None
        return partial(self._outgoing[topic].say, messages.on_the_wire(message), kept)

    def publish(self, topic: str, fields: Fields, key: str = "") -> None:
        """See `Node`."""
        self.prepare(topic, fields, key)()

    def flush(self) -> None:
        """See `Node`."""
        for outgoing in self._outgoing.values():
            outgoing.flush()

    def refresh(self) -> None:
        """See `Node`."""
        for topic, outlet in self._outlets.items():
            if outlet.replay:
                self._outgoing[topic].again()

    def listeners(self, topic: str) -> int:
        """See `Node`."""
        return self._outgoing[topic].listeners

    def close(self) -> None:
        """See `Node`."""
        self._stopping.set()
        self._registrar.join(LEAVE_S)  # rospy does not take it well to be shut down while it starts
        leaving = threading.Thread(target=self._rospy.signal_shutdown, args=("the bridge ends",), daemon=True)
        leaving.start()
        leaving.join(LEAVE_S)

    def _register(self) -> None:
        """The registrar's thread."""
        while not self._stopping.is_set() and not self._link.ended:
            try:
                self._look()
            except Unavailable as error:
                self._registered_with = None
                self._tell(Link(up=False, text=str(error), registrations=self._link.registrations))
            except self._rospy.ROSException as error:
                self._end(str(error))
            self._stopping.wait(POLL_S)

    def _look(self) -> None:
        pid = self._master.pid()
        if self._rospy.is_shutdown():
            self._end(f"it was shut down from outside; most often another node is named {self._master.caller}")
            return
        if pid == self._registered_with:
            ros_node.topic_manager().check_all()  # who has gone is noticed in writing only
            return
        own = ros_node.uri() if self._opened else ""
        if other := rival(self._master, own):
            self._end(
                f"another node is named {self._master.caller}, at {other}: name one of them otherwise (bridge.node)"
            )
            return
        if not self._opened:
            self._latched.look(self._master)
            self._open()
        self._clock.follow(self._master)
        register(self._master, ros_node.registrations(self._ports.parameters))
        self._latched.registered(time.monotonic())
        self._registered_with = pid
        count, advice = self._link.registrations + 1, reach.advice(ros_node.uri(), self._master.uri)
        self._tell(Link(up=True, text=f"{self._master.uri} pid {pid}", registrations=count, advice=advice))

    def _end(self, text: str) -> None:
        if not self._stopping.is_set():
            self._tell(Link(up=False, text=text, registrations=self._link.registrations, ended=True))

    def _tell(self, link: Link) -> None:
        if link != self._link:
            self._link = link
            self._post(Message(LINK, value=link))

    def _open(self) -> None:
        """Makes the node and all its topics. Only `init_node` talks to the master, which has just answered."""
        ros_node.begin(self._name)
        self._opened = True
        ros_node.forget_listeners()
        for outlet in self._ports.outlets:
            self._open_outlet(outlet)
        for inlet in self._ports.inlets:
            self._open_inlet(inlet)
        for server in self._ports.servers:
            self._open_server(server)

    def _open_outlet(self, outlet: Outlet) -> None:
        outgoing = self._outgoing[outlet.topic]
        publisher = self._rospy.Publisher(
            outlet.topic, self._classes[outlet.topic], tcp_nodelay=True, latch=outlet.latch, queue_size=outlet.queue
        )
        publisher.impl.set_queue_size(None)  # no thread of rospy between us and the connection
        outgoing.attach(publisher.impl)
        publisher.impl.add_subscriber_listener(outgoing)

    def _open_inlet(self, inlet: Inlet) -> None:
        kind = self._rospy.AnyMsg if inlet.type == ANY else messages.message_class(inlet.type)
        large = {"queue_size": 1, "buff_size": LARGE} if inlet.newest else {}
        self._rospy.Subscriber(inlet.topic, kind, self._heard, callback_args=inlet.topic, tcp_nodelay=True, **large)

    def _open_server(self, server: Server) -> None:
        kind: Any = messages.service_class(server.type)
        self._rospy.Service(server.name, kind, partial(self._called, server, kind._response_class))

    def _heard(self, message: Any, topic: str) -> None:
        """On rospy's threads, one per publisher."""
        if doubled(message):
            return
        old = self._latched.is_old(topic, message._connection_header, time.monotonic(), time.time())
        if isinstance(message, self._rospy.AnyMsg):
            message = definitions.decoded(message._buff, message._connection_header)
        if message is None:
            return
        self._post(Message(FROM_ROS + topic, value=messages.fields_of(message), retain=old))

    def _called(self, server: Server, response: Any, request: Any) -> Any:
        """On a thread of rospy per call, which may wait."""
        answers: queue.SimpleQueue[Fields] = queue.SimpleQueue()
        self._post(Message(CALLED + server.name, value=Call(messages.fields_of(request), answers.put)))
        end = time.monotonic() + CALL_S
        while not self._stopping.is_set() and time.monotonic() < end:
            try:
                return messages.build(response, answers.get(timeout=POLL_S))
            except queue.Empty:
                continue
        raise self._rospy.ServiceException("the bridge ends" if self._stopping.is_set() else "no answer in time")


def _class(outlet: Outlet) -> Any:
    if outlet.definition and messages.message_class(outlet.type) is None:
        return definitions.declare(outlet.type, outlet.definition)
    return messages.message_class(outlet.type)


def _rospy() -> Any:
    try:
        return ros_node.rospy()
    except ImportError as error:
        raise ConfigError(
            [f"bridge: expected ROS 1 ({error}): apt-get install {PACKAGES}, or simulated: true"]
        ) from error
