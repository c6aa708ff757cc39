"""`apartment calibrate map`: where the apartment lies in a robot's map, from points known in both; writes it there.

Not here: the estimate (`vision/calibrate_map.py`), the file that everybody reads it from (`apartment/robot_places.py`).
"""

from __future__ import annotations

import difflib
import sys
from math import dist
from pathlib import Path
from time import time
from typing import TYPE_CHECKING, Annotated

import typer
from pydantic import ValidationError
from rich.prompt import Confirm
from rich.table import Table
from rich.text import Text

from services import client, document
from services.bus import Message
from services.command_line.options import CONFIG, Config, out
from services.config import Apartment, load
from services.errors import BadMessage, ConfigError
from services.section import Section
from services.topics import CAMERA_MARKER, CAMERA_SCAN_RESULT, ROBOT_POSE, ROBOT_SEEN, read
from services.whole_file import write_whole

if TYPE_CHECKING:  # numbers, for this command alone: every process of a service loads this module
    from services.apartment.robot_places import Relation
    from services.mission.both import Both
    from services.vision.calibrate_map import MapFit, Pair

TOO_FAR = 5.0  # times what a point was measured to
POSE_S = 10.0  # a robot says where it is at least so often
XY = tuple[float, float]


class Point(Section):
    """One pair of the file; metres."""

    name: str
    apartment: XY
    map: XY


class Points(Section):
    """The file of pairs."""

    pairs: tuple[Point, ...] = ()


def map_(
    pair: Annotated[list[str] | None, typer.Option(help="X,Y=X,Y of a point in apartment and map, m; repeat.")] = None,
    pairs: Annotated[Path | None, typer.Option(help="A YAML file of pairs; what is measured now is added.")] = None,
    here: Annotated[str | None, typer.Option(help="X,Y in the apartment where the robot stands now, m.")] = None,
    seen: Annotated[float, typer.Option(help="Listen so many seconds for markers that robot and house see.")] = 0.0,
    leave_out: Annotated[list[str] | None, typer.Option("--leave-out", help="A pair's name; repeat.")] = None,
    doubt_mm: Annotated[float, typer.Option("--doubt", min=0.1, help="How well a point was measured, mm.")] = 30.0,
    robot: Annotated[str | None, typer.Option(help="Which, where there are several.")] = None,
    diff: Annotated[bool, typer.Option("--diff", help="Show what would change, and change nothing.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Write it without asking.")] = False,
    config: Config = CONFIG,
) -> None:
    """Learn where the apartment lies in a robot's map, from two or more points known in both.

    Points come from --pair and --pairs, from where the robot stands (--here), and from markers that both see (--seen).
    Exit 1 when a pair cannot be right: measure it again, or leave it out.
    """
    from services.command_line.mission import robot_of
    from services.vision.calibrate_map import Pair

    apartment = load(config, ("mission",))
    name, file = robot_of(apartment, robot)
    known = [Pair(one.name, one.apartment, one.map) for one in _kept(pairs)] + [_typed(one) for one in pair or []]
    fresh = _measured(apartment, name, here, seen) if here or seen else []
    if fresh and pairs is not None:
        _keep(pairs, fresh)
    fit = _fit(_without([*known, *fresh], leave_out or []), doubt_mm / 1000)
    if why := _doubtful(fit, doubt_mm / 1000):
        out.print(f"nothing is written: {why}", style="yellow")
        raise typer.Exit(1)
    _write(file, fit, diff=diff, yes=yes)


def _typed(text: str) -> Pair:
    from services.vision.calibrate_map import Pair

    here, _, there = text.partition("=")
    return Pair(here.strip(), _point(here, "--pair", "X,Y=X,Y"), _point(there, "--pair", "X,Y=X,Y"))


def _point(text: str, option: str, form: str) -> XY:
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError([f"{option}: expected {form} in metres, such as 3.9,4.52, got {text!r}"]) from None
    return x, y


def _kept(file: Path | None) -> tuple[Point, ...]:
    """The pairs of the file; none where there is no file yet."""
    if file is None or not file.exists():
        return ()
    source = document.read(file)
    value = document.must(source)
    try:
        return Points.model_validate(value or {}).pairs
    except ValidationError as error:
        for fault in error.errors(include_url=False):
            source.fault(fault["loc"], f"expected {fault['msg']}, got {fault['input']!r:.80}")
        raise ConfigError(source.faults) from None


def _keep(file: Path, fresh: list[Pair]) -> None:
    """Adds what was measured; a pair of the same name is replaced."""
    names = {one.name for one in fresh}
    old = [one.model_dump(mode="json") for one in _kept(file) if one.name not in names]
    new = [{"name": one.name, "apartment": list(one.apartment), "map": list(one.map)} for one in fresh]
    document.write(file, {"pairs": [*old, *new]})
    out.print(f"{file}: {', '.join(sorted(names))} kept there")


