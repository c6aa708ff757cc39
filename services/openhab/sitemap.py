"""The sitemap: a frame per room and per camera, in the plain form that every release of a series reads. Pure.

An item whose name is a word of the grammar cannot be shown: there even the ^ would become part of its name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from services.apartment.home import Item
from services.openhab.cameras import parts
from services.openhab.lines import label, quoted
from services.openhab.site import Camera, Site
from services.openhab.words import SITEMAP_WORDS
from services.states import base_type, plain

ELSEWHERE = "Elsewhere"
DIRECTIONS = {"Left": "←", "Up": "↑", "Down": "↓", "Right": "→", "Stop": "■"}
QUICK = 4  # places that get a button of their own
VIEW_REFRESH_MS = 5000


def text(site: Site) -> str:
    """The whole sitemap."""
    frames = [*_rooms(site), *(frame for camera in site.cameras for frame in _camera(site, camera))]
    body = frames or [_frame("Home", ['Text label="Nothing here yet"'])]
    return "\n".join([f"sitemap apartment label={quoted('Apartment')} {{", *body, "}", ""])


def _frame(title: str, widgets: Iterable[str]) -> str:
    lines = (f"        {one}" for one in widgets)
    return "\n".join([f"    Frame label={quoted(label(title) or 'Room')} {{", *lines, "    }"])


def _rooms(site: Site) -> Iterator[str]:
    home = site.home
    for key in [*home.rooms, None]:
        own = [one for one in home.items if home.room_of(one) == key and one not in SITEMAP_WORDS]
        if own:
            title = home.rooms[key].label if key is not None else ELSEWHERE
            yield _frame(title, [widget(one, home.items[one]) for one in own])


def widget(item_name: str, item: Item) -> str:
    """The widget that fits an item."""
    reference = f"item={item_name}"
    kind = base_type(item.type)
    if kind == "Image":
        return f"Image {reference}"
    if kind == "Location":
        return f"Mapview {reference} height=5"
    if not item.takes_commands:
        return f"Text {reference}"
    if item.options and kind in ("String", "Number"):
        return f"Selection {reference} {mappings(item.options)}"
    if kind == "Number" and item.range is not None:
        return f"Setpoint {reference} {_range(item)}"
    simple = {"Switch": "Switch", "Dimmer": "Slider", "Color": "Colorpicker", "Rollershutter": "Switch"}
    return f"{simple.get(kind, 'Default')} {reference}"


def _range(item: Item) -> str:
    assert item.range is not None
    step = item.range.step or 1.0
    return f"minValue={plain(item.range.min)} maxValue={plain(item.range.max)} step={plain(step)}"


def mappings(options: Mapping[str, str]) -> str:
    """`mappings=["a"="A", ...]`, every command quoted; without states that are empty."""
    listed = ", ".join(f"{quoted(state)}={quoted(words or state)}" for state, words in options.items() if state)
    return f"mappings=[{listed}]" if listed else ""


def _camera(site: Site, camera: Camera) -> Iterator[str]:
    def item(part: str) -> str:
        return f"item={site.names.camera(camera.name, part)}"

    shown = f"visibility=[{site.names.camera(camera.name, 'Stream')}==ON]"
    widgets = [f"Switch {item('Stream')} label={quoted('Stream')}"]
    if camera.stream_url is not None:
        widgets.append(f"Video {item('Stream_Url')} url={quoted(camera.stream_url)} encoding={quoted('mjpeg')} {shown}")
    if camera.snapshot_url is not None:
        widgets.append(f"Image url={quoted(camera.snapshot_url)} refresh={VIEW_REFRESH_MS}")
    else:
        widgets.append(f"Image {item('Snapshot')}")
    if camera.places:
        places = {place: place for place in camera.places}
        quick = {place: place for place in camera.places[:QUICK]}
        widgets.append(f"Selection {item('Place')} label={quoted('Point at')} {mappings(places)}")
        widgets.append(f"Switch {item('Place')} label={quoted('Quick')} {mappings(quick)}")
    widgets.append(f"Switch {item('Move')} label={quoted('Turn')} {mappings(DIRECTIONS)}")
    widgets.append(f"Switch {item('Scan')} label={quoted('Scan for markers')}")
    shown_parts = ("Status", "Motion", "Scan_State", "Scan_Found")
    found = [part.item for part in parts(camera) if part.item.startswith("Marker_")]
    widgets += [f"Text {item(part)}" for part in (*shown_parts, *found)]
    widgets += [f"Switch {item('Privacy')}", f"Switch {item('Take_Snapshot')} {mappings({'ON': 'Take a snapshot'})}"]
    yield _frame(camera.label, widgets)
