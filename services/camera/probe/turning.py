"""What only a moving camera shows, with leave: speeds, delays, directions, honesty of the status, absolute positions.

It moves by some degrees and back again. Whatever happens, a stop is the last command, and it is confirmed; who is told
to end (SystemExit) leaves the way back.
"""

from __future__ import annotations

import sys
from math import hypot, sqrt
from statistics import fmean, median

from services.camera.brands.dahua import ptz
from services.camera.device import Direction, MoveOver, MoveTo, Reading
from services.camera.probe.findings import Findings, Speed
from services.camera.probe.turner import STILL_DEG, Run, Sample, Turner, apart, difference, moving
from services.camera.probe.wire import Exchange, Wire

LEVELS = (1, 3, 5)  # the middle one of a full table; the fastest would swing far
SHORT_S, LONG_S = 0.4, 1.2
NEAR_DEG = 0.5  # so near to where it was is back
STEP_DEG = 3.0  # of the try with absolute positions
COARSE_DEG = 4.0  # the way back begins faster than this
RETURNS = 15
READ_DEG, DITHER_DEG = 0.03, 0.08  # standard deviation of a reading in tenths; and where it trembles by one
ACTS = 0.35  # of how late an answer is may fall after the camera has acted: what `ptz/pace` supposes, at most
FAR_DEG = 12.0  # more than this is not what was asked for
WATCHES, ALIKE = 100, 3  # readings; so many that are alike, and not those before it begins to turn
BACK = {
    Direction.LEFT: Direction.RIGHT, Direction.RIGHT: Direction.LEFT,
    Direction.UP: Direction.DOWN, Direction.DOWN: Direction.UP,
}  # fmt: skip
AXES = {"pan": Direction.RIGHT, "tilt": Direction.DOWN}
ZEROS: dict[str, tuple[str, object, object]] = {  # newer forms: firmware that has them takes a zero; then, else
    "position_relative": ("start&code=Position&arg1=0&arg2=0&arg3=0", "works", "bad-request"),
    "continuously": ("start&code=Continuously&arg1=0&arg2=0&arg3=0&arg4=1", True, False),
}


def turn(wire: Wire, found: Findings) -> None:
    """All of it, and back to where it looked."""
    turner = Turner(wire, found)
    home = turner.rest().reading
    found.moved = True
    try:
        for axis, direction in AXES.items():
            _speeds(turner, axis, direction)
        _honesty(turner)
        _absolute(turner)
        _shares(turner)
    finally:
        if not isinstance(sys.exception(), SystemExit):
            _home(turner, home)
    for switch, (action, works, otherwise) in ZEROS.items():
        answer = turner.drive(f"/cgi-bin/ptz.cgi?channel={turner.channel}&action={action}", f"{switch} of zero")
        found.switches[switch] = works if _done(answer) else otherwise
    _nowhere(turner)


def _done(answer: Exchange) -> bool:
    return answer.status == 200 and answer.text.split()[:1] == ["OK"]


def _nowhere(turner: Turner) -> None:
    """What it says when it is sent to a preset that nobody has stored: it stays where it is."""
    most, stored = turner.found.capabilities.get("presets", 1), turner.found.capabilities.get("presets_stored", [])
    number = next((number for number in range(most, 0, -1) if number not in stored), None)
    if number is not None:
        answer = turner.drive(ptz.preset("GotoPreset", number, turner.channel), "preset that is not stored")
        turner.found.switches["unset_preset"] = "ok" if _done(answer) else "error"
    turner.rest()


def _speeds(turner: Turner, axis: str, direction: Direction) -> None:
    """Two runs at each level, there and a longer one back: their difference holds no delays."""
    starts: list[float] = []
    for level in LEVELS:
        turner.wire.tell(f"{axis} at speed {level}")
        first = turner.run(direction, level, SHORT_S)
        if abs(first.turned) < STILL_DEG:
            direction = BACK[direction]  # it stands at an end stop
            first = turner.run(direction, level, SHORT_S)
        second = turner.run(BACK[direction], level, LONG_S)
        rate = (abs(second.turned) - abs(first.turned)) / max(second.seconds - first.seconds, 0.1)
        turner.rates[axis, level] = rate
        turner.grows[axis] = direction if first.turned > 0 else BACK[direction]
        doubt = _doubt(turner, rate) / max(second.seconds - first.seconds, 0.1)
        turner.found.speeds.append(Speed(axis, level, round(rate, 2), round(doubt, 2)))
        starts += begun(second, rate)
        turner.found.delays_s[f"{axis}_stop"] = round(second.settled, 2)
    if starts:
        turner.found.delays_s[f"{axis}_start"] = round(max(0.0, median(starts)), 2)
        turner.starts.append(starts[0])  # of the slower: it is soon that fast
        half = turner.found.latency_ms["median"] / 2000
        turner.found.delays_s["reading"] = round(max(0.0, fmean(turner.starts) + half), 2)
    if axis == "pan":
        _sense(turner)
    else:
        shares = [turner.rates["tilt", level] / max(turner.rates["pan", level], 0.1) for level in LEVELS[1:]]
        turner.found.switches["tilt_share"] = round(median(shares), 2)


def begun(run: Run, rate: float) -> list[float]:
    """Seconds from the answer to a start until the reading changes, by a straight line through a sample. Pure.

    Less than none where a reading tells of a later time than the middle of its request.
    """
    on = moving(run.seen)
    if not on or rate < 2.0:
        return []  # too slow for tenths of degrees to tell
    at = (on[-1].sent + on[-1].received) / 2 - apart(run.before, on[-1].reading) / rate
    return [at - run.seen[0].sent]


