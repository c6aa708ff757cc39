"""`apartment calibrate ...`: has a camera's motors, lens and mount learnt, and prints what that takes.

The service does the work, as with any order; here is what a person sees of it, and the mount's way into the
configuration. How it is learnt is in `services/camera/calibration/` and `services/camera/ptz/`.
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import time
from typing import Annotated, Any

import typer
from rich.live import Live
from rich.prompt import Confirm
from rich.table import Table
from rich.text import Text

from services import client, document
from services.client import Client
from services.command_line import prints
from services.command_line.calibrate_map import map_
from services.command_line.options import CONFIG, Camera, Config, YesMove, out, printable, writable
from services.command_line.order import tell, with_camera
from services.command_line.prints import Book, Inner, Kind, Side, Squares, squares_of
from services.command_line.zoom import zoom
from services.config import Apartment, load
from services.errors import ConfigError
from services.payloads import Calibration, OrderResult
from services.topics import CAMERA_CALIBRATION
from services.whole_file import write_whole

app = typer.Typer(no_args_is_help=True, help="Learn on purpose what a device is like.")
Report = Annotated[Path | None, typer.Option("--out", help="Where the report goes; default <camera>-<what>.html.")]
BAR, FULL, EMPTY = 30, "#", "."
ASK = "May {} turn now? It looks for the markers all around, for some minutes, and returns to where it looked."


app.command(epilog="Example: apartment calibrate zoom ip1 --yes-move")(zoom)
app.command("map", epilog="Example: apartment calibrate map --pair 0,0=1.5,-0.8 --pair 5.6,6=5.73,6.23")(map_)


@app.command(epilog="Example: apartment calibrate ptz ip1 --yes-move")
def ptz(camera: Camera, yes_move: YesMove = False, config: Config = CONFIG) -> None:
    """Turn a camera with every speed and keep what that teaches: speeds, delays, accelerations, smallest step."""
    from services.camera.ptz import command  # for this command alone

    apartment = _apartment(config, camera)

    def ordered() -> bool:
        with client.connected(apartment.bus) as bus:
            return bus.order(camera, "CalibratePtz", "True", tell=tell).state == "done"

    if not command.run(out, camera, apartment.state, ordered, yes_move=yes_move):
        raise typer.Exit(1)


@app.command(epilog="Example: apartment calibrate lens ip1 --squares 9x6 --square 30 --out lens.html")
def lens(
    camera: Camera,
    board: Kind = "charuco",
    squares: Squares = "9x6",
    square: Side = 30.0,
    marker: Inner = None,
    dictionary: Book = "DICT_4X4_50",
    model: Annotated[str, typer.Option(help="auto, plumb_bob or rational_polynomial.")] = "auto",
    seconds: Annotated[float, typer.Option(help="Give up after so long.")] = 600.0,
    report: Report = None,
    config: Config = CONFIG,
) -> None:
    """Learn the lens from a board that you show to the camera; tells what to show next. Writes ost.yaml."""
    report = report or Path(f"{camera}-lens.html")
    writable(report, "--out")
    apartment, (columns, rows) = _apartment(config, camera), squares_of(squares)
    wish: dict[str, Any] = {
        "board": board, "columns": columns, "rows": rows, "square_mm": square, "dictionary": dictionary,
        "model": model, "seconds": seconds, **({} if marker is None else {"marker_mm": marker}),
    }  # fmt: skip
    told = _learnt(apartment, camera, "CalibrateLens", wish)
    _show(told)
    out.print(f"written to {told.file}; the camera's service uses it from now on")
    _copy(told.report, report)


@app.command(epilog="Example: apartment calibrate mount ip1 --at 582=3.90,4.52,0.46 --at 17=1.80,4.14,0.92")
def mount(
    camera: Camera,
    at: Annotated[list[str] | None, typer.Option("--at", help="ID=X,Y,Z of a marker's centre, m; repeat.")] = None,
    doubt_mm: Annotated[float, typer.Option("--doubt", help="How far from there they mostly are, mm.")] = 10.0,
    keep: Annotated[bool, typer.Option("--keep", help="Leave the configuration file as it is.")] = False,
    yes_move: YesMove = False,
    report: Report = None,
    config: Config = CONFIG,
) -> None:
    """Learn how a camera hangs from three or more markers at known places; writes its mount into the configuration.

    Markers that the configuration knows (markers.known) are used besides those given here.
    """
    report = report or Path(f"{camera}-mount.html")
    writable(report, "--out")
    apartment = _apartment(config, camera)
    markers = dict(map(_placed, at or []))
    if not _may_move(ASK.format(camera), yes_move=yes_move):
        raise typer.Exit(1)
    told = _learnt(apartment, camera, "CalibrateMount", {"markers": markers, "doubt_m": doubt_mm / 1000})
    _show(told)
    if told.said:
        out.print(told.said, style="yellow")
    _copy(told.report, report)
    if not keep:
        write_mount(config, camera, told.mount or {})


app.command(epilog="Example: apartment calibrate board --out board.pdf")(prints.board)
app.command(epilog="Example: apartment calibrate markers 582 17 --side 140 --out markers.pdf")(prints.markers)


def _apartment(config: Path, camera: str) -> Apartment:
    return with_camera(load(config, (f"camera-{camera}",)), camera)


def _placed(text: str) -> tuple[str, list[float]]:
    marker, _, place = text.partition("=")
    try:
        numbers = [float(part) for part in place.split(",")]
    except ValueError:
        numbers = []
    if not marker.strip().isdigit() or len(numbers) != 3:
        raise ConfigError([f"--at: expected ID=X,Y,Z such as 582=3.9,4.52,0.46, got {text!r}"])
    return marker.strip(), numbers


def _may_move(question: str, *, yes_move: bool) -> bool:
    if yes_move:
        return True
    if not sys.stdin.isatty():
        raise ConfigError(["--yes-move: expected it where nobody can be asked: the camera moves"])
    return Confirm.ask(question, console=out)


def _learnt(apartment: Apartment, camera: str, key: str, wish: dict[str, Any]) -> Calibration:
    """Orders it and shows how it goes; what came out. Exit 1 when nothing did."""
    with client.connected(apartment.bus, [CAMERA_CALIBRATION.name(cam=camera)]) as bus:
        result, told = _followed(bus, camera, key, wish)
    tell(result)
    if result.state != "done" or told is None:
        raise typer.Exit(1)
    return told


def _followed(bus: Client, camera: str, key: str, wish: dict[str, Any]) -> tuple[OrderResult, Calibration | None]:
    last: list[Calibration] = []
    with Live(console=out, auto_refresh=False, transient=True) as live:

        def hear(told: Any) -> None:
            if not isinstance(told, Calibration):
                return
            before = last[-1].said if last else ""
            last.append(told)
            if out.is_terminal:
                live.update(_picture(told), refresh=True)
            elif told.said and told.said != before:
                out.print(f"{100 * told.progress:3.0f} %  {told.views} pictures: {told.said}")

        result = bus.order(camera, key, wish, hear=hear)
    return result, next((one for one in reversed(last) if one.state == "done"), None)


def _picture(told: Calibration) -> Text:
    """Where the board was shown, how far it is, and what is next."""
    rows = ["  ".join(FULL * 2 if cell else EMPTY * 2 for cell in row) for row in told.regions]
    done = round(BAR * told.progress)
    bar = f"[{FULL * done}{EMPTY * (BAR - done)}] {100 * told.progress:.0f} %, {told.views} pictures"
    return Text("\n".join([*rows, bar, printable(told.said)]))


def _show(told: Calibration) -> None:
    rows = Table("", "value", "+-")
    for name, (value, sigma) in told.values.items():
        digits = 3 if abs(value) >= 10 else 5
        rows.add_row(name, f"{value:.{digits}f}", f"{sigma:.{digits}f}")
    out.print(rows)


def _copy(report: str | None, to: Path) -> None:
    """The report, from where the service keeps it."""
    page = Path(report) if report else None
    if page is None or not page.exists():
        out.print(f"the report is kept where the service runs: {report or 'nowhere, it has no state folder'}")
        return
    to.write_bytes(page.read_bytes())
    out.print(f"report: {to}")


def write_mount(config: Path, camera: str, found: dict[str, Any]) -> None:
    """Into the configuration's text, the old file kept; ConfigError when the text does not lend itself to that."""
    from services.camera.calibration import files
    from services.camera.calibration.section import with_mount

    try:
        text = with_mount(config.read_text(encoding="utf-8"), camera, found)
        backup = files.kept(config, time())
        write_whole(config, text)
        if _mount_in(config, camera) != found and backup is not None:
            write_whole(config, backup.read_bytes())
            raise ValueError("the mount could not be put there, the file is as it was")
    except ValueError as error:
        lines = [f"  {key}: {value}" for key, value in found.items()]
        raise ConfigError(
            [f"{config}:1: {error}; put it there by hand:", f"cameras.{camera}.mount:", *lines]
        ) from error
    out.print(f"{config}: the mount is written there; the old file is {backup}")


def _mount_in(config: Path, camera: str) -> Any:
    read_back = document.read(config)
    return None if read_back.faults else read_back.value["cameras"][camera].get("mount")
