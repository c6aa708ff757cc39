"""What the configuration tables of a camera hold that was hung from a ceiling and set up: keys and texts. Pure.

The names of most tables are read in documents and clients; the values, and some keys (those of LoginFailureAlarm, NTP,
Locales and StorageGroup), are inferred.
"""

from __future__ import annotations

from services.simulators.camera.profiles import Profile
from services.simulators.true_camera import Lens

SUB_WIDTH = 704  # the substream's; its height follows the main stream's shape


def _options(profile: Profile) -> dict[str, str]:
    """By day as the light is, by night black and white."""
    table = {}
    for part, colour in (("", "1"), ("NightOptions.", "2"), ("NormalOptions.", "1")):
        for key, value in (("DayNightColor", colour), ("Flip", "true"), ("Mirror", "true")):
            table[f"VideoInOptions[0].{part}{key}"] = value
    table["VideoInOptions[0].InfraRed"] = "false"
    table["VideoInOptions[0].NightOptions.SwitchMode"] = "0"
    table["VideoInOptions[0].Rotate90"] = "0"
    if profile.daynight == "VideoInDayNight":
        table = {key: value for key, value in table.items() if not key.endswith("DayNightColor")}
        modes = ("Brightness", "BlackWhite", "Brightness")
        table |= {f"VideoInDayNight[0][{p}].Mode": mode for p, mode in enumerate(modes)}
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


def _mode() -> dict[str, str]:
    values = {"VideoInMode[0].Config[0]": "0", "VideoInMode[0].Mode": "0"}
    return values | {"VideoInMode[0].TimeSection[0][0]": "0 00:00:00-24:00:00", "LightGlobal[0].Enable": "true"}


def _sound() -> dict[str, str]:
    values = {"AudioOutputVolume[0]": "80", "AudioInputVolume[0]": "50"}
    return values | {"AudioDetect[0].MutationDetect": "false", "AudioDetect[0].MutationThreold": "50"}


def _storage() -> dict[str, str]:
    values = {"RecordMode[0].Mode": "0", "RecordMode[0].ModeExtra1": "2"}
    return values | {"StorageGroup[0].Name": "ReadWrite", "StorageGroup[0].OverWrite": "true"}


def _clock() -> dict[str, str]:
    values = {"NTP.Address": "pool.ntp.org", "NTP.Enable": "false", "NTP.Port": "123", "NTP.TimeZone": "0"}
    values |= {"NTP.UpdatePeriod": "10", "Locales.DSTEnable": "false"}
    return values | {"Locales.TimeFormat": "yyyy-MM-dd HH:mm:ss"}


def _network(profile: Profile) -> dict[str, str]:
    values = {"T2UServer.Enable": "true", "Telnet.Enable": "false", "UserGlobal.OnvifLoginCheck": "true"}
    values |= {"LoginFailureAlarm.Enable": "true"}
    return values | {"LoginFailureAlarm.TryLoginTimes": str(profile.lockout_failures)}


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
        **_mode(),
        **_sound(),
        **_storage(),
        **_clock(),
        **_network(profile),
        **({"LeLensMask[0].Enable": "false"} if profile.lens_mask else {}),
    }
