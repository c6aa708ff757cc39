"""What can be read without changing anything: identity, tables, forms of answers, capabilities, pictures, the clock."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from typing import Any

from services.camera.brands.dahua import errands, ptz, system
from services.camera.brands.dahua.capabilities import EVENTS, status_form
from services.camera.brands.dahua.replies import read_table
from services.camera.device import Refused
from services.camera.probe.findings import Findings, share
from services.camera.probe.wire import PICTURE, Exchange, Wire

CONFIG = "/cgi-bin/configManager.cgi?action=getConfig&name="
NARROW = "VideoInOptions[0]"
SNAPSHOTS = 3  # tries: some are dropped now and then
ASKED = 20  # status readings for the latency
NO_RIGHT = "the account has no right to ask for it"
CLOCK = "/cgi-bin/global.cgi?action=getCurrentTime"
ALSO = {"events getCaps": EVENTS, "storage": errands.STORAGE, "VideoColor": f"{CONFIG}VideoColor"}  # for the fixtures


def identity(wire: Wire, found: Findings) -> None:
    """Model, serial number, firmware."""
    table = {key: value for action in ("getDeviceType", "getSerialNo", "getVendor", "getMachineName")
             for key, value in read_table(wire.ask(system.magic(action), action).text).items()}  # fmt: skip
    found.model, found.serial = table.get("type", ""), table.get("sn", "")
    found.vendor, found.name = table.get("vendor", ""), table.get("name", "")
    version = wire.ask(system.magic("getSoftwareVersion"), "getSoftwareVersion").text
    found.firmware, _, found.built = system.read_version(version).partition(" ")
    kind = wire.ask(system.magic("getDeviceClass"), "getDeviceClass")
    found.switches["device_class"] = kind.good and "lass=" in kind.text
    found.brand = "amcrest"
    found.switches |= {"version_form": "one line" if "build:" in version else "two lines"}


def refusals(wire: Wire, found: Findings) -> None:
    """How it says no: asked for something that no camera has."""
    answer = wire.ask("/cgi-bin/magicBox.cgi?action=getNoSuchThing", "unknown action")
    found.switches["error_style"] = read_error_style(answer)


def read_error_style(answer: Exchange) -> str | None:
    """The firmware's way to refuse. Pure."""
    word = answer.text.split()[:1] == ["Error"]
    return {(400, True): "400-body", (200, True): "200-error", (501, True): "501"}.get((answer.status, word))


def brackets(wire: Wire, found: Findings) -> None:
    """Whether `[0]` may be sent as it is and as %5B0%5D, and whether a part of a table can be asked for."""
    whole = wire.ask(f"{CONFIG}VideoInOptions", "VideoInOptions")
    if whole.denied:
        found.unknown |= dict.fromkeys(("brackets", "config_narrowing", "daynight", "lens_mask"), NO_RIGHT)
        return
    raw = wire.ask(f"{CONFIG}{NARROW}", "VideoInOptions part")
    encoded = wire.ask(f"{CONFIG}{NARROW.replace('[', '%5B').replace(']', '%5D')}", "VideoInOptions part, encoded")
    taken = (raw.good, encoded.good)
    found.switches["brackets"] = {(True, True): "both", (True, False): "raw", (False, True): "encoded"}.get(taken)
    found.switches["config_narrowing"] = any(one.good and one.text.strip() for one in (raw, encoded))
    _daynight(wire, found, whole)


def _daynight(wire: Wire, found: Findings, options: Exchange) -> None:
    table = read_table(options.text)
    flags = {key: table.get(f"table.VideoInOptions[0].{key.capitalize()}") for key in ("flip", "mirror")}
    found.picture |= {key: value == "true" for key, value in flags.items() if value is not None}
    newer = wire.ask(f"{CONFIG}VideoInDayNight", "VideoInDayNight")
    if "table.VideoInDayNight" in newer.text:
        found.switches["daynight"] = "VideoInDayNight"
    elif "DayNightColor" in options.text:
        found.switches["daynight"] = "VideoInOptions"
    mask = wire.ask(f"{CONFIG}LeLensMask", "LeLensMask")
    if mask.denied:
        found.unknown["lens_mask"] = NO_RIGHT
    else:
        found.switches["lens_mask"] = found.capabilities["privacy"] = "LeLensMask" in mask.text


