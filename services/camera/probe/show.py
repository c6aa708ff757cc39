"""The probe on a terminal: a line for each step while it works, then the findings as tables; plain lines elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any

from rich import box
from rich.console import Console
from rich.live import Live
from rich.panel import Panel
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text

from services.camera.probe import rights
from services.camera.probe.contact import MOVING, READS
from services.camera.probe.findings import Findings
from services.camera.probe.likeness import Likeness

WORDS: dict[str, tuple[str, dict[object, str]]] = {  # switch -> what it is, and what its values mean
    "auth": ("Login", {"digest": "Digest", "basic": "Basic: the password travels readable", "digest+basic": "both"}),
    "nonce": ("A nonce", {"reusable": "may be used again: one request per command",
                          "single-use": "works once: two requests per command",
                          "flaky": "works again at times: about one and a half requests per command"}),
    "stale": ("A refused nonce", {True: "is told apart from a wrong password", False: "looks like a wrong password"}),
    "challenge_spacing": ("Challenge", {"compact": "without spaces", "spaced": "with spaces"}),
    "digest_algorithms": ("Digest with", {}),
    "error_style": ("It says no by", {"200-error": "status 200 and the word Error", "400-body": "status 400",
                                      "501": "status 501"}),
    "brackets": ("[0] in a request", {"both": "plain or encoded", "raw": "plain only", "encoded": "encoded only"}),
    "config_narrowing": ("Parts of tables", {True: "can be asked for", False: "come empty: whole tables only"}),
    "daynight": ("Day and night in", {}),
    "version_form": ("Version told in", {}),
    "ptz_channels": ("Motors on channel", {}),
    "status_form": ("Status form", {"a": "a: with presets", "b": "b: with lens", "c": "c: short",
                                    "newest": "newest: angles twice"}),
    "position_key": ("Position spelled", {}),
    "move_status": ("The word Moving", {"honest": "is honest", "always-idle": "never comes: it says Idle",
                                        "stuck": "stays for ever", "unknown": "never comes: it says Unknown"}),
    "status_dither": ("At rest the reading", {True: "trembles by a tenth", False: "stands"}),
    "mirror_inverts_motors": ("Mirrored picture", {True: "turns the motors round", False: "leaves the motors"}),
    "position_abs": ("PositionABS", {"full": "goes there", "pan-only": "pan only", "bad-request": "is refused"}),
    "position_relative": ("Position (relative)", {"works": "is taken", "bad-request": "is refused"}),
    "unset_preset": ("A preset never stored", {"error": "is refused", "ok": "is taken, and nothing happens"}),
    "continuously": ("Timed moves", {True: "are taken", False: "are refused"}),
    "heartbeat": ("Event stream", {True: "has a heartbeat", False: "is silent when nothing happens"}),
    "event_form": ("Events", {"A": "form A, with data", "B": "form B, without data"}),
    "event_header_twice": ("Its first answer has", {True: "a second header in its body", False: "one header"}),
    "onvif": ("ONVIF", {True: "yes", False: "no, or switched off"}),
}  # fmt: skip
STEPS = len(READS) + 1


class Lines:
    """Tells each step by one plain line."""

    def __init__(self, console: Console) -> None:
        self.console, self.number = console, 0

    def begin(self, step: str) -> None:
        """Says which step it is."""
        self.number += 1

    def detail(self, text: str) -> None:
        """Not said: one line for each step."""

    def end(self, step: str, found: Findings) -> None:
        """Says that it is done, with what it has shown."""
        told = gist(step, found)
        self.console.print(f"[{self.number:2}/{STEPS}] {step}{f': {told}' if told else ''}", markup=False)


class Spinning(Lines):
    """The same on a terminal: the present step turns."""

    def __init__(self, console: Console, live: Live) -> None:
        super().__init__(console)
        self.live, self.step = live, ""

    def begin(self, step: str) -> None:
        """Shows what it is doing."""
        super().begin(step)
        self.step = step
        self.live.update(Spinner("dots", Text(f" {step} ...", "cyan")))

    def detail(self, text: str) -> None:
        """Shows what of it."""
        self.live.update(Spinner("dots", Text(f" {self.step}: {text} ...", "cyan")))

    def end(self, step: str, found: Findings) -> None:
        """A tick and what was found."""
        self.live.update(Text(""))
        line = Text.assemble(("✓ ", "green"), (f"{step:<30}", "bold"), (gist(step, found), ""))
        self.console.print(line)


def gist(step: str, found: Findings) -> str:
    """What a step has shown, in a few words. Pure."""
    told = found.switches
    made = {
        READS[0][0]: lambda: f"{meaning('auth', told)}; the password is right",
        READS[1][0]: lambda: f"{found.model}, firmware {found.firmware} of {found.built or 'unknown date'}",
        READS[2][0]: lambda: meaning("nonce", told),
        READS[3][0]: lambda: meaning("error_style", told),
        READS[4][0]: lambda: f"{meaning('brackets', told)}; {told['daynight']}",
        READS[5][0]: lambda: f"channel {' and '.join(map(str, told['ptz_channels']))}, looks at {where(found)}",
        READS[6][0]: lambda: (
            f"{found.capabilities.get('presets', '?')} presets, {len(found.capabilities['presets_stored'])} stored"
        ),
        READS[7][0]: lambda: "{median:.0f} ms, at worst {worst:.0f} ms".format(**found.latency_ms),
        READS[8][0]: lambda: (
            f"{abs(found.clock_off_s or 0.0):.0f} s {'ahead' if (found.clock_off_s or 0) > 0 else 'behind'}"
        ),
        READS[9][0]: lambda: "{} x {} pixels".format(*found.picture["size"]),
        READS[10][0]: lambda: meaning("heartbeat", told),
        READS[11][0]: lambda: meaning("onvif", told),
        READS[12][0]: lambda: streams(found),
        MOVING: lambda: ", ".join(f"{one.axis} {one.per_s:.1f}°/s at {one.level}" for one in found.speeds[2::3]),
    }.get(step)
    with suppress(KeyError, TypeError, IndexError):
        return made() if made is not None else ""
    return "not found out"


def where(found: Findings) -> str:
    """Where it looks, in words."""
    if found.pose is None:
        return "not told"
    pan, tilt, zoom = found.pose
    return f"pan {pan:.1f}°, tilt {tilt:.1f}°, zoom {zoom:g}"


def meaning(switch: str, told: Mapping[str, Any]) -> str:
    """A switch's value in words."""
    if told.get(switch) is None:
        return "not found out"
    value = told[switch]
    _, words = WORDS.get(switch, ("", {}))
    if isinstance(value, list | tuple):
        return " and ".join(map(str, value))
    return words.get(value, str(value))


