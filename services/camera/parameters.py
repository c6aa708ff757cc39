"""A ROS node's `parameters.yaml`, as the report has one, read as it is: it stands for the settings that are not given.

The keys of such files are nobody's standard: each setting here has the names that are used for it, without regard to
case, `-` and `_`, under any namespace. What has no such name is told and left out. The settings are in `settings.py`.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from services import document
from services.errors import ConfigError

ARUCO = (  # OpenCV's numbers of the dictionaries, as `aruco_detect` is given them
    *(f"DICT_{side}X{side}_{count}" for side in (4, 5, 6, 7) for count in (50, 100, 250, 1000)),
    "DICT_ARUCO_ORIGINAL", "DICT_APRILTAG_16h5", "DICT_APRILTAG_25h9", "DICT_APRILTAG_36h10", "DICT_APRILTAG_36h11",
)  # fmt: skip
log = logging.getLogger(__name__)


def _dictionary(value: Any) -> str:
    return ARUCO[int(value)] if str(value).isdigit() and int(value) < len(ARUCO) else str(value)


def _list(value: Any) -> list[Any]:
    if isinstance(value, str):
        return [part.strip() for part in value.split(",") if part.strip()]
    return list(value) if isinstance(value, (list, tuple)) else [value]


def _numbers(value: Any) -> list[int]:
    return [int(one) for one in _list(value)]


def _bool(value: Any) -> bool:
    return str(value).strip().lower() in ("true", "1", "on", "yes")


def _turns(value: Any) -> str:
    return "always" if _bool(value) or int(value) > 1 else "never"


def _file(value: Any) -> str:
    return str(value).removeprefix("file://")


Setting = tuple[str, ...]
NAMES: dict[Setting, tuple[tuple[str, ...], Callable[[Any], Any]]] = {
    ("host",): (("ip", "ipaddress", "cameraip", "host", "hostname", "camerahost", "address"), str),
    ("port",): (("port", "httpport"), int),
    ("rtsp_port",): (("rtspport",), int),
    ("user",): (("user", "username", "login", "camerauser"), str),
    ("password",): (("password", "passwd", "pass", "camerapassword"), str),
    ("camera_info",): (("camerainfo", "camerainfourl", "camerainfofile", "calibration", "calibrationfile"), _file),
    ("dictionary",): (("dictionary", "arucodictionary", "arucodict", "dict", "dictionaryid"), _dictionary),
    ("markers", "size"): (("markersize", "markerlength", "fiduciallen", "arucosize", "markerlen"), float),
    ("targets",): (("target", "targets", "targetid", "targetids", "markerid", "markerids", "arucoid"), _numbers),
    ("frames",): (("frames", "numframes", "nframes", "k", "images", "framesperplace", "framesperpreset"), int),
    ("settle_s",): (("delay", "scandelay", "wait", "waittime", "delays", "settle", "settles", "movedelay"), float),
    ("second_turn",): (("turns", "numturns", "scanturns", "twoturns"), _turns),
    ("routine",): (("routine", "order", "scanorder", "presetorder", "presets", "places"), _list),
    ("diagnostics",): (("diagnostics", "diagnostic", "enablediagnostics", "publishdiagnostics"), _bool),
    ("alarm",): (("alarm", "motionalarm", "enablealarm", "alarmenabled", "motiondetection"), _bool),
    ("picture", "flip"): (("flip", "flipimage"), _bool),
    ("picture", "mirror"): (("mirror", "mirrorimage"), _bool),
}  # fmt: skip
KNOWN = {name: (setting, read) for setting, (names, read) in NAMES.items() for name in names}


def read(file: Path) -> dict[str, Any]:
    """What the file says, as a camera's settings (nested as they are); ConfigError with every fault, file and line."""
    source = document.read(file)
    found: dict[str, Any] = {}
    for path, value in _leaves(source.value, ()):
        known = KNOWN.get(re.sub(r"[^a-z0-9]", "", str(path[-1]).lower()))
        if known is None:
            log.warning("%s: %s: not known, left out", source.where(path), path[-1])
            continue
        setting, convert = known
        try:
            _put(found, setting, convert(value))
        except (TypeError, ValueError):
            source.fault(path, f"expected a value for {'.'.join(setting)}, got {value!r:.80}")
    if source.faults:
        raise ConfigError(source.faults)
    return _with_url(found)


def _leaves(value: Any, path: document.Path_) -> Iterator[tuple[document.Path_, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(inner, (*path, key))
    elif path and value is not None:
        yield path, value


def _put(found: dict[str, Any], setting: Setting, value: Any) -> None:
    for key in setting[:-1]:
        found = found.setdefault(key, {})
    found[setting[-1]] = value


def _with_url(found: dict[str, Any]) -> dict[str, Any]:
    """The camera's address from host and port."""
    host, port = found.pop("host", None), found.pop("port", 80)
    if host is not None:
        host = host if "://" in host else f"http://{host}"
        found["url"] = host if port == 80 else f"{host}:{port}"
    return found