def channels(wire: Wire, found: Findings) -> None:
    """The channel of the motors, and the form in which they tell where they stand."""
    answers = {channel: wire.ask(ptz.status(channel), f"status of channel {channel}") for channel in (0, 1)}
    good = {channel: answer for channel, answer in answers.items() if answer.good and _position_key(answer.text)}
    if not good and any(answer.denied for answer in answers.values()):
        found.unknown |= dict.fromkeys(("ptz_channels", "status_form", "position_key"), NO_RIGHT)
        return
    if not good:
        raise Refused("the camera tells its position on neither channel 1 nor 0: it has no motors")
    found.switches["ptz_channels"] = tuple(good)
    body = next(reversed(good.values())).text
    found.switches |= {"status_form": status_form(body), "position_key": _position_key(body)}
    reading = ptz.read_status(body)
    found.pose = (reading.pan, reading.tilt, reading.zoom)


def _position_key(body: str) -> str | None:
    return next((key for key in ("Postion", "Position") if f"status.{key}[0]" in body), None)


def latency(wire: Wire, found: Findings) -> None:
    """How long control requests take, and whether a camera at rest says so."""
    if not found.switches.get("ptz_channels"):
        found.latency_ms = times([wire.ask(system.magic("getDeviceType")).seconds for _ in range(ASKED)])
        return
    channel = found.switches["ptz_channels"][-1]
    words: set[str] = set()
    readings: set[tuple[float, float]] = set()
    for _ in range(ASKED):
        body = wire.ask(ptz.status(channel)).text
        words.add(read_table(body).get("status.MoveStatus", ""))
        reading = ptz.read_status(body)
        readings.add((reading.pan, reading.tilt))
    found.switches["status_dither"] = len(readings) > 1
    took = [one.seconds for one in wire.exchanges if one.status == 200 and "ptz.cgi" in one.target]
    found.latency_ms = times(took)
    if words <= {"Moving"}:
        found.switches["move_status"] = "stuck"


def times(took: list[float]) -> dict[str, float]:
    """Seconds as the milliseconds that are shown; nearly all are within the spread of the median. Pure."""
    middle = share(took, 0.9) - share(took, 0.1)  # of those that are not rare
    told = {"median": share(took, 0.5), "spread": middle / 1.6, "p95": share(took, 0.95), "worst": max(took)}
    return {name: _ms(seconds) for name, seconds in told.items()}


def _ms(seconds: float) -> float:
    return round(1000 * seconds, 1)


def capabilities(wire: Wire, found: Findings) -> None:
    """What it says that it can do, and what it does not refuse when asked for nothing."""
    if motors := found.switches.get("ptz_channels"):
        _motors(wire, found, motors[-1])
    for kind in ("Input", "Output"):
        count = read_table(wire.ask(f"/cgi-bin/devAudio{kind}.cgi?action=getCollect", f"audio {kind.lower()}s").text)
        found.capabilities[f"audio_{kind[:-3].lower()}"] = int(count.get("result", "0") or "0")
    events = wire.ask("/cgi-bin/eventManager.cgi?action=getEventIndexes&code=VideoMotion", "getEventIndexes")
    found.capabilities["motion_events"] = events.good or events.text.startswith("Error: No Events")
    for name, target in ALSO.items():
        wire.ask(target, name)


