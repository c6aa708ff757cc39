"""Talking to the ROS master by XML-RPC with a timeout, and registering a whole node there, again and again.

rospy registers once, without a timeout, while it holds the lock of all topics: a master that was started anew
does not know the node any more, and one that hangs stops it. So the node's registrations are made here.
"""

from __future__ import annotations

import http.client
import xmlrpc.client
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any
from xml.parsers.expat import ExpatError

from services.errors import Unavailable

TIMEOUT_S = 2.0  # loopback answers within a millisecond; a hanging master must not hold the registrar for long
GOOD = 1  # the code of a call that was done (ROS Master API)
FAULTS = (OSError, http.client.HTTPException, xmlrpc.client.Error, ExpatError, ValueError, TypeError)


class _Transport(xmlrpc.client.Transport):
    """With a timeout of its own; the socket module's default one would be everyone's."""

    def make_connection(self, host: tuple[str, dict[str, str]] | str) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = TIMEOUT_S
        return connection


@dataclass(frozen=True)
class Master:
    """The master at `uri`, as the node `caller` asks it."""

    uri: str
    caller: str

    def call(self, method: str, *arguments: Any) -> Any:
        """The value that a call of the Master API returns; Unavailable when it is away, hangs or refuses."""
        return _call(self.uri, method, self.caller, *arguments)

    def pid(self) -> int:
        """Its process: another number means another master, which knows nobody."""
        value = self.call("getPid")
        if not isinstance(value, int):
            raise Unavailable(f"{self.uri} getPid: expected a number, got {value!r:.80}")
        return value


@dataclass(frozen=True)
class Registrations:
    """All that a node has: pairs of name and type, services with their own address. `uri` is the node's own."""

    uri: str
    publications: Iterable[tuple[str, str]] = field(default=())
    subscriptions: Iterable[tuple[str, str]] = field(default=())
    services: Iterable[tuple[str, str]] = field(default=())
    parameters: Mapping[str, Any] = field(default_factory=dict)  # by their full names


def register(master: Master, node: Registrations) -> None:
    """Tells the master everything, and our node who publishes what it subscribes to; Unavailable in between.

    To say what the master knows already does no harm.
    """
    for topic, kind in node.publications:
        master.call("registerPublisher", topic, kind, node.uri)
    for topic, kind in node.subscriptions:
        publishers = master.call("registerSubscriber", topic, kind, node.uri)
        _call(node.uri, "publisherUpdate", master.caller, topic, publishers)
    for name, address in node.services:
        master.call("registerService", name, address, node.uri)
    for name, value in node.parameters.items():
        master.call("setParam", name, value)


def rival(master: Master, own: str) -> str:
    """The address of another node alive with our name; empty when there is none. `own`: our address, if we have one.

    The master would shut that one down as soon as we register: two bridges would end each other for ever.
    """
    try:
        uri = str(master.call("lookupNode", master.caller))
        if uri != own:
            _call(uri, "getPid", master.caller)
            return uri
    except Unavailable:  # nobody has the name, or who had it does not answer any more
        pass
    return ""


def _call(uri: str, method: str, *arguments: Any) -> Any:
    try:
        with xmlrpc.client.ServerProxy(uri, transport=_Transport()) as proxy:
            code, text, value = getattr(proxy, method)(*arguments)
    except FAULTS as error:
        raise Unavailable(f"{uri} {method}: {error or type(error).__name__}") from error
    if code != GOOD:
        raise Unavailable(f"{uri} {method}: {text}")
    return value
