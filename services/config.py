"""Reads the configuration file into each service's Config, and tells all faults at once, with file and line.

The top of the file: `bus`, `state`, `home` (a file), `default_camera`, `grouped`, and a section for each service,
named in `registry.py`. What a setting means stands at the Config above the code that uses it.
"""

from __future__ import annotations

import difflib
import importlib
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from services import document, secret_store
from services.apartment.home import Home
from services.bus_settings import BusSettings as BusSettings
from services.document import Document, Fault, Path_
from services.errors import ConfigError
from services.registry import REGISTRY, Row
from services.section import Section
from services.topic import LEVELS

M = TypeVar("M", bound=BaseModel)
TOP = ("bus", "state", "home", "default_camera", "grouped")
HELD = ("expected ${", "expected a readable file")  # of whose machine alone has it: a secret, a certificate
INJECTED = ("name", "home", "cameras", "camera_sections", "folder", "state")  # see `section.py`


@dataclass(frozen=True)
class Instance:
    """One service as this configuration wants it."""

    name: str
    row: Row
    config: Section


def check_files(instances: dict[str, Instance], source: Document) -> list[str]:
    """The faults of the files that the services' own settings name."""
    faults: list[str] = []
    for instance in instances.values():
        check = getattr(importlib.import_module(instance.row.module), "check", None)
        try:
            if check is not None:
                check(instance.config)
        except ConfigError as error:
            faults += source.placed(error.faults)
    return faults


@dataclass(frozen=True)
class Apartment:
    """The whole configuration, checked."""

    file: Path
    bus: BusSettings
    home: Home
    state: Path
    cameras: tuple[str, ...]
    grouped: bool = False
    instances: dict[str, Instance] = field(default_factory=dict)


class Top(Section):
    """The keys at the top of the file that belong to no service."""

    bus: BusSettings = BusSettings()
    state: Path | None = None
    home: Path
    default_camera: str | None = None
    grouped: bool = False  # light services share a process: for a small machine


def load(
    file: Path,
    only: tuple[str, ...] | None = None,
    environment: Mapping[str, str] = os.environ,
    *,
    deep: bool = False,
) -> Apartment:
    """Reads and checks; ConfigError with every fault.

    `only`: services to run; the others' secrets may be absent. `deep`: the files that services' settings name too.
    """
    secret = secret_store.lookup(environment)
    source = document.read(file, secret)
    raw = source.value if isinstance(source.value, dict) else {}
    if not source.faults and not raw:
        source.fault((), "expected sections such as bus, home and cameras, got nothing")
    top = _model(Top, {key: raw[key] for key in TOP if key in raw}, source, ())
    home, home_faults = home_in(file.parent / raw["home"]) if isinstance(raw.get("home"), str) else (None, [])
    cameras = _cameras(raw, source)
    state = _state_folder(top or Top(home=file), file, environment)
    given = {"home": home, "cameras": cameras, "folder": file.parent, "state": state}
    given["camera_sections"] = raw.get("cameras") if cameras else None
    _unknown_sections(raw, source)
    _misnamed_cameras(raw, source)
    instances = {one.name: one for one in _instances(raw, source, cameras, given)}
    bus = (top.bus if top else BusSettings()).named_in(file)
    others = [*bus.faults(), *check_files(instances, source)] if deep else []
    faults = [*_wanted([*source.faults, *others], only), *home_faults]
    if faults or top is None or home is None:
        raise ConfigError(sorted(dict.fromkeys(faults), key=document.by_place))
    return Apartment(file, bus, home, state, cameras, top.grouped, instances)


def _wanted(faults: list[str], only: tuple[str, ...] | None) -> list[str]:
    """Without the secrets and certificates of services that do not run here (each machine holds only its own)."""
    if only is None:
        return faults
    mine = ("bus.accounts.", *(f"{row.section[0]}." for row in REGISTRY))
    kept = [*(f"bus.accounts.{name}" for name in only), *(f"{section}." for name in only for section in _section(name))]

    def matters(fault: str) -> bool:
        where = fault.key if isinstance(fault, Fault) else ""
        foreign = where.startswith(mine) and not any(where.startswith(prefix) for prefix in kept)
        return not (foreign and any(f": {wanted}" in fault for wanted in HELD))

    return [fault for fault in faults if matters(fault)]


def _section(name: str) -> Iterator[str]:
    """Where the settings of a service of that name stand."""
    for row in REGISTRY:
        if match := re.fullmatch(row.name.replace("<cam>", "(.+)"), name):
            yield ".".join(row.section).replace("<cam>", match[match.lastindex or 0])


def _state_folder(top: Top, file: Path, environment: Mapping[str, str]) -> Path:
    if top.state is not None:
        return file.parent / top.state
    if "STATE_DIRECTORY" in environment:
        return Path(environment["STATE_DIRECTORY"].split(":")[0])
    return Path(environment.get("XDG_STATE_HOME") or Path.home() / ".local/state") / "apartment"


def home_in(file: Path) -> tuple[Home | None, list[str]]:
    """The home of its file, and its faults."""
    source = document.read(file)
    home = None if source.faults else _model(Home, source.value or {}, source, ())
    if home is not None:
        for path, text in home.faults():
            source.fault(path, text)
    return home, source.faults


def _cameras(raw: dict[str, Any], source: Document) -> tuple[str, ...]:
    """The names of the cameras, the default one first."""
    names = list(raw["cameras"]) if isinstance(raw.get("cameras"), dict) else []
    default = raw.get("default_camera")
    if default is not None and default not in names:
        source.fault(
            ("default_camera",), f"expected one of the cameras ({', '.join(map(str, names))}), got {default!r}"
        )
    return tuple(sorted((str(name) for name in names), key=lambda name: name != default))