def report(console: Console, found: Findings) -> None:
    """Everything, for people."""
    console.print()
    console.print(Panel(_head(found), title="[bold]" + (found.model or "camera") + "[/]", expand=False))
    table = Table("", "how this firmware behaves", box=box.SIMPLE, show_edge=False, pad_edge=False)
    for switch, (name, _) in WORDS.items() if found.brand == "amcrest" else ():
        unsure = switch in found.unknown
        text = f"not found out: {found.unknown[switch]}" if unsure else meaning(switch, found.switches)
        if switch == "position_abs" and (beside := found.switches.get("position_abs_tilt_off")):
            text += f", but tilt ends {beside:+.1f}° beside"
        table.add_row(name, Text(text, "dim" if unsure or text == "not found out" else ""))
    if table.rows:
        console.print()
        console.print(table)
    if found.speeds:
        console.print()
        console.print(_speeds(found))
    for note in found.notes:
        console.print(f"Note: {note}.", markup=False)


def streams(found: Findings) -> str:
    """What comes over RTSP, or why nothing does."""
    each = {name: found.streams.get(name) or found.unknown.get(f"{name} stream") for name in ("main", "sub")}
    told = "; ".join(f"{name} {text}" for name, text in each.items() if text)
    return f"RTSP on port {found.rtsp_port}: {told}" if told else "not tried"


