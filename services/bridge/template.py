"""Templates of the rules: texts, lists and mappings with `{names}` in them, and what becomes of them. Pure.

A text that is one single placeholder becomes the value itself (a number, an object); anywhere else a value becomes
text, as JSON writes it. `{payload.position.x}` goes into objects by key and into lists by number.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any

from services.errors import BadMessage

Path = tuple[str, ...]
Look = Callable[[Path], Any]
PLACE = re.compile(r"\{([A-Za-z_][A-Za-z0-9_]*(?:\.[A-Za-z0-9_]+)*)\}")


class Absent(Exception):
    """A value that is null: there is nothing to say, and that is no fault."""


def fill(template: Any, look: Look) -> Any:
    """The template with every placeholder replaced by what `look` finds; Absent when that is None."""
    if isinstance(template, str):
        return _filled(_parsed(template), look)
    if isinstance(template, dict):
        return {key: fill(part, look) for key, part in template.items()}
    if isinstance(template, list | tuple):
        return [fill(part, look) for part in template]
    return template


def places(template: Any) -> Iterator[Path]:
    """The paths of all placeholders."""
    if isinstance(template, str):
        yield from (part for part in _parsed(template) if isinstance(part, tuple))
    elif isinstance(template, dict):
        for part in template.values():
            yield from places(part)
    elif isinstance(template, list | tuple):
        for part in template:
            yield from places(part)


def given(template: Any, name: str, text: str) -> Any:
    """The template with one name filled in for good, the other placeholders kept."""
    if isinstance(template, str):
        return template.replace(f"{{{name}}}", text)
    if isinstance(template, dict):
        return {key: given(part, name, text) for key, part in template.items()}
    if isinstance(template, list | tuple):
        return [given(part, name, text) for part in template]
    return template


def walk(value: Any, path: Path) -> Any:
    """The part of a value at a path; BadMessage when it has no such part."""
    for index, key in enumerate(path):
        if value is None:
            return None
        if isinstance(value, dict) and key in value:
            value = value[key]
        elif isinstance(value, list) and key.isdigit() and int(key) < len(value):
            value = value[int(key)]
        else:
            raise BadMessage(f"expected {'.'.join(path[: index + 1])!r} in it, got {as_text(value)[:80]!r}")
    return value


def as_text(value: Any) -> str:
    """A value as text: a text as it is, everything else as JSON (`true`, `21.5`, `{"x": 1.0}`)."""
    if isinstance(value, str):
        return value
    if isinstance(value, bytes):
        raise BadMessage("expected a value that has a text, got bytes")
    try:
        return json.dumps(value, ensure_ascii=False, allow_nan=False)
    except (ValueError, TypeError) as error:
        raise BadMessage(f"expected finite numbers and texts, got {value!r:.80}") from error


@lru_cache(maxsize=4096)
def _parsed(text: str) -> tuple[str | Path, ...]:
    """Literal texts and paths in turn: `a{b.c}` is ("a", ("b", "c"))."""
    parts = PLACE.split(text)
    mixed = (tuple(part.split(".")) if index % 2 else part for index, part in enumerate(parts))
    return tuple(part for part in mixed if part)


def _filled(parts: tuple[str | Path, ...], look: Look) -> Any:
    if len(parts) == 1 and isinstance(parts[0], tuple):
        return _found(parts[0], look)
    return "".join(part if isinstance(part, str) else as_text(_found(part, look)) for part in parts)


def _found(path: Path, look: Look) -> Any:
    value = look(path)
    if value is None:
        raise Absent(".".join(path))
    return value