def _doubt(turner: Turner, rate: float) -> float:
    """Standard deviation of degrees between two runs: of the readings at their ends, and of when each of them acted."""
    dithers = turner.found.switches["status_dither"]
    spread = turner.found.latency_ms["spread"] / 1000
    return hypot(2 * (DITHER_DEG if dithers else READ_DEG), 2 * rate * ACTS * spread / sqrt(3))


def _sense(turner: Turner) -> None:
    """Right decreases the reading in a picture that is not mirrored; firmware may swap that with the picture."""
    if turner.found.picture.get("mirror"):
        turner.found.switches["mirror_inverts_motors"] = turner.grows["pan"] is Direction.RIGHT
    else:
        turner.found.unknown["mirror_inverts_motors"] = "the picture is not mirrored, and the probe changes no setting"


def _honesty(turner: Turner) -> None:
    """What the status says of moving, against what the readings show."""
    if turner.found.switches.get("status_form") == "c":
        turner.found.unknown["move_status"] = "its status has no word for it"
        return
    resting = {one.word for moves, one in turner.samples[1:] if not moves}  # it may be honest until it first moves
    turning = {one.word for moves, one in turner.samples if moves}
    if resting == {"Moving"}:
        turner.found.switches["move_status"] = "stuck"
    elif not turning:
        turner.found.unknown["move_status"] = "too slow to be seen on the way"
    else:
        told = "unknown" if turning == {"Unknown"} else "always-idle"
        turner.found.switches["move_status"] = "honest" if "Moving" in turning else told


def _absolute(turner: Turner) -> None:
    """A few degrees aside by PositionABS, whose first argument is the travel, and back by the same."""
    turner.wire.tell("an absolute position")
    here = turner.rest().reading
    aside = 1.0 if (here.pan + 180.0) % 360.0 < 180.0 else -1.0  # away from the dead arc
    down = 1.0 if here.tilt < 50.0 else -1.0
    goal = Reading((here.pan - aside * STEP_DEG) % 360.0, here.tilt + down * STEP_DEG, here.zoom)
    answer = _go(turner, goal)
    if not answer.good:
        turner.found.switches["position_abs"] = "bad-request"
        return
    pan, tilt = difference(here, _watched(turner, here).reading)
    honest = abs(abs(pan) - STEP_DEG) < 1.0
    level = abs(abs(tilt) - STEP_DEG) < 2.5 and abs(tilt) > 0.5
    if honest:
        turner.found.switches["position_abs"] = "full" if level else "pan-only"
        beside = round(tilt - down * STEP_DEG, 1)
        turner.found.switches["position_abs_tilt_off"] = beside if level and abs(beside) > 2 * STILL_DEG else 0.0
    else:
        turner.found.unknown["position_abs"] = f"taken, but it turned by {pan:.1f}, {tilt:.1f} degrees instead of 3, 3"
    _go(turner, here)
    _watched(turner, here)


def _shares(turner: Turner) -> None:
    """Shares of half a turn: over none, and to where it stands; one that is taken for something else is watched."""
    here = turner.rest().reading
    moves = "none"
    over = MoveOver(0.0, 0.0, 0.0, "moveRelatively")
    if _done(turner.drive(ptz.move_over(over, turner.channel), "moveRelatively")):
        moves = "relative"
    to = MoveTo(here.pan, here.tilt, here.zoom, "moveAbsolutely")
    if _done(turner.drive(ptz.move_to(to, turner.channel), "moveAbsolutely to where it stands")):
        if apart(here, _watched(turner, here).reading) > NEAR_DEG:
            turner.found.unknown["moves"] = "moveAbsolutely is taken, but it did not stay where it stands"
            return
        moves = "readings"
    turner.found.switches["moves"] = moves


def _go(turner: Turner, goal: Reading) -> Exchange:
    arguments = f"arg1={(180.0 - goal.pan) % 360.0:.1f}&arg2={goal.tilt:.1f}&arg3={goal.zoom:.0f}"
    target = f"/cgi-bin/ptz.cgi?action=start&channel={turner.channel}&code=PositionABS&{arguments}"
    return turner.drive(target, "PositionABS")


def _watched(turner: Turner, origin: Reading) -> Sample:
    """Comes to rest; a camera that goes far away instead is stopped: a start takes the place of any motion."""
    last, equal = turner.read(), 0
    for _ in range(WATCHES):
        now = turner.read()
        if max(map(abs, difference(origin, now.reading))) > FAR_DEG:
            with turner.turning(Direction.LEFT, 1):
                break
        equal = equal + 1 if apart(last.reading, now.reading) < STILL_DEG else 0
        if equal >= ALIKE:
            break
        last = now
        turner.wire.pause(0.1)
    return turner.rest()


def _home(turner: Turner, home: Reading) -> None:
    """Back to where it looked, axis by axis, by runs that are a little too short."""
    turner.wire.tell("back to where it looked")
    lag = turner.found.latency_ms.get("median", 300.0) / 1000
    for _ in range(RETURNS):
        errors = dict(zip(AXES, difference((turner.resting or turner.rest()).reading, home), strict=True))
        axis, error = max(errors.items(), key=lambda item: abs(item[1]))
        if abs(error) <= NEAR_DEG:
            return
        level = LEVELS[1] if abs(error) > COARSE_DEG else LEVELS[0]
        rate = max(turner.rates.get((axis, level), 0.6 * level), 0.3)
        grows = turner.grows.get(axis, AXES[axis])
        seconds = 0.9 * abs(error) / rate - lag
        turner.run(grows if error > 0 else BACK[grows], level, min(max(seconds, 0.02), 3.0))
    turner.found.notes.append("the camera looks a little beside where it looked before")
