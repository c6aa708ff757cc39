"""The camera's configuration: an ordered flat map of keys to texts, read by table and written by key. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from services.simulators.camera.profiles import Profile
from services.simulators.true_camera import Lens

Colour = Literal["colour", "auto", "bw"]
LEAST_SIDE, MOST_SIDE = 64, 4096  # of a picture, pixels
SUB_WIDTH = 704  # the substream's; its height follows the main stream's shape
MODES: dict[str, Colour] = {"0": "colour", "1": "auto", "2": "bw"}
DAY_NIGHT: dict[str, Colour] = {"Color": "colour", "Brightness": "auto", "BlackWhite": "bw"}


def _options(profile: Profile) -> dict[str, str]:
    table = {}
    for part in ("", "NightOptions.", "NormalOptions."):
        for key, value in (("DayNightColor", "1"), ("Flip", "true"), ("Mirror", "true")):
            table[f"VideoInOptions[0].{part}{key}"] = value
    table["VideoInOptions[0].InfraRed"] = "false"
    table["VideoInOptions[0].NightOptions.SwitchMode"] = "0"
    table["VideoInOptions[0].Rotate90"] = "0"
    if profile.daynight == "VideoInDayNight":
        table = {key: value for key, value in table.items() if not key.endswith("DayNightColor")}
        table |= {f"VideoInDayNight[0][{p}].Mode": "Brightness" for p in range(3)}
    return table


def _colours() -> dict[str, str]:
    return {
        f"VideoColor[0][{p}].{key}": "50" for p in range(3) for key in ("Brightness", "Contrast", "Hue", "Saturation")
    }


def _encoders(lens: Lens) -> dict[str, str]:
    table: dict[str, str] = {}
    sizes = {"MainFormat": (lens.width, lens.height), "ExtraFormat": (SUB_WIDTH, SUB_WIDTH * lens.height // lens.width)}
    for name, (width, height) in sizes.items():
        video: dict[str, object] = {
            "BitRate": 1024,
            "BitRateControl": "VBR",
            "Compression": "H.264",
            "FPS": 10,
            "GOP": 20,
        }
        video |= {"Height": height, "Quality": 4, "Width": width}
        start = f"Encode[0].{name}[0]."
        table |= {f"{start}Video.{key}": str(value) for key, value in video.items()}
        table |= {f"{start}VideoEnable": "true", f"{start}AudioEnable": "true"}
        table |= {f"{start}Audio.Compression": "G.711A", f"{start}Audio.Frequency": "8000"}
    return table


def _motion() -> dict[str, str]:
    switches = {"Enable": "true", "EventHandler.Dejitter": "5", "Level": "3", "RecordEnable": "false"}
    return {f"MotionDetect[0].{key}": value for key, value in switches.items()}


def defaults(profile: Profile, lens: Lens) -> dict[str, str]:
    """What a camera that was hung from a ceiling and set up holds."""
    return {
        "General.LocalNo": "8",
        "General.MachineName": "Camera1",
        **_options(profile),
        **_colours(),
        **_motion(),
        **_encoders(lens),
        "RTSP.Enable": "true",
        "RTSP.Port": "554",
    }


class Tables:
    """The tables of one camera; `changes` grows with every write, `encoders` with those to the Encode table."""

    def __init__(self, profile: Profile, lens: Lens) -> None:
        self._profile, self._values, self.changes = profile, defaults(profile, lens), 0
        self.encoders = 0

    def read(self, name: str) -> list[str] | None:
        """The lines of a table or a part of it; None when there is no such table."""
        starts = (f"{name}[", f"{name}.")
        lines = [f"table.{key}={value}" for key, value in self._values.items() if key == name or key.startswith(starts)]
        if not lines and name.partition("[")[0].partition(".")[0] not in self._names():
            return None
        narrowed = "[" in name or "." in name
        return [] if narrowed and not self._profile.config_narrowing else lines

    def write(self, pairs: Iterable[tuple[str, str]]) -> bool:
        """Sets values; keys it does not have are passed over in silence, as cameras do. False: an unknown table."""
        pairs = list(pairs)
        if not pairs or any(key.partition("[")[0].partition(".")[0] not in self._names() for key, _ in pairs):
            return False
        known = {key: _like(self._values[key], value, key) for key, value in pairs if key in self._values}
        self._values |= known
        self.changes += bool(known)
        self.encoders += any(key.startswith("Encode[") for key in known)
        return True

    def fix(self, key: str, value: str) -> None:
        """What the camera knows of itself."""
        self._values[key] = value

    def text(self, key: str) -> str:
        """One value; KeyError when the camera has none."""
        return self._values[key]

    def flag(self, key: str) -> bool:
        """One true/false value."""
        return self._values[key] == "true"

    def number(self, key: str) -> int:
        """One whole number."""
        return int(self._values[key])

    @property
    def colour(self) -> Colour:
        """What the day and night switch asks for."""
        if self._profile.daynight == "VideoInDayNight":
            return DAY_NIGHT.get(self._values["VideoInDayNight[0][0].Mode"], "auto")
        return MODES.get(self._values["VideoInOptions[0].DayNightColor"], "auto")

    def _names(self) -> set[str]:
        return {key.partition("[")[0].partition(".")[0] for key in self._values}


def _like(old: str, new: str, key: str) -> str:
    """A written value in the form of the old one; nonsense leaves the old, numbers out of range are clamped."""
    if old in ("true", "false"):
        return new.lower() if new.lower() in ("true", "false") else old
    return _whole(old, new, key) if old.isdigit() else new


def _whole(old: str, new: str, key: str) -> str:
    """A number within what the camera can do; a picture's sides are even and not too small."""
    if not new.lstrip("-").isdigit():
        return old
    if key.endswith(("Video.Width", "Video.Height")):
        return str(int(new) // 2 * 2) if LEAST_SIDE <= int(new) <= MOST_SIDE else old
    return str(min(max(int(new), 0), 100)) if key.startswith("VideoColor") else str(max(int(new), 0))
