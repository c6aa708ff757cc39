"""How the picture is delivered: flip, mirror, colour (`configManager.cgi`). Pure."""

from __future__ import annotations

from collections.abc import Mapping

from services.camera.brands.dahua.replies import read_table
from services.camera.device import Mode, Picture, Refused, SetPicture

MODES: dict[Mode, int] = {"color": 0, "auto": 1, "bw": 2}
PICTURE_TABLE = "/cgi-bin/configManager.cgi?action=getConfig&name=VideoInOptions"
MODE_TABLE = "/cgi-bin/configManager.cgi?action=getConfig&name=VideoInDayNight"
PROFILES = ("", "NightOptions.", "NormalOptions.")
NEW_MODES: dict[Mode, str] = {"color": "Color", "auto": "Brightness", "bw": "BlackWhite"}


def set_picture(request: SetPicture) -> str:
    """Writes the picture's options in all profiles, brackets as they are."""
    wanted: list[tuple[str, str]] = []
    for option, flag in (("Flip", request.flip), ("Mirror", request.mirror)):
        if flag is not None:
            wanted += [(f"{profile}{option}", str(flag).lower()) for profile in PROFILES]
    if request.mode is not None:
        wanted += [(f"{profile}DayNightColor", str(MODES[request.mode])) for profile in PROFILES]
    pairs = {f"VideoInOptions[0].{key}": value for key, value in wanted}
    return written(pairs | contrasts(request.contrast))


def set_mode(mode: Mode, contrast: tuple[int, ...] = ()) -> str:
    """Writes the mode where newer firmware has it."""
    modes = {f"VideoInDayNight[0][{profile}].Mode": NEW_MODES[mode] for profile in range(3)}
    return written(modes | contrasts(contrast))


def contrasts(values: tuple[int, ...]) -> dict[str, str]:
    """The contrast of each profile, as it is written."""
    return {f"VideoColor[0][{profile}].Contrast": str(value) for profile, value in enumerate(values)}


def written(pairs: Mapping[str, str]) -> str:
    """Writes to tables of the configuration, of any of them at once."""
    return "/cgi-bin/configManager.cgi?action=setConfig&" + "&".join(f"{key}={pairs[key]}" for key in pairs)


def read_picture(options: str, modes: str = "") -> Picture:
    """The picture's options; `modes` is the table of newer firmware, which wins."""
    table = read_table(options)
    prefix = "table.VideoInOptions[0]."
    if f"{prefix}Flip" not in table or f"{prefix}Mirror" not in table:
        raise Refused("the camera does not tell how its picture is flipped")
    by_number = {str(number): mode for mode, number in MODES.items()}
    by_word = {word: mode for mode, word in NEW_MODES.items()}
    mode = by_number.get(table.get(f"{prefix}DayNightColor", ""), "auto")
    mode = by_word.get(read_table(modes).get("table.VideoInDayNight[0][0].Mode", ""), mode)
    return Picture(table[f"{prefix}Flip"] == "true", table[f"{prefix}Mirror"] == "true", mode)
