"""The printed things of `apartment calibrate`, boards and markers; what is on them says `vision/sheets.py`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from services.command_line.options import CONFIG, Unread, out, writable
from services.errors import ConfigError

Kind = Annotated[str, typer.Option("--board", help="charuco, or chessboard.")]
Squares = Annotated[str, typer.Option("--squares", help="Columns x rows of squares (not of inner corners).")]
Side = Annotated[float, typer.Option("--square", help="Side of a square as printed, mm.")]
Inner = Annotated[float | None, typer.Option("--marker", help="Side of the markers in it, mm; else 70 % of that.")]
Book = Annotated[str, typer.Option("--dictionary", help="The markers' dictionary.")]


def board(
    to: Annotated[Path, typer.Option("--out", help="A .pdf or .png file.")],
    kind: Kind = "charuco",
    squares: Squares = "9x6",
    square: Side = 30.0,
    marker: Inner = None,
    dictionary: Book = "DICT_4X4_50",
    dpi: Annotated[int, typer.Option(min=50, max=2400, help="Of a PNG.")] = 600,
    _config: Unread = CONFIG,
) -> None:
    """Write a board for `calibrate lens`, to be printed at 100 % and glued onto something flat."""
    from services.vision import sheets  # OpenCV, for this command alone
    from services.vision.board import Board

    columns, rows = squares_of(squares)
    with _wrong("--board"):
        inner = (0.7 * square if marker is None else marker) / 1000
        made = Board(_kind(kind), columns, rows, square / 1000, inner, dictionary)
        sheet = sheets.board_sheet(made)
    _write(to, lambda: sheets.png(sheet, dpi), lambda: sheets.pdf([sheet]))
    out.print(f"wrote {to}: {sheet.words}")


def markers(
    ids: list[int],
    to: Annotated[Path, typer.Option("--out", help="A .pdf file, or a .png for one marker.")],
    side: Annotated[float, typer.Option(help="Of the black square, mm.")] = 140.0,
    dictionary: Book = "DICT_5X5_1000",
    dpi: Annotated[int, typer.Option(min=50, max=2400, help="Of a PNG.")] = 600,
    _config: Unread = CONFIG,
) -> None:
    """Write markers to be printed at 100 %, one on each page."""
    from services.vision import sheets

    with _wrong("markers"):
        pages = [sheets.marker_sheet(marker, dictionary, side) for marker in ids]
    if to.suffix == ".png" and len(pages) > 1:
        raise ConfigError(["--out: expected a .pdf for several markers, got a .png"])
    _write(to, lambda: sheets.png(pages[0], dpi), lambda: sheets.pdf(pages))
    out.print(f"wrote {to}: {len(pages)} pages. Measure a printed black square: its side is a setting (markers.size).")


def squares_of(text: str) -> tuple[int, int]:
    """Columns and rows of `9x6`; ConfigError when it is none."""
    columns, _, rows = text.lower().partition("x")
    if not (columns.isdigit() and rows.isdigit()):
        raise ConfigError([f"--squares: expected columns x rows such as 9x6, got {text!r}"])
    return int(columns), int(rows)


def _kind(text: str) -> Any:
    if text not in ("charuco", "chessboard"):
        raise ConfigError([f"--board: expected charuco or chessboard, got {text!r}"])
    return text


@contextmanager
def _wrong(option: str) -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        raise ConfigError([f"{option}: {error}"]) from error


def _write(to: Path, png: Callable[[], bytes], pdf: Callable[[], bytes]) -> None:
    if to.suffix not in (".pdf", ".png"):
        raise ConfigError([f"--out: expected a .pdf or .png file, got {to}"])
    writable(to, "--out")
    to.write_bytes(png() if to.suffix == ".png" else pdf())
