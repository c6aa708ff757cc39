"""`apartment calibrate zoom`: asks, orders it of the running service, tells each step, and shows the table."""

from __future__ import annotations

import sys

import typer
from rich.prompt import Confirm
from rich.table import Table

from services import client, topics
from services.bus import Message
from services.command_line.options import CONFIG, Camera, Config, YesMove, out
from services.command_line.order import tell, with_camera
from services.config import load
from services.errors import ConfigError
from services.payloads import Calibration

ASK = (
    "May {} zoom in and out now? It takes some minutes; it should look at something with outlines, not at a blank wall."
)


def zoom(
    camera: Camera,
    yes_move: YesMove = False,
    config: Config = CONFIG,
) -> None:
    """Learn what each level of zoom magnifies by, from pictures of what the camera looks at; exit 1 when it was not."""
    apartment = with_camera(load(config, (f"camera-{camera}",)), camera)
    if not yes_move and not sys.stdin.isatty():
        raise ConfigError(["--yes-move: expected it where nobody can be asked: the camera moves"])
    if not yes_move and not Confirm.ask(ASK.format(camera), console=out):
        raise typer.Exit(1)
    with client.connected(apartment.bus, [topics.CAMERA_CALIBRATION.filter]) as bus:
        result = bus.order(camera, "CalibrateZoom", "True", tell=tell)
        last = _last(bus.seen, camera)
    if last is not None and last.state == "done":
        show(last)
    if result.state != "done":
        raise typer.Exit(1)


def show(done: Calibration) -> None:
    """The table of levels, and where it is kept."""
    rows = Table("level", "focal length, px", "+-")
    for name, (focal, doubt) in done.values.items():
        rows.add_row(name, f"{focal:.1f}", f"{doubt:.1f}")
    out.print(rows)
    out.print(f"kept in {done.file}" + (f"; the report is {done.report}" if done.report else ""))


def _last(seen: list[Message], camera: str) -> Calibration | None:
    """The newest word about a zoom of that camera."""
    topic = topics.CAMERA_CALIBRATION.name(cam=camera)
    said = [topics.read(message, message.received).payload for message in seen if message.topic == topic]
    return next((one for one in reversed(said) if one.what == "zoom"), None)
