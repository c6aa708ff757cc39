"""The node over rospy: topics made on a thread of their own, and registered again at every new ROS master.

rospy's traps are met here, each where it bites: registration (`master.py`), Python's logging, the lock of a
publisher's buffer, the queue of a new subscriber. Not here: what a message means (`rules.py`, `messages.py`).
"""

from __future__ import annotations

import importlib
import logging
import os
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from services.bridge.master import Master, Registrations, register
from services.bridge.messages import build, fields_of, message_class
from services.bridge.node import FROM_ROS, LINK, Inlet, Kept, Link, Outlet
from services.bridge.rules import Fields
from services.bus import Message
from services.errors import ConfigError, Unavailable
from services.runner import Post

POLL_S = 0.5  # of the master's pid; a new master knows us again within this time and some milliseconds
LEAVE_S = 2.0  # saying goodbye to a master that hangs must not hold up our end
PACKAGES = "python3-rospy python3-diagnostic-msgs python3-geometry-msgs"

log = logging.getLogger(__name__)


class RosNode:
    """One per process: rospy's node cannot be started again in the same one.

    `publish` works before the master is there: what replay and latch keep is sent to those who come.
    """

    def __init__(
        self, name: str, master_uri: str | None, outlets: tuple[Outlet, ...], inlets: tuple[Inlet, ...], post: Post
    ) -> None:
        self._rospy = _rospy()
        if master_uri is not None:
            os.environ["ROS_MASTER_URI"] = master_uri
        self._name = name
        self._master = Master(os.environ.get("ROS_MASTER_URI", "http://localhost:11311"), f"/{name}")
        self._outlets = {outlet.topic: outlet for outlet in outlets}
        self._classes = {outlet.topic: message_class(outlet.type) for outlet in outlets}
        self._inlets = inlets
        self._post = post
        self._kept = Kept()
        self._publishers: dict[str, Any] = {}
        self._handover = threading.Lock()  # between what was kept for a publisher and its first live message
        self._stopping = threading.Event()
        self._registered_with: int | None = None
        self._link = Link(up=False, text="not yet")
        self._registrar = threading.Thread(target=self._register, name="ros-registrar", daemon=True)
        self._registrar.start()

    def publish(self, topic: str, fields: Fields, key: str = "") -> None:
        """See `Node`."""
        outlet = self._outlets[topic]
        message = build(self._classes[topic], fields)
        with self._handover:
            if outlet.replay or outlet.latch:
                self._kept.put(topic, key if outlet.replay else "", message)
            publisher = self._publishers.get(topic)
        if publisher is not None:
            self._send(publisher, message)

    def refresh(self) -> None:
        """See `Node`."""
        for topic, publisher in self._publishers.items():
            for message in self._kept.of(topic) if self._outlets[topic].replay else ():
                self._send(publisher, message)

    def close(self) -> None:
        """See `Node`."""
        self._stopping.set()
        leaving = threading.Thread(target=self._rospy.signal_shutdown, args=("the bridge ends",), daemon=True)
        leaving.start()
        leaving.join(LEAVE_S)
        self._registrar.join(LEAVE_S)

    def _send(self, publisher: Any, message: Any) -> None:
        try:
            publisher.publish(message)
        except self._rospy.ROSException as error:  # rospy closes topics when it is shut down; the registrar says why
            log.debug("not sent: %s", error)

    def _register(self) -> None:
        """The registrar's thread."""
        while not self._stopping.is_set() and not self._link.ended:
            try:
                self._look()
            except Unavailable as error:
                self._registered_with = None
                self._tell(Link(up=False, text=str(error), registrations=self._link.registrations))
            except self._rospy.ROSException as error:
                self._tell(Link(up=False, text=str(error), registrations=self._link.registrations, ended=True))
            self._stopping.wait(POLL_S)

    def _look(self) -> None:
        pid = self._master.pid()
        if not self._publishers:
            self._open()
        if self._rospy.is_shutdown():
            self._ended()
        elif pid != self._registered_with:
            register(self._master, self._registrations())
            self._registered_with = pid
            registrations = self._link.registrations + 1
            self._tell(Link(up=True, text=f"{self._master.uri} pid {pid}", registrations=registrations))

    def _ended(self) -> None:
        if not self._stopping.is_set():
            text = f"shut down from outside; most often another node is named {self._master.caller}"
            self._tell(Link(up=False, text=text, registrations=self._link.registrations, ended=True))

    def _tell(self, link: Link) -> None:
        if link != self._link:
            self._link = link
            self._post(Message(LINK, value=link))

    def _open(self) -> None:
        """Makes the node and all its topics. Only `init_node` talks to the master, which has just answered."""
        with _logging_kept():
            self._rospy.init_node(self._name, disable_signals=True, disable_rosout=True, disable_rostime=True)
        importlib.import_module("rospy.impl.registration").get_registration_listeners().clear()
        publishers = {topic: self._publisher(outlet) for topic, outlet in self._outlets.items()}
        for inlet in self._inlets:
            self._rospy.Subscriber(
                inlet.topic, message_class(inlet.type), self._heard, callback_args=inlet.topic, tcp_nodelay=True
            )
        with self._handover:
            for topic, outlet in self._outlets.items():
                for message in self._kept.of(topic) if outlet.latch else ():
                    publishers[topic].publish(message)
            self._publishers = publishers

    def _publisher(self, outlet: Outlet) -> Any:
        greeter = _Greeter(lambda: self._kept.of(outlet.topic)) if outlet.replay else None
        publisher = self._rospy.Publisher(
            outlet.topic,
            self._classes[outlet.topic],
            subscriber_listener=greeter,
            tcp_nodelay=True,
            latch=outlet.latch,
            queue_size=outlet.queue,
        )
        if greeter is not None:
            greeter.lock = publisher.impl.publock
        return publisher

    def _heard(self, message: Any, topic: str) -> None:
        """On rospy's threads, one per publisher."""
        self._post(Message(FROM_ROS + topic, value=fields_of(message)))

    def _registrations(self) -> Registrations:
        registration = importlib.import_module("rospy.impl.registration")
        topics, services = registration.get_topic_manager(), registration.get_service_manager()
        uri = importlib.import_module("rospy.core").get_node_uri()
        return Registrations(uri, topics.get_publications(), topics.get_subscriptions(), services.get_services())


