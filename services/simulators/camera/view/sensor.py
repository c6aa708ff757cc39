"""How much light the sensor gets, and what it makes of it: gain, darkness and noise. Pure.

At LAMP_LUX the picture is full without gain; more shortens the exposure. With less the gain rises to its limit, below
that the picture is as much darker. In black and white the filter that keeps infrared out is away and, in the dark, the
camera's own lamp shines, as strong everywhere. The numbers are inferred: those of small sensors.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from services.simulators.camera.config_tables import Tables
from services.simulators.camera.view.optics import Float32
from services.simulators.world import LAMP_LUX

GAIN_MAX = 64.0  # 36 dB: full down to 3 lux
NIGHT_LUX = 5.0  # with less the lamp goes on where it may, and `auto` is black and white
INFRARED_LUX = 20.0  # of the lamp, as white light that does the same
NOISE = 2.2  # grey levels, one sigma, without gain
ELECTRONS = 33.0  # in a grey level without gain: 8400 fill a pixel
READ_NOISE = 0.15  # grey levels without gain: 5 electrons


@dataclass(frozen=True)
class Light:
    """What falls on the sensor (lux), and whether it is seen without colour."""

    lux: float
    grey: bool

    @property
    def gain(self) -> float:
        """How much the signal is amplified, 1 to GAIN_MAX."""
        return min(max(LAMP_LUX / self.lux if self.lux else inf, 1.0), GAIN_MAX)

    @property
    def share(self) -> float:
        """How bright the picture is of one that is exposed well."""
        return min(self.gain * self.lux / LAMP_LUX, 1.0)


def light(lux: float, tables: Tables) -> Light:
    """What the sensor gets in a room with so much light, in the mode that the tables say."""
    dark = lux < NIGHT_LUX
    grey = tables.colour == "bw" or (tables.colour == "auto" and dark)
    lamp = grey and dark and not tables.flag("VideoInOptions[0].InfraRed")  # true is off
    return Light(lux + INFRARED_LUX * lamp, grey)


def noise(gain: float) -> Float32:
    """One sigma for each grey level of the picture: few electrons vary more, and gain amplifies how they are read."""
    shot = (gain - 1.0) * np.arange(256) / ELECTRONS
    return np.asarray(np.sqrt(NOISE**2 + shot + (gain**2 - 1.0) * READ_NOISE**2), np.float32)
