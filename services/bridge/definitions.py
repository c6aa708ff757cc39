"""Message types that are not installed: classes made of a definition text, as it stands in a file or on a connection.

genpy writes Python from the text and runs it: only texts of ours, and of publishers on topics that the configuration
names, come here. Not here: fields to messages and back (`messages.py`).
"""

from __future__ import annotations

import importlib
import logging
import shutil
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

LONGEST = 100_000  # characters of a definition; sensor_msgs' longest has 10 000

log = logging.getLogger(__name__)
_declared: dict[str, Any] = {}
_folders: set[Path] = set()


def declare(name: str, definition: str) -> Any:
    """The class of a type that we publish, by its definition text with those that it needs; ValueError when it is
    none. From then on `known` finds it and its parts."""
    classes = _classes(name, definition)
    for part, made in classes.items():
        _declared.setdefault(part, made)
    return _declared[name]


def known(name: str) -> Any | None:
    """The class of a type that was declared."""
    return _declared.get(name)


def decoded(data: bytes, header: Mapping[str, str]) -> Any | None:
    """The message of a connection that says what it carries; None (and a line in the log) when it does not fit."""
    kind, definition = header.get("type", ""), header.get("message_definition", "")
    try:
        message = _classes(kind, definition)[kind]()
        message.deserialize(data)
    except (ValueError, KeyError, _deserialization_error()) as error:
        log.warning("from %s: expected a message of %s: %s", header.get("callerid", "?"), kind or "some type", error)
        return None
    return message


def tidy() -> None:
    """Removes the folders that genpy leaves: for a process that ends without Python's own farewell."""
    for folder in _folders:
        shutil.rmtree(folder, ignore_errors=True)


@cache
def _classes(name: str, definition: str) -> dict[str, Any]:
    if len(definition) > LONGEST or not definition.strip():
        raise ValueError(f"expected a definition of 1 to {LONGEST} characters, got {len(definition)}")
    genmsg = importlib.import_module("genmsg")
    errors = (genmsg.MsgGenerationException, genmsg.InvalidMsgSpec, genmsg.MsgNotFound, SyntaxError)
    try:
        made: dict[str, Any] = importlib.import_module("genpy.dynamic").generate_dynamic(name, definition)
    except errors as error:
        raise ValueError(f"{name}: {error}") from error
    _folders.add(Path(str(sys.modules[made[name].__module__].__file__)).parent)
    return made


def _deserialization_error() -> type[Exception]:
    error: type[Exception] = importlib.import_module("genpy").DeserializationError
    return error
