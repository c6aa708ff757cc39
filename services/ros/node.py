"""rospy without its side effects on whoever starts a node: Python's logging stays as it was, registrations are ours.

Not here: talking to the master (`master.py`), what the bridge's node does (`bridge/ros.py`).
"""

from __future__ import annotations

import importlib
import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from services.ros.master import Registrations


def rospy() -> Any:
    """The module; ImportError where it is not installed.

    Its import puts its own logger class in Python's place, which loses the line of whoever logs. Of what it tells
    itself, every connection for one, our log gets the warnings.
    """
    before = logging.getLoggerClass()
    for name in ("rospy", "rosgraph"):
        logging.getLogger(name).setLevel(logging.WARNING)
    try:
        return importlib.import_module("rospy")
    finally:
        logging.setLoggerClass(before)


def begin(name: str) -> None:
    """Makes this process a node, once. Its only talk with the master is short: ask first whether there is one."""
    logging.raiseExceptions = (
        False  # on a full disk each line of rospy's own log file would bring a traceback into ours
    )
    with _logging_kept():
        rospy().init_node(name, disable_signals=True, disable_rosout=True, disable_rostime=True)


def topic_manager() -> Any:
    """All topics of the node."""
    return _registration().get_topic_manager()


def forget_listeners() -> None:
    """rospy registers a new topic without a timeout, with the lock of all topics; from now on that is left to us."""
    _registration().get_registration_listeners().clear()


def uri() -> str:
    """The node's own address."""
    return str(importlib.import_module("rospy.core").get_node_uri())


def registrations(parameters: Mapping[str, Any]) -> Registrations:
    """All that the node has, for `ros_master.register`."""
    registration = _registration()
    topics, services = registration.get_topic_manager(), registration.get_service_manager()
    return Registrations(
        uri(), topics.get_publications(), topics.get_subscriptions(), services.get_services(), parameters
    )


def _registration() -> Any:
    return importlib.import_module("rospy.impl.registration")


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
