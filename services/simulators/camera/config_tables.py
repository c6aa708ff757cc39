"""The camera's configuration: an ordered flat map of keys to texts, read by table and written by key. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from services.simulators.camera.defaults import defaults
from services.simulators.camera.profiles import Profile
from services.simulators.true_camera import Lens

Colour = Literal["colour", "auto", "bw"]
LEAST_SIDE, MOST_SIDE = 64, 4096  # of a picture, pixels
PARTS = ("", "NightOptions.", "NormalOptions.")  # of VideoInOptions: by day, by night, in general
MODES: dict[str, Colour] = {"0": "colour", "1": "auto", "2": "bw"}
LOOKS = ("VideoColor", "VideoInDayNight", "VideoInMode", "LeLensMask")  # writing these exposes anew
DAY_NIGHT: dict[str, Colour] = {"Color": "colour", "Brightness": "auto", "BlackWhite": "bw"}


class Tables:
    """The tables of one camera.

    `changes` grows with every write, `encoders` with those that restart the encoders, `looks` with those that change
    how the picture is taken, and with the light; `exposed_at` is when the last of these was.
    """

    def __init__(self, profile: Profile, lens: Lens) -> None:
        self._profile, self._values, self.changes = profile, defaults(profile, lens), 0
        self.encoders = self.looks = 0
        self.exposed_at = float("-inf")

    def read(self, name: str) -> list[str] | None:
        """The lines of a table or a part of it; None when there is no such table."""
        starts = (f"{name}[", f"{name}.")
        lines = [f"table.{key}={value}" for key, value in self._values.items() if key == name or key.startswith(starts)]
        if not lines and name.partition("[")[0].partition(".")[0] not in self._names():
            return None
        narrowed = "[" in name or "." in name
        return [] if narrowed and not self._profile.config_narrowing else lines

    def write(self, pairs: Iterable[tuple[str, str]], now: float = 0.0) -> bool:
        """Sets values; keys it does not have are passed over in silence, as cameras do. False: an unknown table."""
        pairs = list(pairs)
        if not pairs or any(key.partition("[")[0].partition(".")[0] not in self._names() for key, _ in pairs):
            return False
        known = {key: _like(self._values[key], value, key) for key, value in pairs if key in self._values}
        looks = any(_exposes(key) and self._values[key] != value for key, value in known.items())
        self._values |= known
        if looks:
            self.expose(now)
        self.changes += bool(known)
        self.encoders += any(key.startswith("Encode[") for key in known)
        return True

    def expose(self, now: float) -> None:
        """The picture has changed as a whole, so that the camera exposes anew."""
        self.looks, self.exposed_at = self.looks + 1, now

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
    def covered(self) -> bool:
        """Whether the lens is turned away for privacy."""
        return self._values.get("LeLensMask[0].Enable") == "true"

    @property
    def colour(self) -> Colour:
        """What the day and night switch asks for, in the profile that is active."""
        if self._profile.daynight == "VideoInDayNight":
            return DAY_NIGHT.get(self._values[f"VideoInDayNight[0][{self._active}].Mode"], "auto")
        return MODES.get(self._values[f"VideoInOptions[0].{PARTS[self._active]}DayNightColor"], "auto")

    def tone(self, key: str) -> int:
        """Contrast, brightness or saturation of the profile that is active, 0 to 100."""
        return self.number(f"VideoColor[0][{self._active}].{key}")

    @property
    def _active(self) -> int:
        """The profile by which pictures are taken: 0 day, 1 night, 2 general."""
        profile = self.number("VideoInMode[0].Config[0]")
        return profile if profile < len(PARTS) else 0

    def _names(self) -> set[str]:
        return {key.partition("[")[0].partition(".")[0] for key in self._values}


def _exposes(key: str) -> bool:
    return key.startswith(LOOKS) or key.endswith("DayNightColor")


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
