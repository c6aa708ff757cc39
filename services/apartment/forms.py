"""OpenHAB's forms that a home is written in: types with dimensions, functions of groups, topics, channels, times. Pure.

Each function says what is wrong, or None. The home's model and the checker of OpenHAB's files ask the same ones, so
what `apartment check` takes can be written. Not here: what differs between releases beyond the functions' arguments.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from services.states import ITEM_TYPES

DIMENSIONS = frozenset((
    "Acceleration", "AmountOfSubstance", "Angle", "Area", "ArealDensity", "CalorificValue", "CatalyticActivity",
    "Currency", "DataAmount", "DataTransferRate", "Density", "Dimensionless", "ElectricCapacitance", "ElectricCharge",
    "ElectricConductance", "ElectricConductivity", "ElectricCurrent", "ElectricInductance", "ElectricPotential",
    "ElectricResistance", "EmissionIntensity", "Energy", "EnergyPrice", "Force", "Frequency", "Illuminance",
    "Intensity", "Length", "LuminousFlux", "LuminousIntensity", "MagneticFlux", "MagneticFluxDensity", "Mass", "Power",
    "Pressure", "RadiantExposure", "RadiationDoseAbsorbed", "RadiationDoseEffective", "RadiationSpecificActivity",
    "Radioactivity", "SolidAngle", "Speed", "Temperature", "Time", "Volume", "VolumetricFlowRate",
))  # fmt: skip
FUNCTIONS = ("EQUALITY", "AND", "OR", "NAND", "NOR", "AVG", "SUM", "MAX", "MIN", "COUNT", "LATEST", "EARLIEST")
NEW_FUNCTIONS = ("XOR", "MEDIAN")  # from 4.3 on
ARGUMENTS = {"AND": 2, "OR": 2, "NAND": 2, "NOR": 2, "XOR": 2, "COUNT": 1}
TOPIC_SETTINGS = {  # of a plain MQTT device's item -> of the binding's channel
    "state": "stateTopic", "command": "commandTopic", "transform": "transformationPattern",
    "transform_out": "transformationPatternOut", "on": "on", "off": "off", "stop": "stop",
}  # fmt: skip
STOP_TOPIC = "stopCommandTopic"  # among its other settings: where a shutter hears its stop, if not with its commands
KEY = re.compile(r"[a-zA-Z0-9_][a-zA-Z0-9_-]*")  # of metadata and of settings
SEGMENT = re.compile(r"[A-Za-z0-9_-]+")  # of a UID
CONTROL = re.compile(r"[\0-\x1f\x7f-\x9f]")  # a broker throws out who says a topic with one
SHORT_TIME = re.compile(r"(?:(\d+)h)?\s*(?:(\d+)m)?\s*(?:(\d+)s)?", re.I)
WORDY_TIME = re.compile(
    r"(?:\d+\s*(?:d|days?)\s*)?(?:\d+\s*(?:h|hrs?|hours?)\s*)?(?:\d+\s*(?:m|mins?|minutes?)\s*)?(?:\d+\s*(?:s|secs?|seconds?))?",
    re.I,
)
ISO_TIME = re.compile(r"P(?!$)(?:\d+D)?(?:T(?=\d)(?:\d+H)?(?:\d+M)?(?:\d+(?:\.\d+)?S)?)?")


def item_type(text: str) -> str | None:
    """`Switch`, `Number`, `Number:Temperature`."""
    kind, *rest = text.split(":")
    if kind not in ITEM_TYPES:
        return f"expected a type of item ({', '.join(ITEM_TYPES)} or Group), got {text!r}"
    if rest and (kind != "Number" or len(rest) > 1):
        return f"expected {kind}{':<dimension>' if kind == 'Number' else ' alone'}, got {text!r}"
    if rest and rest[0] not in DIMENSIONS:
        return f"expected a dimension such as Temperature, got {rest[0]!r}"
    return None


def group_state(parts: Sequence[str], arguments: int, functions: Sequence[str] = ()) -> str | None:
    """What stands behind `Group:`, by its colons, with so many arguments; `functions`: all that a release knows."""
    known = functions or (*FUNCTIONS, *NEW_FUNCTIONS)
    base, *more = parts or [""]
    if base and base not in ITEM_TYPES:
        return f"expected the type of the members, got {base!r}"
    if base == "Number" and more and more[0] not in known:
        dimension = more.pop(0)
        if dimension not in DIMENSIONS:
            return f"expected a dimension or a function ({', '.join(known)}), got {dimension!r}"
    if more and (len(more) > 1 or more[0] not in known):
        return f"expected one of {', '.join(known)}, got {':'.join(more)!r}"
    wanted = ARGUMENTS.get(more[0], 0) if more else 0
    if arguments != wanted:
        return f"expected {wanted} arguments of {more[0] if more else 'a group'}, got {arguments}"
    return None


def key(text: str) -> str | None:
    """The namespace of metadata, and the key of a setting."""
    return None if KEY.fullmatch(text) else f"expected a word of letters, digits, _ and -, got {text!r}"


def channel(text: str) -> str | None:
    """`binding:type:thing:channel`, with `group#` before the channel's id where it has one."""
    parts = text.split(":")
    last, _, inner = parts[-1].partition("#")
    if len(parts) < 4:
        return f"expected a channel's UID, binding:type:thing:channel, got {text!r}"
    wrong = [one for one in (*parts[:-1], last, *([inner] if "#" in parts[-1] else [])) if not SEGMENT.fullmatch(one)]
    if wrong:
        return f"expected letters, digits, _ and - between the colons of a UID, got {wrong[0]!r}"
    return None


def mqtt_filter(text: str) -> str | None:
    """A topic that is listened to, perhaps with + and # for whole levels."""
    levels = text.split("/")
    if not text:
        return "expected a topic, got nothing"
    if CONTROL.search(text):
        return f"expected a topic in one line, got {text!r}"
    for index, level in enumerate(levels):
        if ("+" in level and level != "+") or ("#" in level and (level != "#" or index < len(levels) - 1)):
            return f"expected + for a whole level and # for the last one, got {text!r}"
    return None


def mqtt_topic(text: str) -> str | None:
    """A topic that is written to."""
    if not text or "+" in text or "#" in text or CONTROL.search(text):
        return f"expected a topic without + and #, got {text!r}"
    return None


def expire(text: str, *, iso: bool = True, wordy: bool = True) -> str | None:
    """`5m`, `1h30m,UNDEF`, `10s,command=OFF`; `iso` (`PT5M`) from 4.0 on, `wordy` (`1d`, `2 hours`) from 5.0 on."""
    duration = text.partition(",")[0].strip()
    forms = (SHORT_TIME, *([ISO_TIME] if iso else []), *([WORDY_TIME] if wordy else []))
    if duration and any(form.fullmatch(duration) for form in forms):
        return None
    shown = "such as 1h30m" + (" or PT1H30M" if iso else "") + (" or 1d" if wordy else "")
    return f"expected a time {shown}, got {duration!r}"
