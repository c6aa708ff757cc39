"""What OpenHAB's rules do for the event bus, as a table: on which events, and what then. Pure.

The rules of both languages (`dsl.py`, `javascript.py`) are written from it, so neither knows an event that the other
does not. OpenHAB says states and hears commands and updates; it never hears what it says, so nothing goes in a circle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from services.apartment.home import GROUP_ROS
from services.openhab.site import Site
from services.openhab.things import COMMANDS, UPDATES

READY_LEVEL = 100  # of a start: everything runs; states that were restored came long before, unseen by rules


@dataclass(frozen=True)
class MemberChanged:
    """The state of a direct member of a group became another."""

    group: str


@dataclass(frozen=True)
class Started:
    """OpenHAB runs; with a level where the release knows them."""

    level: int | None


@dataclass(frozen=True)
class ThingOnline:
    """A thing works (again)."""

    uid: str


@dataclass(frozen=True)
class ChannelTriggered:
    """A channel of events fired."""

    uid: str


Trigger = MemberChanged | Started | ThingOnline | ChannelTriggered
Act = Literal["publish", "snapshot", "accept"]


@dataclass(frozen=True)
class Reaction:
    """One rule."""

    act: Act
    label: str
    triggers: tuple[Trigger, ...]


def reactions(site: Site) -> tuple[Reaction, ...]:
    """The three rules of the bus."""
    broker = site.broker.uid
    started = Started(READY_LEVEL if site.version.oldest.has_start_level else None)
    heard = (ChannelTriggered(f"{broker}:{COMMANDS}"), ChannelTriggered(f"{broker}:{UPDATES}"))
    return (
        Reaction("publish", "bus: say the state of a member that changed", (MemberChanged(GROUP_ROS),)),
        Reaction("snapshot", "bus: say all states", (started, ThingOnline(broker))),
        Reaction("accept", "bus: hear commands and updates", heard),
    )
