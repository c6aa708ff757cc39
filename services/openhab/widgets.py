"""A camera for the other interfaces of OpenHAB: a widget of the Main UI (3 and later), a template for HABPanel. Pure.

Both are texts to paste, since neither interface reads files; sitemaps are for Basic UI and the apps.
"""

from __future__ import annotations

from html import escape

from services.openhab.lines import quoted
from services.openhab.site import Camera, Site


def main_ui(site: Site, camera: Camera) -> str:
    """A personal widget: the picture while the stream is on, and a button per place. YAML."""
    stream, place = site.names.camera(camera.name, "Stream"), site.names.camera(camera.name, "Place")
    url = site.names.camera(camera.name, "Stream_Url")
    shown = f"=items.{stream}.state === 'ON'"
    lines = [
        f"uid: apartment_{camera.name}",
        "tags: []",
        "props:",
        "  parameters: []",
        "component: f7-card",
        "config:",
        f"  title: {quoted(camera.label)}",
        "slots:",
        "  default:",
        "    - component: oh-image",  # browsers show a multipart JPEG as an image; as a video none plays it
        "      config:",
        f"        visible: {quoted(shown)}",
        f"        item: {url}",
        "        style:",
        "          width: 100%",
        "    - component: oh-toggle",
        "      config:",
        f"        item: {stream}",
    ]
    for name in camera.places:
        lines += [
            "    - component: oh-button",
            "      config:",
            f"        text: {quoted(name)}",
            "        action: command",
        ]
        lines += [f"        actionItem: {place}", f"        actionCommand: {quoted(name)}"]
    return "\n".join([*lines, ""])


def habpanel(site: Site, camera: Camera) -> str:
    """A template widget: the same for HABPanel."""
    stream, place = site.names.camera(camera.name, "Stream"), site.names.camera(camera.name, "Place")
    url = site.names.camera(camera.name, "Stream_Url")
    buttons = [
        f"  <button ng-click=\"sendCmd('{place}', '{_js(name)}')\">{escape(name)}</button>" for name in camera.places
    ]
    lines = [
        f"<h3>{escape(camera.label)}</h3>",
        f"<img ng-if=\"itemValue('{stream}') == 'ON'\" ng-src=\"{{{{itemValue('{url}')}}}}\" style=\"width: 100%\">",
        f"<button ng-click=\"sendCmd('{stream}', itemValue('{stream}') == 'ON' ? 'OFF' : 'ON')\">Stream</button>",
        "<div>",
        *buttons,
        "</div>",
    ]
    return "\n".join([*lines, ""])


def _js(text: str) -> str:
    """A text within quotes of JavaScript within an attribute of HTML."""
    return escape(text.replace("\\", "\\\\").replace("'", "\\'"))
