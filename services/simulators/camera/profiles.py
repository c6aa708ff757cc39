"""How firmware differs, as switches; a profile is one set of them.

Sources and what is inferred: the Amcrest HTTP API facts (models IP3M-941, IP2M-841, 943B, 1041B and Dahua siblings).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Profile:
    """The defaults are those of the IP3M-941W with firmware of 2016-2019, as far as that is known."""

    model: str = "IP3M-941W"
    firmware: str = "2.420.AC00.15.R"
    built: str = "2016-09-08"
    version_form: Literal["two lines", "one line"] = "two lines"
    auth: Literal["basic", "digest", "digest+basic"] = "digest"
    nonce: Literal["reusable", "single-use", "flaky"] = "reusable"
    spaced_challenge: bool = False  # a space after the challenge's commas
    lockout_failures: int = 5
    lockout_s: float = 30 * 60.0
    ptz_channels: tuple[int, ...] = (0, 1)
    position_abs: Literal["full", "pan-only", "bad-request"] = "bad-request"
    status_form: Literal["a", "b", "c"] = "a"
    position_key: Literal["Postion", "Position"] = "Postion"
    mirror_inverts_motors: bool = True
    error_style: Literal["400-body", "200-error", "501"] = "200-error"
    daynight: Literal["VideoInOptions", "VideoInDayNight"] = "VideoInOptions"
    device_class: bool = True  # it answers getDeviceClass
    lens_mask: bool = True  # it can turn the lens away (LeLensMask)
    config_narrowing: bool = True  # a narrowed table name works; otherwise it gives an empty answer
    heartbeat: bool = True
    event_form: Literal["A", "B"] = "B"  # A has data
    event_header_twice: bool = False  # a second header block before the first part
    event_length_space: bool = False  # after `Content-Length:`
    event_blank_lines: int = 0  # more than needed between two parts
    event_listeners: int = 25
    onvif: bool = True  # it has the ONVIF services too
    latency_s: float = 0.3  # of each control request
    latency_spread_s: float = 0.1
    latency_tail: float = 0.02  # of the requests take two to three times as long
    status_lag_s: float | None = None  # how old the pose in a status is; None: one latency
    snapshot_s: float = 0.5  # of each snapshot
    boot_s: float = 60.0
    pan_speeds: tuple[float, ...] = (1.0, 3.0, 6.0, 10.0, 16.0, 24.0, 34.0, 45.0)  # degrees/s at speeds 1 to 8
    tilt_share: float = 0.6  # of the pan speed
    pan_acceleration: float = 120.0  # degrees/s^2, and as much when slowing down; all of these are inferred
    tilt_acceleration: float = 90.0
    zoom_speed: float = 4.0  # of its 8 levels, per second
    zoom_acceleration: float = 40.0
    preset_max: int = 25


PROFILES: dict[str, Profile] = {
    "ip3m-941w-2019": Profile(),
    "ip2m-841b-strict": Profile(
        model="IP2M-841B",
        auth="basic",
        device_class=False,
        lens_mask=False,
        ptz_channels=(1,),
        status_form="b",
        error_style="400-body",
    ),
    "2020s-dahua": Profile(
        model="IPC-AW46WN",
        firmware="2.800.0000016.0.R",
        built="2020-06-05",
        version_form="one line",
        nonce="single-use",
        spaced_challenge=True,
        ptz_channels=(1,),
        error_style="501",
        daynight="VideoInDayNight",
        position_abs="full",
        event_form="A",
        event_header_twice=True,
        event_length_space=True,
    ),
}