def likeness(like: Likeness | None) -> str:
    """Which of the known firmwares it is, and where it differs from that."""
    if like is None:
        return "not compared"
    if not like.differs:
        return f"{like.name}, in all {like.compared} ways that could be compared"
    which = like.name if like.known else f"no firmware that is known; the nearest is {like.name}"
    rows = [f"  {key}: {seen} instead of {theirs}" for key, (seen, theirs) in like.differs.items()]
    return "\n".join([f"{which}, but for {len(rows)} of {like.compared} ways:", *rows])


def _head(found: Findings) -> Table:
    """Identity, capabilities and times."""
    can, table = found.capabilities, Table.grid(padding=(0, 2))
    size = found.picture.get("size")
    rows: Iterable[tuple[str, str]] = (
        ("Address", found.url),
        ("Firmware", f"{found.firmware} ({found.built or 'date unknown'})"),
        ("Behaves like", likeness(found.like)),
        ("Serial number", found.serial),
        ("The account", rights.words(found.rights) if found.rights else "not asked"),
        ("Picture", ", ".join(_words(size, found.picture))),
        ("Moving pictures", streams(found)),
        ("Looks at", where(found)),
        ("Presets", f"{can.get('presets', 'unknown')}, of them stored {len(can.get('presets_stored', ()))}"),
        ("Sound", f"{can.get('audio_in', 0)} microphone(s), {can.get('audio_out', 0)} loudspeaker(s)"),
        ("Privacy mask", "yes" if can.get("privacy") else "no"),
        ("Answers", _times(found.latency_ms)),
        ("Snapshots", _channels(can.get("snapshot_channels"))),
        ("Motors", _delays(found.delays_s)),
        (
            "Clock",
            "not told" if found.clock_off_s is None else f"{found.clock_off_s + 0.0:+.1f} s against this computer",
        ),
    )
    for name, text in rows:
        table.add_row(Text(name, "dim"), Text(text))
    return table


def _words(size: tuple[int, int] | None, picture: Mapping[str, Any]) -> list[str]:
    words = [f"{size[0]} x {size[1]}"] if size else []
    return words + [f"{key}: {'yes' if picture[key] else 'no'}" for key in ("flip", "mirror") if key in picture]


def _times(latency_ms: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:.0f} ms" for name, value in latency_ms.items())


def _channels(good: list[int | None] | None) -> str:
    """With which channels a snapshot was given."""
    words = ["without a channel" if one is None else f"with channel {one}" for one in good or ()]
    return ", ".join(words) or "none was given"


def _delays(delays_s: Mapping[str, float]) -> str:
    """As the reading tells it, so with the time that an answer takes."""
    both = [axis for axis in ("pan", "tilt") if {f"{axis}_start", f"{axis}_stop"} <= set(delays_s)]
    words = "{} moves {:.2f} s after the order, stands {:.2f} s after the stop"
    told = [words.format(axis, delays_s[f"{axis}_start"], delays_s[f"{axis}_stop"]) for axis in both]
    told += [f"a reading is {delays_s['reading']:.2f} s old"] if "reading" in delays_s else []
    return "\n".join(told) or "not tried"


def _speeds(found: Findings) -> Table:
    table = Table(box=box.SIMPLE, show_edge=False, pad_edge=False)
    table.add_column("speed", justify="right")
    for axis in ("pan", "tilt"):
        table.add_column(f"{axis}, °/s", justify="right")
    for level in sorted({one.level for one in found.speeds}):
        row = {one.axis: f"{one.per_s:.1f} ± {one.doubt:.1f}" for one in found.speeds if one.level == level}
        table.add_row(str(level), row.get("pan", ""), row.get("tilt", ""))
    return table