def _without(pairs: list[Pair], left_out: list[str]) -> list[Pair]:
    names = [one.name for one in pairs]
    for name in left_out:
        if name not in names:
            raise ConfigError([f"--leave-out: expected one of {', '.join(names) or 'the pairs'}, got {name!r}"])
    return [one for one in pairs if one.name not in left_out]


def _measured(apartment: Apartment, robot: str, here: str | None, seconds: float) -> list[Pair]:
    """What robot and house say now; TimeoutError when the robot is silent."""
    from services.mission.both import Both
    from services.vision.calibrate_map import Pair

    topics = (ROBOT_POSE.name(robot=robot), ROBOT_SEEN.name(robot=robot))
    both = Both()
    with client.connected(apartment.bus, (*topics, CAMERA_MARKER.filter, CAMERA_SCAN_RESULT.filter)) as bus:
        pose = bus.payload(topics[0], timeout_s=POSE_S)
        if seconds:
            out.print(f"listening for {seconds:.0f} s; drive {robot} to where it sees markers, and let it stand there")
        for message in bus.collect(seconds):
            _heard(both, message)
    pairs = [Pair(f"marker {marker}", *points) for marker, points in both.pairs().items()]
    if here is not None:
        pairs.append(Pair(f"robot at {here}", _point(here, "--here", "X,Y"), (pose.x, pose.y)))
    return pairs


def _heard(both: Both, message: Message) -> None:
    try:
        both.hears(read(message, message.received).payload)
    except BadMessage as error:
        out.print(str(error), style="yellow")


def _fit(pairs: list[Pair], doubt_m: float) -> MapFit:
    from services.vision.calibrate_map import fit

    try:
        found = fit(pairs, doubt_m)
    except ValueError as error:
        raise ConfigError([f"pairs: {error}"]) from None
    rows = Table("point", "apartment, m", "map, m", "off, mm")
    for one, off in zip(pairs, found.off_m, strict=True):
        rows.add_row(one.name, *(f"{x:.3f} {y:.3f}" for x, y in (one.apartment, one.map)), f"{1000 * off:.0f}")
    out.print(rows)
    out.print(
        f"the apartment's origin in the map: x {found.x:.3f} y {found.y:.3f} +- {found.sigma_m:.3f} m, "
        f"turned by {found.yaw_deg:.2f} +- {found.sigma_deg:.2f} deg"
    )
    if len(pairs) == 2:
        out.print("two points cannot tell whether one was mistaken: a third one would", style="yellow")
    return found


def _doubtful(fit: MapFit, doubt_m: float) -> str:
    """Why it is not to be believed; empty when it is."""
    if fit.misplaced is not None:
        where = f"{fit.misplaced} is {fit.misplaced_m:.2f} m from where the others put it"
        return f"{where}. Measure it again, or leave it out: --leave-out {fit.misplaced!r}"
    if max(fit.off_m) > TOO_FAR * doubt_m:
        return f"the points are up to {max(fit.off_m):.2f} m off where {doubt_m:.2f} m is what they were measured to"
    return ""


def _write(file: Path, fit: MapFit, *, diff: bool, yes: bool) -> None:
    """Into the robot's file, the old one kept; asks before."""
    from services.apartment import robot_places
    from services.apartment.robot_places import Relation

    old, old_text = robot_places.places(file).apartment_to_map, file.read_text(encoding="utf-8")
    text = robot_places.with_relation(old_text, Relation(x=fit.x, y=fit.y, yaw_deg=fit.yaw_deg))
    if diff:
        before, after = (one.splitlines(keepends=True) for one in (old_text, text))
        changed = difflib.unified_diff(before, after, f"a/{file.name}", f"b/{file.name}")
        out.print("".join(changed), end="", markup=False)
        return
    if text == old_text:
        out.print(f"{file}: it stands there already")
        return
    if not yes and not _may_write(file, old, fit):
        raise typer.Exit(1)
    _replace(file, text)


def _may_write(file: Path, old: Relation, fit: MapFit) -> bool:
    if not sys.stdin.isatty():
        raise ConfigError(["--yes: expected it where nobody can be asked: the robot's file changes"])
    far, turned = dist((old.x, old.y), (fit.x, fit.y)), abs((old.yaw_deg - fit.yaw_deg + 180) % 360 - 180)
    return Confirm.ask(Text(f"{file}: it changes by {far:.2f} m and {turned:.1f} deg. Write it?"), console=out)


def _replace(file: Path, text: str) -> None:
    from services.apartment import robot_places
    from services.camera.calibration import files

    backup = files.kept(file, time())
    assert backup is not None
    old = robot_places.places(file)
    write_whole(file, text)
    try:
        same = robot_places.places(file).model_copy(update={"apartment_to_map": old.apartment_to_map}) == old
    except ConfigError:
        same = False
    if not same:
        write_whole(file, backup.read_bytes())
        line = next(line for line in text.splitlines() if line.startswith(robot_places.KEY))
        raise ConfigError([f"{file}:1: it does not lend itself to that and is as it was; put there by hand: {line}"])
    out.print(f"{file}: written; the old file is {backup}. Restart mission and bridge: they read it when they begin")
