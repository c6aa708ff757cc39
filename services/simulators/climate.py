"""The air of a simulated home: weather outside, temperature and humidity inside. Pure, SI units but for °C and percent.

A room is a first-order model: it follows the temperature outside with a time constant, and a radiator whose valve
opens as the room gets colder than wanted lifts it. The weather is a function of time and seed alone, so that two
runs with the same seed have the same day, however often they look.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from functools import lru_cache
from math import cos, exp, pi, sin
from random import Random

COMFORT_C = 20.5  # wanted in rooms without a thermostat
FROST_C = 5.0  # held even when the heating is off
LOWERED_K = 2.0  # how much cooler `eco` and the night are
TIME_CONSTANT_S = 12 * 3600.0  # a flat of the 1970s; new ones reach days
RADIATOR_K = 36.0  # a wide open radiator lifts the room so far above outside in the long run
VALVE_BAND_K = 1.5  # from shut to wide open
AIR_CHANGE_S = 2 * 3600.0  # until most of a room's air is new
FREE_HEAT_K = 3.0  # what people, kitchen and sun lift it by
FREE_VAPOUR_PA = 250.0  # and what they add to the vapour outside
NIGHT = (23, 6)  # hours on the wall clock
PERIODS_S = (2_900.0, 11_300.0, 47_000.0)  # of `wander`; none a multiple of another, so that no two hours are alike


@lru_cache(maxsize=1024)
def _phases(key: str) -> tuple[float, ...]:
    draw = Random(key)
    return tuple(draw.uniform(0.0, 2 * pi) for _ in PERIODS_S)


def wander(key: str, time: float) -> float:
    """A slow wandering between -1 and 1, smooth, and the same for the same key and time."""
    return sum(sin(2 * pi * time / period + phase) for period, phase in zip(PERIODS_S, _phases(key), strict=True)) / 3


def is_night(local: datetime) -> bool:
    """Whether people sleep."""
    return local.hour >= NIGHT[0] or local.hour < NIGHT[1]


def season(local: datetime) -> float:
    """Mean temperature of a day in °C."""
    return 15.0 + 9.0 * cos(2 * pi * (local.timetuple().tm_yday - 200) / 365)


def outside(seed: int, local: datetime) -> float:
    """Temperature outside in °C: warmest in July and at three in the afternoon, with a weather of its own."""
    hour = local.hour + local.minute / 60 + local.second / 3600
    return season(local) + 4.5 * cos(2 * pi * (hour - 15) / 24) + 2.0 * wander(f"{seed}/weather", local.timestamp())


def saturation(celsius: float) -> float:
    """Saturation vapour pressure over water in Pa (Magnus, WMO-No. 8, coefficients of Sonntag 1990)."""
    return 611.2 * exp(17.62 * celsius / (243.12 + celsius))


def vapour_outside(seed: int, local: datetime) -> float:
    """Vapour pressure outside in Pa: a good half of what the air of the season can hold, by day and by night."""
    return (0.57 + 0.1 * wander(f"{seed}/damp", local.timestamp())) * saturation(season(local))


def relative(vapour: float, celsius: float) -> float:
    """Relative humidity in percent, of a vapour pressure in Pa; within what sensors can tell."""
    return min(98.0, max(5.0, 100.0 * vapour / saturation(celsius)))


def wanted(setpoint: float, mode: str, *, night: bool) -> float:
    """What a thermostat really aims at in °C; a mode it does not know is `manual`."""
    if mode.lower() == "off":
        return FROST_C
    if mode.lower() == "eco" or (mode.lower() == "auto" and night):
        return max(FROST_C, setpoint - LOWERED_K)
    return setpoint


@dataclass
class Room:
    """The air of one room; `key` (seed and name) makes its own draughts."""

    key: str
    celsius: float
    vapour: float  # Pa

    def step(self, seconds: float, outdoor: float, damp: float, setpoint: float, time: float) -> None:
        """Lets time go by under a weather of `outdoor` °C and `damp` Pa; exact while weather and valve stay."""
        valve = min(1.0, max(0.0, 0.5 + (setpoint - self.celsius) / VALVE_BAND_K))
        busy = 1.0 + wander(self.key, time)  # people, cooking, showers
        end = outdoor + FREE_HEAT_K * busy + RADIATOR_K * valve
        self.celsius += (end - self.celsius) * (1.0 - exp(-seconds / TIME_CONSTANT_S))
        self.vapour += (damp + FREE_VAPOUR_PA * busy - self.vapour) * (1.0 - exp(-seconds / AIR_CHANGE_S))
