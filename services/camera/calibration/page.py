"""The parts of a report: one HTML file with everything in it. What is on it say `lens_page` and `mount_page`.

Pure: pictures and numbers in, text out. Drawings are SVG in the pixels of the full picture.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape
from math import hypot

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Size = tuple[int, int]

STYLE = """
:root{color-scheme:light dark;--ink:#1b1f24;--soft:#5d6773;--line:#d5dae0;--paper:#fff;--good:#1a7f4b;--bad:#c0392b;
--dot:#1565c0}
@media (prefers-color-scheme:dark){:root{--ink:#e8ebee;--soft:#9aa5b1;--line:#39424c;--paper:#14181c;--good:#5fd39a;
--bad:#ff8a7a;--dot:#7db7ff}}
body{font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper);max-width:76rem;margin:2rem auto;
padding:0 1rem}
h1{font-size:1.6rem;margin:0}h2{font-size:1.2rem;margin:2.2rem 0 .6rem}p{max-width:46rem;margin:.5rem 0}
.soft{color:var(--soft)}.bad{color:var(--bad)}.good{color:var(--good)}
.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums}
td,th{padding:.25rem .9rem .25rem 0;text-align:right;border-bottom:1px solid var(--line)}
td:first-child,th:first-child,td.text{text-align:left}th{font-weight:600;color:var(--soft)}
figure{margin:0}figcaption{color:var(--soft);font-size:.9rem}
.grid{display:grid;grid-template-columns:repeat(auto-fill,minmax(21rem,1fr));gap:1.2rem}
.two{display:grid;grid-template-columns:repeat(auto-fit,minmax(22rem,1fr));gap:1.5rem;align-items:start}
svg{width:100%;height:auto;display:block;border:1px solid var(--line)}svg text{fill:var(--ink)}
"""


def page(title: str, sentence: str, *parts: str) -> str:
    """The whole file."""
    head = f"<meta charset='utf-8'><meta name='viewport' content='width=device-width'><title>{escape(title)}</title>"
    body = f"<h1>{escape(title)}</h1><p>{escape(sentence)}</p>{''.join(parts)}"
    return f"<!doctype html><html lang='en'><head>{head}<style>{STYLE}</style></head><body>{body}</body></html>\n"


def section(title: str, *parts: str) -> str:
    """A heading and what is below it."""
    return f"<section><h2>{escape(title)}</h2>{''.join(parts)}</section>"


def text(words: str, kind: str = "") -> str:
    """A paragraph; `kind`: soft, good or bad."""
    return f"<p class='{kind}'>{escape(words)}</p>"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of texts; it scrolls by itself where it is too wide."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    lines = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<div class='wide'><table><tr>{top}</tr>{lines}</table></div>"


def grid(figures: Iterable[str]) -> str:
    """Figures side by side, as many as there is room for."""
    return f"<div class='grid'>{''.join(figures)}</div>"


def pair(*figures: str) -> str:
    """Two figures side by side where there is room."""
    return f"<div class='two'>{''.join(figures)}</div>"


def figure(size: Size, drawing: str, caption: str, jpeg: bytes | None = None) -> str:
    """A drawing in the pixels of a picture of `size`, over that picture where there is one."""
    width, height = size
    under = ""
    if jpeg is not None:
        data = b64encode(jpeg).decode()
        under = f"<image href='data:image/jpeg;base64,{data}' width='{width}' height='{height}'/>"
    label = escape(caption, quote=True)
    svg = f"<svg viewBox='0 0 {width} {height}' role='img' aria-label='{label}'>{under}{drawing}</svg>"
    return f"<figure>{svg}<figcaption>{escape(caption)}</figcaption></figure>"


def dots(points: Array, radius: float, colour: str = "var(--dot)", opacity: float = 1.0) -> str:
    """Filled circles at points (n, 2)."""
    circles = "".join(f"<circle cx='{x:.1f}' cy='{y:.1f}' r='{radius:g}'/>" for x, y in points)
    return f"<g fill='{colour}' fill-opacity='{opacity:g}'>{circles}</g>"


def rings(points: Array, radius: float, width: float, colour: str) -> str:
    """Circles around points (n, 2)."""
    circles = "".join(f"<circle cx='{x:.1f}' cy='{y:.1f}' r='{radius:g}'/>" for x, y in points)
    return f"<g fill='none' stroke='{colour}' stroke-width='{width:g}'>{circles}</g>"


def arrows(points: Array, vectors: Array, width: float, colour: str) -> str:
    """Lines from points (n, 2) along vectors (n, 2), with a head where they are long enough."""
    lines = []
    for (x, y), (dx, dy) in zip(points, vectors, strict=True):
        length = hypot(dx, dy)
        lines.append(f"<path d='M{x:.1f} {y:.1f}l{dx:.1f} {dy:.1f}'/>")
        if length > 4 * width:
            ux, uy, head = dx / length, dy / length, min(3.5 * width, length / 2)
            left, right = (-ux - uy / 2, -uy + ux / 2), (-ux + uy / 2, -uy - ux / 2)
            tips = "".join(f"M{x + dx:.1f} {y + dy:.1f}l{head * a:.1f} {head * b:.1f}" for a, b in (left, right))
            lines.append(f"<path d='{tips}'/>")
    return f"<g fill='none' stroke='{colour}' stroke-width='{width:g}' stroke-linecap='round'>{''.join(lines)}</g>"


def outline(points: Array, width: float, colour: str) -> str:
    """A closed line through points (n, 2)."""
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f"<polygon points='{path}' fill='none' stroke='{colour}' stroke-width='{width:g}'/>"


def label(x: float, y: float, words: str, height: float, colour: str = "var(--ink)") -> str:
    """A text at a place of a drawing."""
    return f"<text x='{x:.1f}' y='{y:.1f}' font-size='{height:g}' style='fill:{colour}'>{escape(words)}</text>"


def scatter(points: Array, reach: float, unit: str, caption: str) -> str:
    """Points (n, 2) around zero in a square that reaches so far each way, with rings at a half and at the whole."""
    side, middle = 600, 300.0
    scale = 270 / max(reach, 1e-9)
    axes = f"<path d='M0 {middle}H{side}M{middle} 0V{side}' stroke='var(--line)' stroke-width='1.5'/>"
    circles = "".join(
        f"<circle cx='{middle}' cy='{middle}' r='{share * 270:g}' fill='none' stroke='var(--line)' stroke-width='1.5'/>"
        + label(middle + share * 270 * 0.71 + 4, middle - share * 270 * 0.71 - 4, f"{share * reach:.2g} {unit}", 16)
        for share in (0.5, 1.0)
    )
    return figure((side, side), axes + circles + dots(points * scale + middle, 3, opacity=0.55), caption)
