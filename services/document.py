"""A YAML file as plain values, and the line where each of them stands.

Not here: what the values mean, that is `config.py`. The words of YAML 1.1 that surprise (`on`, `off`, `yes`, `no`
as booleans) stay texts, since `ON` is a state of a light here.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from services.errors import ConfigError, Setting
from services.whole_file import write_whole

Path_ = tuple[str | int, ...]
MOST = (
    200_000  # values in a file; an alias (`*name`) counts as often as it is used, or a few lines could fill the memory
)
DEEPEST = 50  # lists in lists; also what ends one that contains itself
LARGEST = 16 * 1024 * 1024  # bytes of a file
REFERENCE = re.compile(r"\$\{([A-Za-z_][A-Za-z0-9_]*)(?::-([^}]*))?\}")


class _Loader(yaml.SafeLoader):
    """YAML with only `true` and `false` as booleans."""


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in rows if tag != "tag:yaml.org,2002:bool"]
    for first, rows in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver("tag:yaml.org,2002:bool", re.compile(r"true|false|True|False"), list("tfTF"))


class _Dumper(yaml.SafeDumper):
    """A key on each line, a list in one."""


_Dumper.add_representer(list, lambda dumper, value: dumper.represent_sequence("tag:yaml.org,2002:seq", value, True))


class Fault(str):
    """A fault in the form that people are shown. It keeps its parts, since any of them may hold a colon too."""

    place: tuple[str, int]  # file and line
    key: str

    def __new__(cls, file: Path, line: int, key: str, text: str) -> Fault:
        self = super().__new__(cls, f"{file}:{line}: {key}: {text}")
        self.place, self.key = (str(file), line), key
        return self


def by_place(fault: str) -> tuple[str, int]:
    """What faults are sorted by."""
    return fault.place if isinstance(fault, Fault) else (fault, 0)


@dataclass
class Document:
    """`value` as plain Python values; `lines` maps a path of keys to its line; `faults` found while reading."""

    file: Path
    value: Any = None
    lines: dict[Path_, int] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)  # each is a Fault

    def line(self, path: Path_) -> int:
        """The line of a path, or of the nearest thing around it that stands in the file."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path, 1)

    def where(self, path: Path_) -> str:
        """`file:line` of a path."""
        return f"{self.file}:{self.line(path)}"

    def fault(self, path: Path_, text: str) -> None:
        """Notes a fault."""
        self.faults.append(Fault(self.file, self.line(path), dotted(path) or "file", text))

    def placed(self, faults: Iterable[str]) -> list[str]:
        """The faults, those of settings with the lines that these have here."""
        return [
            Fault(self.file, self.line(one.path), dotted(one.path), one.text) if isinstance(one, Setting) else one
            for one in faults
        ]


def dotted(path: Path_) -> str:
    """`cameras.hall.presets[1]` of a path."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def read(file: Path, secret: Callable[[str], str | None] | None = None, *, names: bool = False) -> Document:
    """Reads a file; `${NAME}` and `${NAME:-default}` in texts are replaced by what `secret` knows.

    `names`: keys are people's words and stay as they are written, also `007` and `~`.
    What is wrong with the YAML, a key that stands twice and a name that nobody knows are in `faults`.
    """
    document = Document(file)
    try:
        if file.stat().st_size > LARGEST:
            document.fault((), f"expected at most {LARGEST} bytes, got {file.stat().st_size}")
            return document
        root = yaml.compose(file.read_text(encoding="utf-8"), Loader=_Loader)
    except (OSError, UnicodeDecodeError) as error:
        document.fault((), f"expected a readable file, got {getattr(error, 'strerror', None) or error}")
        return document
    except yaml.MarkedYAMLError as error:
        document.lines[()] = error.problem_mark.line + 1 if error.problem_mark else 1
        document.fault((), f"expected YAML, got {error.problem}")
        return document
    except RecursionError:
        document.fault((), f"expected lists and mappings {DEEPEST} deep at most, got more")
        return document
    reader = _Reader(document, secret, names=names)
    if root is not None:
        try:
            document.value = reader.value(root, ())
        except ConfigError as error:
            document.faults += error.faults
    return document


def write(file: Path, value: Any) -> None:
    """Writes plain values as YAML; whoever reads meanwhile sees the old file or the new one, never a part."""
    text: str = yaml.dump(value, Dumper=_Dumper, allow_unicode=True, sort_keys=False, default_flow_style=False)
    write_whole(file, text)


def must(document: Document) -> Any:
    """The value of a document without faults; ConfigError otherwise."""
    if document.faults:
        raise ConfigError(document.faults)
    return document.value


class _Reader:
    """From YAML's nodes to values."""

    def __init__(self, document: Document, secret: Callable[[str], str | None] | None, *, names: bool) -> None:
        self.document = document
        self.secret = secret
        self.names = names
        self.scalars = _Loader("")
        self.count = 0

    def value(self, node: yaml.Node, path: Path_) -> Any:
        self.document.lines.setdefault(path, node.start_mark.line + 1)
        self.count += 1
        if self.count > MOST or len(path) > DEEPEST:
            wanted = f"{MOST} values" if self.count > MOST else f"lists and mappings {DEEPEST} deep"
            line = node.start_mark.line + 1
            raise ConfigError([Fault(self.document.file, line, "file", f"expected {wanted} at most")])
        if isinstance(node, yaml.MappingNode):
            return self.mapping(node, path)
        if isinstance(node, yaml.SequenceNode):
            return [self.value(child, (*path, index)) for index, child in enumerate(node.value)]
        return self.scalar(node, path)

    def mapping(self, node: yaml.MappingNode, path: Path_) -> dict[Any, Any]:
        values: dict[Any, Any] = {}
        for key_node, child in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                self.document.lines[(*path, "?")] = key_node.start_mark.line + 1
                self.document.fault((*path, "?"), "expected a plain key, got a list or a mapping")
                continue
            key = str(key_node.value) if self.names else self.scalar(key_node, path)
            here = (*path, key)
            if key in values:
                self.document.fault(
                    path, f"expected every key once, got {key!r} again in line {key_node.start_mark.line + 1}"
                )
                continue
            self.document.lines[here] = key_node.start_mark.line + 1
            values[key] = self.value(child, here)
        return values

    def scalar(self, node: yaml.Node, path: Path_) -> Any:
        try:
            value = self.scalars.construct_object(node, deep=True)
        except yaml.MarkedYAMLError as error:
            self.document.fault(path, f"expected a plain value, got {error.problem}")
            return None
        if self.secret is not None and isinstance(value, str) and "${" in value:
            return self.replaced(value, path)
        return value

    def replaced(self, text: str, path: Path_) -> str:
        def one(match: re.Match[str]) -> str:
            found = self.secret(match[1]) if self.secret else None
            if found is None and match[2] is None:
                self.document.fault(
                    path, f"expected ${{{match[1]}}} in the environment, a credential file or secrets.yaml, got nothing"
                )
            return found if found is not None else match[2] or ""

        return REFERENCE.sub(one, text)
