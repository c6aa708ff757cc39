"""Whether other computers of the ROS graph can reach us under the address that we give them (ROS_IP, ROS_HOSTNAME).

A wrong one is ROS's favourite riddle: the topics are listed, and no data comes. Not here: setting it; people do that.
"""

from __future__ import annotations

import socket
from urllib.parse import urlsplit


def advice(own_uri: str, master_uri: str) -> str:
    """What is wrong with our own address, and what to do; empty when nothing can be found."""
    host, master = urlsplit(own_uri).hostname or "", urlsplit(master_uri).hostname or ""
    own, others = _addresses(host), _addresses(master)
    if not own:
        return f"other computers are told to find us at {host!r}, a name without an address: set ROS_IP"
    if not any(_is_mine(address) for address in own):
        return f"other computers are told to find us at {host} ({own[0]}), which is not this computer: set ROS_IP"
    if all(map(_is_loopback, own)) and others and not any(_is_loopback(one) or _is_mine(one) for one in others):
        return f"the ROS master is on another computer, which is told to find us at {host} ({own[0]}): set ROS_IP"
    return ""


def _addresses(host: str) -> list[str]:
    try:
        return [str(found[4][0]) for found in socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)]
    except OSError:
        return []


def _is_loopback(address: str) -> bool:
    return address.startswith("127.") or address == "::1"


def _is_mine(address: str) -> bool:
    """Only an own address can be bound."""
    try:
        with socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind((address, 0))
    except OSError:
        return False
    return True
