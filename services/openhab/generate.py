"""All files of a site, as texts by their path within OpenHAB's configuration folder. Pure.

Not here: writing them (`folder.py`), and each kind of file, which has a module of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from services.openhab import cameras, dsl, items, javascript, persist, sitemap, things, widgets
from services.openhab.lines import item_text, thing_text
from services.openhab.site import Site

MARK = "Written by `apartment openhab generate` from the model of the home; what is changed here is lost."
COMMENTS = {".yaml": "# {}", ".html": "<!-- {} -->"}  # others: //


def files(site: Site) -> dict[str, str]:
    """Path and text of every file, each with our mark in its first line."""
    return {path: f"{mark(path)}\n\n{text}" for path, text in _files(site)}


def mark(path: str) -> str:
    """The first line of a file of ours."""
    return next((form for end, form in COMMENTS.items() if path.endswith(end)), "// {}").format(MARK)


def _files(site: Site) -> Iterator[tuple[str, str]]:
    yield "things/apartment.things", _blocks(thing_text(one) for one in things.lines(site))
    yield "items/apartment.items", _blocks(item_text(one) for one in items.lines(site))
    for camera in site.cameras:
        yield f"things/apartment_{camera.name}.things", _blocks([thing_text(cameras.thing(site, camera))])
        own = (line for line in cameras.items(site, camera) if line.name not in site.taken)
        yield f"items/apartment_{camera.name}.items", _blocks(item_text(one) for one in own)
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