class _Greeter:
    """Sends a new subscriber, and only it, what is kept (rospy's SubscribeListener).

    Under the publisher's lock: without it a live message would share its buffer with ours, or overtake it with an
    older one following.
    """

    def __init__(self, kept: Callable[[], Iterable[Any]]) -> None:
        self._kept = kept
        self.lock = threading.RLock()

    def peer_subscribe(
        self, topic: str, publish: Callable[[Any], None], publish_to_peer: Callable[[Any], None]
    ) -> None:
        with self.lock:
            for message in self._kept():
                publish_to_peer(message)

    def peer_unsubscribe(self, topic: str, peers: int) -> None:
        """Nothing to do."""


def _rospy() -> Any:
    """Its import puts its own logger class in Python's place, which loses the line of whoever logs.

    Of what it tells itself, every connection for one, our log gets the warnings.
    """
    before = logging.getLoggerClass()
    for name in ("rospy", "rosgraph"):
        logging.getLogger(name).setLevel(logging.WARNING)
    try:
        return importlib.import_module("rospy")
    except ImportError as error:
        raise ConfigError(
            [f"bridge: expected ROS 1 ({error}): apt-get install {PACKAGES}, or simulated: true"]
        ) from error
    finally:
        logging.setLoggerClass(before)


@contextmanager
def _logging_kept() -> Iterator[None]:
    """`init_node` takes our handlers from the root logger, and sets its level."""
    root = logging.getLogger()
    handlers, level = list(root.handlers), root.level
    try:
        yield
    finally:
        root.handlers[:] = handlers
        root.setLevel(level)
