"""How firmware differs, as switches. The sets of them that have a name are in `firmwares`.

Sources: the facts about the Amcrest HTTP API (models IP3M-941, IP2M-841, 943B, 1041B and Dahua siblings). What no
source tells and is inferred: all speeds, accelerations and delays but the median latency, units of the relative
positions, what happens with presets and tours that are not stored.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from pydantic import ConfigDict


@dataclass(frozen=True)
class Profile:
    """The defaults are those of the IP3M-941W with firmware of 2016-2019, as far as that is known."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", allow_inf_nan=False)

    model: str = "IP3M-941W"
    firmware: str = "2.420.AC00.15.R"
    built: str = "2016-09-08"
    version_form: Literal["two lines", "one line"] = "two lines"

    auth: Literal["basic", "digest", "digest+basic"] = "digest"
    digest_algorithms: tuple[Literal["MD5", "SHA-256"], ...] = ("MD5",)  # one challenge each
    qop: Literal["auth", "auth,auth-int"] = "auth"
    realm: Literal["serial", "mac", "hex"] = "serial"  # what it ends with
    nonce: Literal["reusable", "single-use", "flaky"] = "reusable"
    stale: bool = True  # it says so when a nonce is refused
    challenge_spacing: Literal["compact", "spaced"] = "compact"  # after the challenge's commas
    header_case: Literal["mixed", "upper"] = "mixed"
    spurious_401: float = 0.0  # of the requests with a good login
    lockout_failures: int = 5
    lockout_s: float = 30 * 60.0
    lockout_of: Literal["account", "address"] = "account"
    max_connections: int = 20
    over_limit: Literal[400, 401] = 401
    brackets: Literal["both", "raw", "encoded"] = "both"
    error_style: Literal["400-body", "200-error", "501"] = "200-error"

    ptz_channels: tuple[int, ...] = (0, 1)
    position_abs: Literal["full", "pan-only", "bad-request"] = "bad-request"
    position_abs_tilt_off: float = 0.0  # degrees beside the goal
    position_relative: Literal["works", "bad-request"] = "bad-request"  # code Position
    moves: Literal["none", "relative", "readings"] = "none"  # moveRelatively; moveAbsolutely and moveDirectly too
    continuously: bool = False  # timed moves
    mirror_inverts_motors: bool = True
    unset_preset: Literal["error", "ok"] = "error"  # what going there is answered
    presets_form: Literal["short", "long"] = "short"
    preset_max: int = 25
    tours: bool = False
    auto_scan: bool = False
    status_form: Literal["a", "b", "c", "newest"] = "a"
    position_key: Literal["Postion", "Position"] = "Postion"
    move_status: Literal["honest", "always-idle", "stuck", "unknown"] = "honest"
    status_dither: bool = False  # a reading at rest is 0.1 more or less at times

    daynight: Literal["VideoInOptions", "VideoInDayNight"] = "VideoInOptions"
    device_class: bool = True  # it answers getDeviceClass
    lens_mask: bool = True  # it can turn the lens away (LeLensMask)
    config_narrowing: bool = True  # a narrowed table name works; otherwise it gives an empty answer
    heartbeat: bool = True
    heartbeat_least_s: int = 1  # asked for more often, it beats so often
    event_form: Literal["A", "B"] = "B"  # A has data
    event_header_twice: bool = False  # a second header block before the first part
    event_length_space: bool = False  # after `Content-Length:`
    event_length_off: int = 0  # what it counts too many (negative: too few); 2 where it counts the line's end
    event_line_before: bool = False  # an empty line stands before the text
    event_blank_lines: int = 0  # more than needed between two parts
    event_writes: Literal["parts", "pieces", "gathered"] = "parts"  # what goes out at once
    event_listeners: int = 25
    onvif: bool = True  # it has the ONVIF services too

    latency_s: float = 0.3  # of each control request
    latency_spread_s: float = 0.1
    latency_tail: float = 0.02  # of the requests take two to three times as long
    status_lag_s: float | None = None  # how old the pose in a status is; None: one latency
    stream_slowdown_s: float = 0.3  # more for each viewer of a stream of more than 2048 kb/s
    snapshot_s: float = 0.5  # of each snapshot
    snapshot_drop: float = 0.0  # of the snapshots end without an answer, or with a text
    boot_s: float = 60.0
    drowsy_s: float = 10.0  # after that it answers, but slowly

    pan_speeds: tuple[float, ...] = (1.0, 3.0, 6.0, 10.0, 16.0, 24.0, 34.0, 45.0)  # degrees/s at speeds 1 to 8
    tilt_share: float = 0.6  # of the pan speed
    pan_acceleration: float = 120.0  # degrees/s^2, and as much when slowing down
    tilt_acceleration: float = 90.0
    zoom_speed: float = 4.0  # of its 8 levels, per second
    zoom_acceleration: float = 40.0
