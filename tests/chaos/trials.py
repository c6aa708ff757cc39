"""The whole apartment under faults that a seed draws: what is promised holds meanwhile and in the end.

The tests make a short one, `make soak PART=chaos` ten minutes; both print the seed, which repeats the plan.
"""

from __future__ import annotations

import heapq
import itertools
import logging
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from services.client import connected
from tests.chaos import faults
from tests.chaos.motor import Motor
from tests.chaos.plan import Stroke, planned
from tests.chaos.traffic import Traffic
from tests.chaos.verdict import lost_and_doubled, seconds_until_green, slowness, wrong_retained
from tests.chaos.vitals import Vitals, family, of_apartment
from tests.chaos.whole import NUMBERED, Whole, whole
from tests.mission.trials import stands
from tests.persistence.trials import Publisher

GREEN_S = 15.0
RATE, BURST = 100, 5  # numbered messages a second
LOOKS_S = 1.0
OTHERS = (
    "multiprocessing/spawn.py",  # a process whose parent was killed before it had said what to do
    "actionlib/action_server.py",  # at the end of a node its timer still speaks on a topic that is closed
)
log = logging.getLogger("chaos")


@contextmanager
def apartment(folder: Path) -> Iterator[Whole]:
    """All of it, with clocks that can be set."""
    with whole(folder, clocks=True) as running:
        yield running


def chaos(running: Whole, seed: int, seconds: float) -> float:
    """Faults for so long; the seconds until everybody was well after the last. Everything else is asserted."""
    plan = planned(seed, seconds, running.services, faults.able(running))
    vitals, log_begins = Vitals(), running.flat.log.stat().st_size
    log.warning("seed %d: %d faults in %.0f s", seed, len(plan), seconds)
    with Publisher(running.parts.broker_port, NUMBERED, RATE, BURST) as publisher:
        with Motor(running) as motor, Traffic(running, motor, seed) as traffic:
            last = _strike(running, plan, vitals, motor)
            traffic.stop()
            slow = slowness()
            green_s = seconds_until_green(running, last, GREEN_S * slow)
            call_off(running)
            _rest(running, vitals)
        publisher.go_on(RATE)
    lost, doubled = lost_and_doubled(running, publisher.acknowledged, publisher.said)
    told = running.flat.log.read_text(errors="replace")[log_begins:]
    log.warning(
        "green after %.1f s (programs run %.1f times as long as they compute); %d of %d acknowledged, %d lost, "
        "%d doubled; %d looks at the motor, %d while it turned; said %s",
        green_s,
        slow,
        len(publisher.acknowledged),
        publisher.said,
        len(lost),
        len(doubled),
        motor.samples,
        len(motor.turning),
        traffic.said,
    )
    for life in vitals.survivors:
        log.warning(
            "%-17s lived %4.0f s: %s now, grown %s",
            life.name,
            life.seen - life.born,
            life.now,
            {what: round(more, 1) for what, more in life.grown.items()},
        )
    faulty = {
        "lost": lost[:10],
        "doubled": doubled[:10],
        "unbidden": motor.unbidden[:5],
        "leaks": vitals.leaks,
        "retained": wrong_retained(running),
        "left over": _left_over(running),
        "crashes": crashes(told),
    }
    assert not any(faulty.values()), {what: found for what, found in faulty.items() if found}
    return green_s


def _strike(running: Whole, plan: list[Stroke], vitals: Vitals, motor: Motor) -> float:
    """Begins and ends every fault at its time; the moment of the last."""
    numbers, begun = itertools.count(), time.monotonic()
    agenda: list[tuple[float, int, bool, Stroke]] = [(one.at, next(numbers), True, one) for one in plan]
    heapq.heapify(agenda)
    while agenda:
        at, _, begins, stroke = heapq.heappop(agenda)
        while (left := begun + at - time.monotonic()) > 0:
            vitals.look(pids(running))
            motor.pause(min(left, LOOKS_S))
        if begins:
            log.warning("%s", stroke)
            heapq.heappush(agenda, (at + stroke.lasts, next(numbers), False, stroke))
            faults.BEGINS[stroke.kind](running, stroke)
            if stroke.whom == "camera" or stroke.kind == "camera" or stroke.whom == "simulated-camera":
                motor.unreachable.append((time.monotonic(), begun + at + stroke.lasts))
        else:
            faults.ENDS[stroke.kind](running, stroke)
    return time.monotonic()


def pids(running: Whole) -> dict[str, int]:
    return {name: pid for name in running.services if (pid := running.pid(name)) is not None}


def call_off(running: Whole) -> None:
    """What is under way is cancelled; robot and camera come to rest."""
    with connected(running.bus, ["robot/tiago/#"]) as bus:
        bus.say("mission/tiago/order", '{"cancel": true}')
        bus.say("camera/ip1/order/Scan", '{"value": false, "id": "off"}')
        bus.say("camera/ip1/order/Move", '{"value": "Stop", "id": "stop"}')
        stands(bus)


def _rest(running: Whole, vitals: Vitals, seconds: float = 10.0) -> None:
    """Nothing is wanted; everybody shows what he holds then."""
    with connected(running.bus) as bus:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            bus.collect(LOOKS_S)
            vitals.look(pids(running))


def _left_over(running: Whole) -> list[str]:
    """Processes of ours that nobody of the living has started."""
    state = running.parts.environment["APARTMENT_STATE"]
    ours = set(family(pids(running).values()))
    return [f"{pid} {line}" for pid, line in of_apartment(state).items() if pid not in ours]


def crashes(told: str) -> list[str]:
    """The last lines of what Python tells of an exception that nobody caught; rospy logs those that it has met."""
    found = []
    before = ""
    for line in re.split(r"(?m)^(?=\d{4}-\d\d-\d\dT|Traceback|\[WARN\])", told):
        ours = "rospy.internal" not in before and not any(other in line for other in OTHERS)
        if line.startswith("Traceback") and ours:
            found.append(next((one for one in line.splitlines()[1:] if one and not one.startswith(" ")), "?")[:300])
        before = line
    return sorted(set(found))
