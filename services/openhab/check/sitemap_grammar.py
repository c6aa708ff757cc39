"""The grammar of sitemaps, per release, and which widget may and must have what. Pure.

Keys include their equals sign, as in OpenHAB: a blank before it makes two words of it. Up to 5.1 lists include their
bracket too. What came when: `SINCE`.
"""

from __future__ import annotations

from services.openhab.check.reading import COMMENTS, LOOSE_STRING
from services.openhab.versions import Version

FIRST, V40, V41, V42, V43 = Version(2, 5), Version(4, 0), Version(4, 1), Version(4, 2), Version(4, 3)
LISTS = {"mappings": "mapping", "buttons": "button", "labelcolor": "color", "valuecolor": "color", "iconcolor": "color",
         "visibility": "conditions"}  # fmt: skip
VALUES = {  # key -> what stands behind it
    "item": "ID",
    "label": "(ID | STRING)",
    "icon": "icon",
    "staticIcon": "icon",
    "url": "STRING",
    "encoding": "STRING",
    "service": "STRING",
    "separator": "STRING",
    "inputHint": "STRING",
    "yAxisDecimalPattern": "STRING",
    "interpolation": "STRING",
    "refresh": "INT",
    "height": "INT",
    "sendFrequency": "INT",
    "row": "INT",
    "column": "INT",
    "period": 'ID ("-" ID)?',
    "legend": '("true" | "false")',
    "forceasitem": '("true" | "false")',
    "minValue": "numeral",
    "maxValue": "numeral",
    "step": "numeral",
    "click": "command",
    "release": "command",
}
FLAGS = ("switchSupport", "releaseOnly", "stateless")
SINCE: dict[str, Version] = {
    "staticIcon": V41,
    "inputHint": V40,
    "yAxisDecimalPattern": Version(3, 3),
    "forceasitem": Version(3, 0),
    "interpolation": V43,
    "row": V42,
    "column": V42,
    "click": V42,
    "release": V42,
    "stateless": V42,
    "releaseOnly": V42,
    "buttons": V41,
    "iconcolor": Version(3, 0),
    "Input": V40,
    "Buttongrid": V41,
    "Button": V42,
    "Colortemperaturepicker": V43,
}
UNTIL = {"List": V40, "separator": V40, "sendFrequency": Version(5, 0)}  # the first release without it
SHARED = "item label icon staticIcon labelcolor valuecolor iconcolor visibility"
WIDGETS = {  # widget -> what it may have besides, and what it must have
    "Frame": ("", ""),
    "Text": ("", ""),
    "Group": ("", "item"),
    "Image": ("url refresh", ""),
    "Buttongrid": ("buttons", ""),
    "Switch": ("mappings", "item"),
    "Selection": ("mappings", "item"),
    "Slider": ("sendFrequency switchSupport releaseOnly minValue maxValue step", "item"),
    "List": ("separator", "item separator"),
    "Setpoint": ("minValue maxValue step", "item"),
    "Video": ("url encoding", "url"),
    "Chart": ("service refresh period legend forceasitem yAxisDecimalPattern interpolation", "item period"),
    "Webview": ("height url", "url"),
    "Colorpicker": ("sendFrequency", "item"),
    "Colortemperaturepicker": ("minValue maxValue", "item"),
    "Mapview": ("height", "item"),
    "Input": ("inputHint", "item"),
    "Button": ("row column stateless click release", "item row column click"),
    "Default": ("height", "item"),
}
LINKABLE = ("Text", "Group", "Image", "Frame", "Buttongrid")
COMMON = r"""
start: "sitemap" ID (LABEL_KEY STRING)? (ICON_KEY STRING)? "{" widget+ "}"
mapping_label: ID | STRING
command: numeral | ID | STRING
numeral: "-"? (INT | FLOAT)
state: INT | ID | STRING | FLOAT
!operator: "==" | ">" | "<" | ">=" | "<=" | "!="
!sign: "-" | "+"
color: conditions "=" STRING | STRING
button: INT ":" INT ":" command "=" mapping_label ("=" icon)?
INT.-1: /[0-9]+/
FLOAT.3: /[0-9]+\.[0-9]+/
ID: /\^?[a-zA-Z_][a-zA-Z0-9_]*|[0-9]+[a-zA-Z_][a-zA-Z0-9_]*/
LABEL_KEY.2: "label="
ICON_KEY.2: "icon="
"""


def knows(version: Version, word: str) -> bool:
    """Whether a release has a widget or a key."""
    return version >= SINCE.get(word, FIRST) and not (word in UNTIL and version >= UNTIL[word])


def grammar(version: Version) -> str:
    """The grammar of a release."""
    linkable = [name for name in LINKABLE if knows(version, name) and (name != "Buttongrid" or version >= V42)]
    others = [name for name in WIDGETS if knows(version, name) and name not in linkable]
    return "\n".join(
        [
            COMMON,
            'widget: linkable attribute* ("{" widget+ "}")? | other attribute*',
            "!linkable: " + " | ".join(f'"{name}"' for name in linkable),
            "!other: " + " | ".join(f'"{name}"' for name in others),
            *_attributes(version),
            *_parts(version),
            COMMENTS,
            LOOSE_STRING,
        ]
    )


def _attributes(version: Version) -> list[str]:
    rules: list[str] = []
    terminals: list[str] = []
    for key, value in VALUES.items():
        if knows(version, key):
            rules.append(f"a_{key.lower()}")
            terminals.append(f"{rules[-1]}: {_key(terminals, key)} {value}")
    lists = {**LISTS, **({"icon": "icon_rule"} if version >= V41 else {})}
    for key, element in lists.items():
        if knows(version, key):
            rules.append(f"l_{key.lower()}")
            opening = f'{_key(terminals, key)} "["' if version.free_sitemap else _key(terminals, key, "[")
            terminals.append(f'{rules[-1]}: {opening} {element} ("," {element})* "]"')
    for flag in FLAGS:
        if knows(version, flag):
            rules.append(f"f_{flag.lower()}")
            terminals.append(f'{rules[-1]}: "{flag}"')
    return [f"attribute: {' | '.join(rules)}", *dict.fromkeys(terminals)]


def _key(terminals: list[str], key: str, bracket: str = "") -> str:
    """The terminal of a key with its equals sign, perhaps with the bracket; defined when it is first used."""
    name = f"{key.upper()}_KEY{'_LIST' if bracket else ''}"
    if name not in ("LABEL_KEY", "ICON_KEY"):
        terminals.append(f'{name}.{3 if bracket else 2}: "{key}={bracket}"')
    return name


def _parts(version: Version) -> list[str]:
    """What lists are made of."""
    icon = 'icon: STRING | (ID ":" (ID ":")?)? (ID "-")* ID' if version.major >= 4 else "icon: STRING | ID"
    if version >= V41:
        conditions = ['conditions: condition ("AND" condition)*', "condition: (ID? operator)? sign? state | ID state"]
    else:
        conditions = ["conditions: condition", "condition: (ID? operator)? sign? state"]
    shown = ' ("=" icon)?' if version >= V41 else ""
    release = ' (":" command)?' if version >= V42 else ""
    mapping = f'mapping: command{release} "=" mapping_label{shown}'
    return [icon, *conditions, mapping, 'icon_rule: conditions "=" icon | icon']
