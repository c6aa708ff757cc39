"""A sheet whose lines and words become SVG text. Not here: what is drawn (`plot.py`)."""

from __future__ import annotations

from collections.abc import Sequence
from xml.sax.saxutils import escape

from services.history.plot import INK, XY, Colour

ANCHORS = {"left": "start", "middle": "middle", "right": "end"}


class Svg:
    """A white sheet of that many pixels; see `plot.Sheet`."""

    def __init__(self, width: int, height: int) -> None:
        size = f'width="{width}" height="{height}" viewBox="0 0 {width} {height}"'
        self._parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" {size}>',
            '<rect width="100%" height="100%" fill="#fff"/>',
        ]

    def line(self, points: Sequence[XY], colour: Colour, width: float = 1.0) -> None:
        """Straight from point to point."""
        style = f'fill="none" stroke="{_hex(colour)}" stroke-width="{width:g}"'
        self._parts.append(f'<polyline points="{_points(points)}" {style}/>')

    def shape(self, points: Sequence[XY], colour: Colour) -> None:
        """A filled polygon."""
        self._parts.append(f'<polygon points="{_points(points)}" fill="{_hex(colour)}"/>')

    def text(
        self, at: XY, words: str, colour: Colour = INK, size: float = 12.0, weight: int = 400, align: str = "left"
    ) -> None:
        """One line of words."""
        style = f'text-anchor="{ANCHORS[align]}" font-family="sans-serif" font-size="{size:g}" font-weight="{weight}"'
        self._parts.append(f'<text x="{at[0]:g}" y="{at[1]:g}" {style} fill="{_hex(colour)}">{escape(words)}</text>')

    def file(self) -> bytes:
        """All of it."""
        return "\n".join([*self._parts, "</svg>", ""]).encode()


def _points(points: Sequence[XY]) -> str:
    return " ".join(f"{x},{y}" for x, y in points)


def _hex(colour: Colour) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
