"""Plain fields to the messages of installed ROS types, and back. Needs genpy and the message packages, not rospy.

A text becomes what the field wants: a number (`21.5 °C` too), a boolean (`ON`), a time (ISO 8601). Messages are
serialised here, not by rospy: one that cannot be would leave half of itself in its buffer, and a latched one would
break every later subscriber's connection.
"""

from __future__ import annotations

import importlib
import re
import struct
from collections.abc import Callable, Iterator
from functools import cache
from io import BytesIO
from typing import Any

from services import payloads, states
from services.bridge import definitions
from services.bridge.rules import Fields, Rule
from services.bridge.template import Path, as_text, places
from services.document import Path_
from services.errors import BadMessage

MessageClass = Any  # classes that genpy generated carry no types
TRUE = ("on", "true", "1", "open", "yes")
FALSE = ("off", "false", "0", "closed", "no")
LENGTH = struct.Struct("<I")
ARRAY = re.compile(r"(.+)\[(\d*)\]")


def message_class(name: str) -> MessageClass | None:
    """The class of `diagnostic_msgs/KeyValue`; None when it is neither installed nor declared (`definitions.py`)."""
    return _installed(name) or definitions.known(name)


@cache
def _installed(name: str) -> MessageClass | None:
    package, _, short = name.partition("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), short, None)
    except ImportError:
        return None


@cache
def service_class(name: str) -> MessageClass | None:
    """The class of `std_srvs/Trigger`; None when it is not installed."""
    package, _, short = name.partition("/")
    try:
        return getattr(importlib.import_module(f"{package}.srv"), short, None)
    except ImportError:
        return None


def faults(rule: Rule) -> Iterator[tuple[Path_, str]]:
    """What is wrong with a rule's type and fields, and where in the rule."""
    kind = message_class(rule.type)
    if kind is None:
        yield ("type",), f"expected an installed message type, got {rule.type!r}"
    elif rule.direction == "to_ros":
        yield from _field_faults(kind, rule.fields, ("fields",))
    else:
        for path in (*places(rule.mqtt), *places(rule.payload)):
            if not _has(kind, path):
                yield (), f"expected a field of {rule.type}, got {{{'.'.join(path)}}}"


def build(kind: MessageClass, fields: Fields) -> Any:
    """The message; BadMessage names the field that does not fit."""
    return _message(kind, fields, "")


def on_the_wire(message: Any) -> bytes:
    """A message as rospy's connections carry it, its length before it; BadMessage when it cannot be serialised."""
    buffer = BytesIO()
    buffer.seek(LENGTH.size)
    try:
        message.serialize(buffer)
    except (ValueError, OverflowError) as error:
        raise BadMessage(f"{message._type}: {error}") from error
    except _serialization_error() as error:
        raise BadMessage(f"{message._type}: {error}") from error
    LENGTH.pack_into(buffer.getbuffer(), 0, buffer.tell() - LENGTH.size)
    return buffer.getvalue()


def fields_of(message: Any) -> Fields:
    """The fields of a message as plain values; times in seconds, byte arrays as bytes."""
    return {name: _plain(getattr(message, name)) for name in message.__slots__}


@cache
def _serialization_error() -> type[Exception]:
    error: type[Exception] = importlib.import_module("genpy").SerializationError
    return error


@cache
def _slots(kind: MessageClass) -> dict[str, str]:
    return dict(zip(kind.__slots__, kind._slot_types, strict=True))


def _field_faults(kind: MessageClass, template: Any, where: Path_) -> Iterator[tuple[Path_, str]]:
    slots = _slots(kind)
    for name, part in template.items():
        if name not in slots:
            yield (*where, name), f"expected one of {', '.join(slots)} of {kind._type}, got {name!r}"
        elif isinstance(part, dict) and (inner := message_class(_full(slots[name]))):
            yield from _field_faults(inner, part, (*where, name))
        elif isinstance(part, list) and (array := ARRAY.fullmatch(slots[name])):
            inner = message_class(array[1])
            for index, entry in enumerate(part):
                if inner and isinstance(entry, dict):
                    yield from _field_faults(inner, entry, (*where, name, index))


def _has(kind: MessageClass, path: Path) -> bool:
    for index, name in enumerate(path):
        slots = _slots(kind)
        if name not in slots:
            return False
        if (inner := message_class(_full(slots[name]))) is None:
            return index == len(path) - 1 or ARRAY.fullmatch(slots[name]) is not None
        kind = inner
    return True


def _full(slot: str) -> str:
    return "std_msgs/Header" if slot == "Header" else slot


def _message(kind: MessageClass, fields: Fields, where: str) -> Any:
    slots = _slots(kind)
    message = kind()
    for name, value in fields.items():
        if name not in slots:
            raise BadMessage(f"{where}{name}: expected one of {', '.join(slots)} of {kind._type}")
        setattr(message, name, _value(slots[name], value, where + name))
    return message


def _value(slot: str, value: Any, where: str) -> Any:
    try:
        if array := ARRAY.fullmatch(slot):
            return _array(array[1], value, where)
        if convert := CONVERT.get(slot):
            return convert(value)
    except (ValueError, TypeError, OverflowError, BadMessage) as error:
        raise BadMessage(f"{where}: expected {slot}, got {str(value)[:80]!r} ({error})") from error
    if not isinstance(value, dict):
        raise BadMessage(f"{where}: expected the fields of {slot}, got {str(value)[:80]!r}")
    return _message(message_class(_full(slot)), value, f"{where}.")


def _array(slot: str, value: Any, where: str) -> Any:
    if isinstance(value, bytes) and slot in ("uint8", "char"):
        return value
    if not isinstance(value, list):
        raise TypeError("not a list")
    return [_value(slot, part, f"{where}[{index}]") for index, part in enumerate(value)]


def _boolean(value: Any) -> bool:
    word = as_text(value).lower()
    if word not in TRUE + FALSE:
        raise ValueError(f"neither {'/'.join(TRUE)} nor {'/'.join(FALSE)}")
    return word in TRUE


def _float(value: Any) -> float:
    return states.quantity(value)[0] if isinstance(value, str) else float(value)


def _integer(value: Any) -> int:
    number = _float(value)
    if not number.is_integer():
        raise ValueError("not a whole number")
    return int(value) if isinstance(value, int) else int(number)


def _seconds(value: Any) -> float:
    if not isinstance(value, str):
        return float(value)
    try:
        return payloads.seconds(value)
    except ValueError:
        return _float(value)


def _time(value: Any) -> Any:
    return importlib.import_module("genpy").Time.from_sec(_seconds(value))


def _duration(value: Any) -> Any:
    return importlib.import_module("genpy").Duration.from_sec(_seconds(value))


CONVERT: dict[str, Callable[[Any], Any]] = {
    "string": as_text,
    "bool": _boolean,
    "float32": _float,
    "float64": _float,
    "time": _time,
    "duration": _duration,
    **{f"{sign}int{bits}": _integer for sign in ("", "u") for bits in (8, 16, 32, 64)},
    "byte": _integer,
    "char": _integer,
}


def _plain(value: Any) -> Any:
    if hasattr(value, "to_sec"):
        return value.to_sec()
    if hasattr(value, "_slot_types"):
        return fields_of(value)
    return [_plain(part) for part in value] if isinstance(value, list | tuple) else value
