"""How the picture is delivered: flip, mirror, colour (`configManager.cgi`). Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast, get_args

from services.camera.brands.dahua.replies import read_table
from services.camera.device import Mode, Picture, Refused, SetPicture

PICTURE_TABLE = "/cgi-bin/configManager.cgi?action=getConfig&name=VideoInOptions"
MODE_TABLE = "/cgi-bin/configManager.cgi?action=getConfig&name=VideoInDayNight"
PROFILES = ("", "NightOptions.", "NormalOptions.")  # day, night, general; counted from 0 where they have no names
MODES: dict[str, str] = {"color": "0", "auto": "1", "bw": "2"}
MODE_KEYS = tuple(f"VideoInOptions[0].{profile}DayNightColor" for profile in PROFILES)
NEW_MODES: dict[str, str] = {"color": "Color", "auto": "Brightness", "bw": "BlackWhite"}
NEW_MODE_KEYS = tuple(f"VideoInDayNight[0][{profile}].Mode" for profile in range(len(PROFILES)))


def set_picture(request: SetPicture) -> str:
    """Writes the picture's options, brackets as they are: flip and mirror in all profiles, modes in each its own."""
    pairs: dict[str, str] = {}
    for option, flag in (("Flip", request.flip), ("Mirror", request.mirror)):
        if flag is not None:
            pairs |= {f"VideoInOptions[0].{profile}{option}": str(flag).lower() for profile in PROFILES}
    return written(pairs | _pairs(request, MODE_KEYS, MODES) | contrasts(request.contrast))


def set_modes(request: SetPicture) -> str:
    """Writes the modes where newer firmware has them."""
    return written(_pairs(request, NEW_MODE_KEYS, NEW_MODES) | contrasts(request.contrast))


def modes(request: SetPicture) -> tuple[str, ...]:
    """The mode that each profile is to have; "" leaves it."""
    return request.modes or (request.mode or "",) * len(PROFILES)


def _pairs(request: SetPicture, keys: tuple[str, ...], words: Mapping[str, str]) -> dict[str, str]:
    return {key: words.get(mode, mode) for key, mode in zip(keys, modes(request), strict=False) if mode}


def contrasts(values: tuple[int, ...]) -> dict[str, str]:
    """The contrast of each profile, as it is written."""
    return {f"VideoColor[0][{profile}].Contrast": str(value) for profile, value in enumerate(values)}


def written(pairs: Mapping[str, str]) -> str:
    """Writes to tables of the configuration, of any of them at once."""
    return "/cgi-bin/configManager.cgi?action=setConfig&" + "&".join(f"{key}={pairs[key]}" for key in pairs)


def read_picture(options: str, newer: str = "") -> Picture:
    """The picture's options; `newer` is the table of modes of newer firmware, which wins."""
    table = read_table(options)
    flip, mirror = (table.get(f"table.VideoInOptions[0].{option}") for option in ("Flip", "Mirror"))
    if flip is None or mirror is None:
        raise Refused("the camera does not tell how its picture is flipped")
    told = _told(read_table(newer), NEW_MODE_KEYS, NEW_MODES) or _told(table, MODE_KEYS, MODES)
    by_day = told[0] if told and told[0] in get_args(Mode) else "auto"
    return Picture(flip == "true", mirror == "true", cast(Mode, by_day), told)


def _told(table: Mapping[str, str], keys: tuple[str, ...], words: Mapping[str, str]) -> tuple[str, ...]:
    """The mode of each profile; none at all where the table has none."""
    ours = {word: mode for mode, word in words.items()}
    told = [table.get(f"table.{key}", "") for key in keys]
    each = tuple(ours.get(word, word if word.isalnum() else "") for word in told)  # it may go into a request again
    return each if any(each) else ()