def _unknown_sections(raw: dict[str, Any], source: Document) -> None:
    known = (*TOP, *dict.fromkeys(row.section[0] for row in REGISTRY))
    for key in raw:
        if key not in known:
            source.fault((key,), _unknown(key, known))
    simulators = raw.get("simulators")
    inner = [row.section[1] for row in REGISTRY if row.section[0] == "simulators"]
    for key in simulators if isinstance(simulators, dict) else ():
        if key not in inner:
            source.fault(("simulators", key), _unknown(key, inner))


def _misnamed_cameras(raw: dict[str, Any], source: Document) -> None:
    """A camera's name becomes a level of topics and a ROS name."""
    for place in (("cameras",), ("simulators", "cameras")):
        named = _at(raw, place)
        for name in named if isinstance(named, dict) else ():
            if not re.fullmatch(LEVELS["cam"], str(name)):
                source.fault((*place, name), f"expected a name of a-z, 0-9 and _ beginning with a letter, got {name!r}")


def _instances(
    raw: dict[str, Any], source: Document, cameras: tuple[str, ...], given: dict[str, Any]
) -> Iterator[Instance]:
    for row in REGISTRY:
        for camera in _names_in(row, raw, cameras):
            section = tuple(part.replace("<cam>", camera) for part in row.section)
            settings = _at(raw, section)
            if settings is None and not _at(raw, section[:-1], section[-1]):
                continue
            name = row.name.replace("<cam>", camera)
            config = _config(row, settings or {}, source, section, {**given, "name": camera or name})
            if config is not None:
                yield Instance(name, row, config)


def _names_in(row: Row, raw: dict[str, Any], cameras: tuple[str, ...]) -> tuple[str, ...]:
    """What `<cam>` stands for in a row, one service each; for a row without it one nameless service."""
    if "<cam>" not in row.name:
        return ("",)
    named = _at(raw, row.section[:-1])
    return cameras if row.section[0] == "cameras" else tuple(map(str, named if isinstance(named, dict) else ()))


def _at(raw: Any, section: tuple[str, ...], key: str | None = None) -> Any:
    """The value at a path of keys; with `key`, whether that key stands there (its value may be empty)."""
    for part in section:
        raw = raw.get(part) if isinstance(raw, dict) else None
    return raw if key is None else isinstance(raw, dict) and key in raw


def _config(row: Row, settings: Any, source: Document, section: Path_, given: dict[str, Any]) -> Section | None:
    model: type[Section] = importlib.import_module(row.module).Config
    if not isinstance(settings, dict):
        source.fault(section, f"expected settings, got {settings!r}")
        return None
    for key in INJECTED:
        if key in settings and key in model.model_fields:
            source.fault((*section, key), "expected no such key here, it is given by the program")
    wanted = {key: value for key, value in given.items() if key in model.model_fields and value is not None}
    return _model(model, {**settings, **wanted}, source, section, given=INJECTED)


def _model(model: type[M], values: Any, source: Document, path: Path_, given: tuple[str, ...] = ()) -> M | None:
    try:
        return model.model_validate(values)
    except ValidationError as error:
        for fault in error.errors(include_url=False):
            if fault["loc"] in [(name,) for name in given] and fault["type"] == "missing":
                continue  # what is given was faulty itself, and is told there
            where = (*path, *(part for part in fault["loc"] if not _is_a_tag(part)))
            source.fault(where, _expected(fault, model))
        return None


def _is_a_tag(part: str | int) -> bool:
    """pydantic puts the name of a validator or of a union's branch into the path; ours have none in lower case."""
    return isinstance(part, str) and ("[" in part or part.startswith("function-"))


def _expected(fault: Any, model: type[BaseModel]) -> str:
    """Pydantic's words as ours: `expected ..., got ...`."""
    last = str(fault["loc"][-1]) if fault["loc"] else ""
    if fault["type"] == "missing":
        return "expected a value, got nothing"
    if fault["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return _unknown(last, _keys_at(model, fault["loc"][:-1]))
    text = str(fault["msg"]).replace("Value error, ", "").replace("Input should be", "expected")
    if "password" in last or ", got " in text:
        return text if text.startswith("expected") else f"expected {text}"
    return f"{text}, got {_short(fault['input'])}"


def _short(value: object) -> str:
    return text if len(text := repr(value)) <= 80 else f"{text[:77]}..."


def _unknown(key: object, known: Any) -> str:
    near = difflib.get_close_matches(str(key), [str(name) for name in known], n=1)
    return f"expected a known key{f' (did you mean {near[0]!r}?)' if near else ''}, got {str(key)!r}"


def _keys_at(model: Any, path: tuple[int | str, ...]) -> tuple[str, ...]:
    """The keys that a nested model or dataclass knows, as far as the types tell."""
    for part in path:
        known = getattr(model, "model_fields", {})
        model = next(_kinds(known[part].annotation if part in known else None), model)
    return tuple(name for name in _fields(model) if name not in INJECTED)


def _fields(model: Any) -> Iterable[str]:
    return model.__dataclass_fields__ if is_dataclass(model) else model.model_fields


def _kinds(annotation: Any) -> Iterator[Any]:
    if isinstance(annotation, type) and (issubclass(annotation, BaseModel) or is_dataclass(annotation)):
        yield annotation
    for inner in getattr(annotation, "__args__", ()):
        yield from _kinds(inner)
