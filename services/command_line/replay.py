"""`apartment replay`: says again what was recorded, in the same distances of time.

What may move something (commands, and topics that nobody knows) is left out unless it is wanted and confirmed. Not
here: the file's form (`recording.py`), making one (`record.py`).
"""

from __future__ import annotations

import time
import uuid
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import typer

from services import client, process
from services.bus import Message, topic_matches
from services.client import Client
from services.command_line import hearing, recording
from services.command_line.options import CONFIG, Config, out
from services.config import load
from services.errors import BadMessage, ConfigError
from services.payloads import stamp
from services.topics import Kind, find

ACCOUNT = "operator"
AT_ONCE = 500  # messages between two looks whether the broker has taken them all
TAKEN_S = 30.0
SHOWN = 10  # things that would move, by name
MOVES, STRANGE, NOT_OURS = "commands", "on unknown topics", "on topics of others"


@dataclass(frozen=True)
class Choice:
    """What of a recording is said again. `account`: whose rights at the broker bound it; None: nobody's."""

    only: tuple[str, ...] = ()
    commands: bool = False
    pictures: bool = False
    account: str | None = ACCOUNT

    def again(self, message: Message) -> tuple[Message | None, str]:
        """The message with the flags of its kind, or None, and of what kind it is or why it is left out."""
        if self.only and not any(topic_matches(one, message.topic) for one in self.only):
            return None, "not asked for"
        try:
            row, levels = find(message.topic)
        except BadMessage:
            strange = message._replace(received=0.0)
            return (strange if self.commands else None), STRANGE
        if row.kind is Kind.BLOB and not self.pictures:
            return None, "pictures"
        if self.account is not None and self.account not in row.writers:
            return None, NOT_OURS
        if row.kind is Kind.COMMAND and not self.commands:
            return None, MOVES
        return row.message(message.payload, **levels), f"{row.kind.value}s"


@dataclass
class Contents:
    """What is in a file, after it was read to its end."""

    first: float = 0.0
    last: float = 0.0
    said: Counter[str] = field(default_factory=Counter)
    left_out: Counter[str] = field(default_factory=Counter)
    moving: list[str] = field(default_factory=list)  # topics of what may move something and is said


def replay(
    file: Path,
    speed: Annotated[float, typer.Option(min=0.01, max=1000.0, help="2: in half the time.")] = 1.0,
    only: Annotated[list[str] | None, typer.Option(help="A filter such as 'home/#'; repeat for more.")] = None,
    at_once: Annotated[bool, typer.Option("--as-fast-as-it-can", help="Without the pauses.")] = False,
    commands: Annotated[bool, typer.Option("--commands", help="Commands and unknown topics too: it may move.")] = False,
    pictures: Annotated[bool, typer.Option("--pictures", help="Pictures too.")] = False,
    nameless: Annotated[
        bool, typer.Option("--without-account", help="For a demo's broker, which lets in all.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="It may move; else the terminal is asked.")] = False,
    config: Config = CONFIG,
) -> None:
    """Say again what was recorded; commands are left out, so that nothing moves, unless --commands is given.

    What the broker does not take from the account `operator` is left out too.
    """
    apartment = load(config)
    has_account = bool(apartment.bus.accounts.get(ACCOUNT)) and not nameless
    wanted = tuple(hearing.checked(only)) if only else ()
    choice = Choice(wanted, commands, pictures, ACCOUNT if has_account else None)
    contents = look(file, choice)
    _tell(file, contents)
    if not contents.said:
        raise typer.Exit(1)
    if contents.moving and not yes:
        _ask()
    watch = hearing.Stopwatch()
    with process.stop_signals(watch.stop), client.connected(apartment.bus, account="" if nameless else ACCOUNT) as bus:
        said = _say_all(bus, _again(file, choice), 0.0 if at_once else 1 / speed, watch)
        out.print(f"said {said} of {contents.said.total()} messages")
    if said < contents.said.total():
        raise typer.Exit(1)


def look(file: Path, choice: Choice) -> Contents:
    """Reads a recording to its end, so that a broken one is refused before anything is said."""
    contents = Contents()
    for message in recording.read(file):
        contents.first = contents.first or message.received
        contents.last = max(contents.last, message.received)
        said, kind = choice.again(message)
        (contents.left_out if said is None else contents.said)[kind] += 1
        if said is not None and kind in (MOVES, STRANGE) and message.topic not in contents.moving:
            contents.moving.append(message.topic)
    return contents


def _tell(file: Path, contents: Contents) -> None:
    took = contents.last - contents.first
    out.print(f"{file}: {stamp(contents.first)}, {took:.1f} s", markup=False)
    for what, counted in (("says", contents.said), ("leaves out", contents.left_out)):
        if counted:
            out.print(f"{what} {', '.join(f'{number} {kind}' for kind, number in sorted(counted.items()))}")
    if contents.moving:
        more = f" and {len(contents.moving) - SHOWN} more" if len(contents.moving) > SHOWN else ""
        out.print(f"MAY MOVE: {', '.join(sorted(contents.moving)[:SHOWN])}{more}", markup=False)


def _ask() -> None:
    if not out.is_terminal:
        raise ConfigError(["--yes: expected it where no terminal can be asked, since something may move"])
    if not typer.confirm("Something may move. Go on?"):
        raise typer.Exit(1)


def _again(file: Path, choice: Choice) -> Iterator[tuple[float, Message]]:
    """When each message came, and as what it is said."""
    for message in recording.read(file):
        said, _ = choice.again(message)
        if said is not None:
            yield message.received, said


def _say_all(bus: Client, messages: Iterator[tuple[float, Message]], slowness: float, watch: hearing.Stopwatch) -> int:
    """Publishes each when it is due; how many the broker has taken. TimeoutError when it does not take them."""
    begun, first, said = time.monotonic(), None, 0
    taken = f"reply/replay-{uuid.uuid4().hex[:12]}"
    bus.subscribe(taken)
    for when, message in messages:
        first = when if first is None else first
        _wait(bus, begun + (when - first) * slowness, watch)
        if watch.over:
            break
        bus.publish(message)
        said += 1
        if said % AT_ONCE == 0:
            _wait_until_taken(bus, taken, str(said))
    _wait_until_taken(bus, taken, "all")
    return said


def _wait(bus: Client, due: float, watch: hearing.Stopwatch) -> None:
    while (left := due - time.monotonic()) > 0 and not watch.over:
        bus.pump(min(left, hearing.GLANCE_S))


def _wait_until_taken(bus: Client, topic: str, word: str) -> None:
    """Our own word comes back behind all that we said before it; it is said again, should it be lost."""
    end = time.monotonic() + TAKEN_S
    while not any(message.payload == word.encode() for message in bus.seen):
        if time.monotonic() > end:
            raise TimeoutError(f"the broker did not take all within {TAKEN_S:.0f} s")
        bus.say(topic, word)
        bus.pump(1.0)
    bus.seen.clear()