def _motors(wire: Wire, found: Findings, channel: int) -> None:
    caps = wire.ask(f"/cgi-bin/ptz.cgi?action=getCurrentProtocolCaps&channel={channel}", "getCurrentProtocolCaps")
    found.capabilities |= read_capabilities(read_table(caps.text))
    found.switches["preset_max"] = found.capabilities.get("presets")
    found.switches |= {ours: found.capabilities[ours] for ours in ("tours", "auto_scan") if ours in found.capabilities}
    stored = read_table(wire.ask(f"/cgi-bin/ptz.cgi?action=getPresets&channel={channel}", "getPresets").text)
    if stored:
        found.switches["presets_form"] = "long" if any(key.endswith(".Type") for key in stored) else "short"
    numbers = (value for key, value in stored.items() if key.endswith(".Index") and value.isdigit())
    found.capabilities["presets_stored"] = sorted(map(int, numbers))


def read_capabilities(table: Mapping[str, str]) -> dict[str, Any]:
    """The camera's list as ours. Pure."""
    flags = {
        "absolute": "MoveAbsolutely",
        "relative": "MoveRelatively",
        "zoom": "Zoom",
        "tours": "Tour",
        "auto_scan": "AutoScan",
    }
    told: dict[str, Any] = {
        ours: table[f"caps.{theirs}"] == "true" for ours, theirs in flags.items() if f"caps.{theirs}" in table
    }
    if table.get("caps.PresetMax", "").isdigit():
        told["presets"] = int(table["caps.PresetMax"])
    for ours, axis in (("pan_range", "Horizontal"), ("tilt_range", "Vertical")):
        ends = [table.get(f"caps.PtzMotionRange.{axis}Angle[{end}]") for end in (0, 1)]
        if all(ends):
            told[ours] = [float(end or 0) for end in ends]
    return told


def pictures(wire: Wire, found: Findings) -> None:
    """Which channel a snapshot wants, how long it takes, and its size."""
    good: list[int | None] = []
    seconds: list[float] = []
    for channel in (None, 0, 1):
        query = "" if channel is None else f"?channel={channel}"
        for _ in range(SNAPSHOTS):
            answer = wire.ask(f"/cgi-bin/snapshot.cgi{query}", f"snapshot {query}", PICTURE)
            if answer.body.startswith(b"\xff\xd8"):
                break
        if answer.body.startswith(b"\xff\xd8"):
            good.append(channel)
            seconds.append(answer.seconds)
            found.picture["size"] = jpeg_size(answer.body)
    found.capabilities["snapshot_channels"] = good
    if seconds:
        found.latency_ms["snapshot"] = _ms(share(seconds, 0.5))


def jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Width and height from a JPEG's frame header. Pure."""
    mark = re.search(rb"\xff[\xc0-\xc2]..\x08(..)(..)", data, re.DOTALL)
    return (int.from_bytes(mark[2], "big"), int.from_bytes(mark[1], "big")) if mark else None


def clock(wire: Wire, found: Findings, now: Callable[[], float] = time.time) -> None:
    """How far its clock is from ours."""
    answer = wire.ask(CLOCK, "getCurrentTime")
    told = read_table(answer.text).get("result", "")
    try:
        found.clock_off_s = round(time.mktime(time.strptime(told, "%Y-%m-%d %H:%M:%S")) - now(), 1)
    except (ValueError, OverflowError):
        found.notes.append(f"its clock tells {told!r}")


def onvif(wire: Wire, found: Findings) -> None:
    """Whether it speaks ONVIF too: its time may be asked without a login."""
    asked = (
        '<s:Envelope xmlns:s="http://www.w3.org/2003/05/soap-envelope"><s:Body><GetSystemDateAndTime '
        'xmlns="http://www.onvif.org/ver10/device/wsdl"/></s:Body></s:Envelope>'
    )
    answer = wire.post("/onvif/device_service", asked.encode(), "ONVIF time")
    found.switches["onvif"] = answer.status == 200 and "GetSystemDateAndTimeResponse" in answer.text
