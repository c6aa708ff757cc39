"""What goes wrong when: drawn from a seed, the whole plan before anything starts. Pure."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

GAP_S = (0.5, 4.5)  # from one fault to the next
LASTS_S = {"broker": 3.0, "database": 6.0, "master": 5.0, "disk": 8.0, "cut": 12.0, "camera": 8.0, "clock": 12.0}
WEIGHTS = {"kill": 6, "broker": 1, "database": 2, "master": 1, "disk": 1, "camera": 3, "cut": 4, "clock": 2}
ONE_AT_A_TIME = {"broker": "machine", "database": "machine", "disk": "machine"}  # a broker that ends has to save
CAMERA: Mapping[str, tuple[dict[str, object], ...]] = {
    "drop": ({},),
    "500": ({},),
    "hang": ({},),
    "slow": ({"seconds": 1.5}, {"seconds": 4.0}),
    "silent_events": ({},),
    "frozen_stream": ({},),
    "corrupt_jpeg": ({},),
    "nonce": ({"share": 0.3},),
    "cut": ({}, {"refuses": True}),
    "rights": ({},),
    "clock": ({"seconds": 3600.0},),
    "locked": ({},),
    "password": ({},),
    "reboot": ({},),
}
SLOW_BACK = ("locked", "password")  # who locks people out is not asked again at once
SLOW_BACK_S = 60.0


@dataclass(frozen=True)
class Stroke:
    """One fault: when (s from the start), what, to whom, for how long (0: it only happens)."""

    at: float
    kind: str
    whom: str = ""
    lasts: float = 0.0
    settings: Mapping[str, object] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.at:6.1f} s {self.kind} {self.whom} {dict(self.settings) or ''}" + f" for {self.lasts:.1f} s"


def planned(seed: int, seconds: float, services: Sequence[str], able: Sequence[str]) -> list[Stroke]:
    """Faults of these kinds until `seconds`; each ends by then."""
    rng, strokes, at = random.Random(seed), list[Stroke](), 0.0
    busy: dict[str, float] = {}
    kinds = [kind for kind in WEIGHTS if kind in able]
    while (at := at + rng.uniform(*GAP_S)) < seconds:
        kind = rng.choices(kinds, [WEIGHTS[one] for one in kinds])[0]
        stroke = _drawn(rng, at, kind, services, seconds)
        lane = ONE_AT_A_TIME.get(kind, f"{kind} {stroke.whom if kind in ('cut', 'clock') else ''}")
        if kind == "kill" or busy.get(lane, 0.0) < at:
            busy[lane] = at + stroke.lasts + GAP_S[1]
            strokes.append(stroke)
    return strokes


def _drawn(rng: random.Random, at: float, kind: str, services: Sequence[str], seconds: float) -> Stroke:
    lasts = min(rng.uniform(0.3, LASTS_S.get(kind, 0.3)), seconds - at)
    if kind == "kill":
        return Stroke(at, kind, rng.choice(services))
    if kind == "camera":
        slow = SLOW_BACK if at > seconds - SLOW_BACK_S else ()
        name = rng.choice([one for one in CAMERA if one not in slow])
        return Stroke(at, kind, name, lasts, rng.choice(CAMERA[name]))
    if kind == "cut":
        return Stroke(at, kind, rng.choice([*services[1:], "database", "camera"]), lasts)
    if kind == "clock":
        return Stroke(at, kind, rng.choice(services[1:]), lasts, {"seconds": rng.choice([3600.0, -3600.0])})
    return Stroke(at, kind, rng.choice(["SIGTERM", "SIGKILL"]) if kind == "database" else "", lasts)
