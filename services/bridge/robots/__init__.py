"""Robots of ROS 1 on the bus: one file each, which alone turns `robot/<robot>/...` into that robot's ROS names.

`bridge.robots.<robot>.kind` names the file. It offers three things:

* `Settings`: its section of the configuration; faults in it are told with file and line;
* `check(settings, folder)`: reads the files that the settings name; ConfigError tells their faults;
* `part(robot, settings, where)`: the part of the bridge (`bridge/part.py`) that speaks for the robot: it hears
  `robot/<robot>/goto` and `/cancel`, and says `/goto/result`, `/pose` and `/seen`.

The rule of all of them: a goal lives no longer than who commands it. When the bridge ends or is killed, and when the
bus is lost, the robot is stopped; so it is when the mission service has been gone for a while (`commander.py`). Shared
by them: `goals.py` (actionlib), `senses.py` (a process that hears and sees).
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import PlainValidator

from services.bridge.part import Part
from services.section import Section


@dataclass(frozen=True)
class Where:
    """What a robot's part needs of the bridge: its node's name and master, the configuration's folder, and the one for
    what is kept."""

    node: str
    master_uri: str | None
    folder: Path
    state: Path | None


def kinds() -> list[str]:
    """The robots that there is a file for."""
    shared = ("actions", "chain", "commander", "eyes", "goals", "pipe", "senses")
    return sorted(file.stem for file in Path(__file__).parent.glob("[a-z]*.py") if file.stem not in shared)


def _settings(given: Any) -> Section:
    """A robot's section, read by the file that it names."""
    if isinstance(given, Section):
        return given
    if not isinstance(given, dict):
        raise ValueError(f"expected settings, got {given!r:.80}")
    kind = given.get("kind")
    if kind not in kinds():
        raise ValueError(f"expected a kind of {', '.join(kinds())}, got {kind!r:.80}")
    settings: Section = _file(kind).Settings.model_validate(given)
    return settings


Robot = Annotated[Section, PlainValidator(_settings)]


def check(settings: Section, folder: Path) -> None:
    """Reads the files that a robot's settings name; ConfigError tells their faults."""
    _file(settings.kind).check(settings, folder)  # type: ignore[attr-defined]


def part(robot: str, settings: Section, where: Where) -> Part:
    """The part of the bridge that speaks for a robot."""
    made: Part = _file(settings.kind).part(robot, settings, where)  # type: ignore[attr-defined]
    return made


def _file(kind: str) -> Any:
    return importlib.import_module(f"{__name__}.{kind}")
