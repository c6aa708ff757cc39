"""All files of a site, as texts by their path within OpenHAB's configuration folder. Pure.

Not here: writing them (`folder.py`), and each kind of file, which has a module of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from services.openhab import cameras, dsl, items, javascript, persist, sitemap, things, widgets
from services.openhab.lines import ItemLine, ThingLine, item_text, thing_text
from services.openhab.site import Site

MARK = "Written by `apartment openhab generate` from the model of the home; what is changed here is lost."
COMMENTS = {".yaml": "# {}", ".html": "<!-- {} -->"}  # others: //


def files(site: Site) -> dict[str, str]:
    """Path and text of every file, each with our mark in its first line."""
    return {path: f"{mark(path)}\n\n{text}" for path, text in _files(site)}


def mark(path: str) -> str:
    """The first line of a file of ours."""
    return next((form for end, form in COMMENTS.items() if path.endswith(end)), "// {}").format(MARK)


def left_out(site: Site) -> list[str]:
    """Items by name and things by UID that would be ours, had others' files not taken them."""
    names = {line.name for _, lines in _items(site) for line in lines}
    return sorted(site.taken & (names | {line.uid for _, lines in _things(site) for line in lines}))


def _things(site: Site) -> Iterator[tuple[str, Iterable[ThingLine]]]:
    yield "things/apartment.things", things.lines(site)
    for camera in site.cameras:
        yield f"things/apartment_{camera.name}.things", [cameras.thing(site, camera)]


def _items(site: Site) -> Iterator[tuple[str, Iterable[ItemLine]]]:
    yield "items/apartment.items", items.lines(site)
    for camera in site.cameras:
        yield f"items/apartment_{camera.name}.items", cameras.items(site, camera)


def _files(site: Site) -> Iterator[tuple[str, str]]:
    for path, found in _things(site):
        yield path, _blocks(thing_text(one) for one in found if one.uid not in site.taken)
    for path, lines in _items(site):
        yield path, _blocks(item_text(one) for one in lines if one.name not in site.taken)
    for camera in site.cameras:
        if site.version.major >= 3:
            yield f"widgets/apartment_{camera.name}.yaml", widgets.main_ui(site, camera)
        yield f"html/apartment_{camera.name}.html", widgets.habpanel(site, camera)
    if site.bus == "dsl":
        yield "rules/apartment.rules", dsl.text(site)
    elif site.bus == "js":
        yield "automation/js/apartment.js", javascript.text(site)
    yield "sitemaps/apartment.sitemap", sitemap.text(site)
    if site.persistence is not None:
        yield f"persistence/{site.persistence}.persist", persist.text(site)


def _blocks(texts: Iterable[str]) -> str:
    return "\n".join(texts) + "\n"
