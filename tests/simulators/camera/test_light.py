"""Pictures in little light: as bright and as noisy as a sensor's gain and its electrons make them."""

from __future__ import annotations

from math import sqrt
from statistics import NormalDist

import cv2
import httpx
import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from services.simulators.camera import Config
from services.simulators.camera.messages import read
from services.simulators.camera.motors import Pose
from services.simulators.camera.program import Inside, Simulated, inside
from services.simulators.world import World

NOON = 1_784_200_000.0
LATER = NOON + 100.0  # long after every change
TABLES = "/cgi-bin/configManager.cgi?action=setConfig&VideoInOptions[0]."
AUTO, COLOUR, GREY, LAMP_OFF = "DayNightColor=1", "DayNightColor=0", "DayNightColor=2", "InfraRed=true"


def _camera(config: Config, lux: float, *settings: str) -> Inside:
    """It looks at the wall and the table, and the light is as it is for long."""
    camera = inside(config, NOON)
    camera.device.place(Pose(80.0, 40.0, 0.0), NOON)
    for setting in settings:
        camera.device.answer(read(TABLES + setting), NOON)
    camera.pictures.shine(lux, NOON)
    return camera


def _frames(camera: Inside, count: int) -> NDArray[np.float64]:
    return np.array([camera.pictures.frame("ExtraFormat", LATER + number) for number in range(count)], float)


def _brightness(camera: Inside, at: float = LATER) -> float:
    return float(camera.pictures.frame("ExtraFormat", at).mean())


def _has_colour(camera: Inside) -> bool:
    blue, green, red = np.moveaxis(_frames(camera, 1)[0], -1, 0)
    return not (np.array_equal(blue, green) and np.array_equal(green, red))


def _sigma(level: float, gain: float) -> float:
    """The noise of a pixel (grey levels): 2.2 without gain; 33 electrons a level, read to 0.15 levels."""
    return sqrt(2.2**2 + (gain - 1) * level / 33 + (gain**2 - 1) * 0.15**2)


def _above_zero(level: float, sigma: float) -> float:
    """The mean of a pixel whose noise cannot go below black."""
    noise = NormalDist()
    return level * noise.cdf(level / sigma) + sigma * noise.pdf(level / sigma)


@pytest.mark.parametrize("lux", [200.0, 350.0, 10_000.0])
def test_where_there_is_light_enough_the_picture_is_as_ever(config: Config, world: World, lux: float) -> None:
    plain = inside(config, NOON)
    plain.device.place(Pose(80.0, 40.0, 0.0), NOON)
    assert world.light == plain.pictures.lux == 200.0
    assert np.array_equal(_frames(plain, 2), _frames(_camera(config, lux), 2))


@pytest.mark.parametrize(
    ("lux", "share"), [(50.0, 1.0), (10.0, 1.0), (3.125, 1.0), (1.5, 0.48), (0.75, 0.24), (0.3, 0.096), (0.0, 0.0)]
)
def test_gain_keeps_the_picture_bright_down_to_three_lux_and_then_it_darkens(
    config: Config, lux: float, share: float
) -> None:
    full = _frames(_camera(config, 200.0, COLOUR), 8).mean(axis=0).round().astype(int)
    seen = _frames(_camera(config, lux, COLOUR), 8).mean(axis=0)
    clear = full < 170  # where noise does not reach white
    signal = share * np.arange(256)
    mean = [_above_zero(one, _sigma(one, min(200.0 / lux, 64.0) if lux else 64.0)) for one in signal]
    assert seen[clear].mean() == pytest.approx(np.array(mean)[full[clear]].mean(), rel=0.03, abs=0.5)


@pytest.mark.parametrize("lux", [200.0, 100.0, 20.0, 5.0, 3.125])
@pytest.mark.parametrize("level", [60, 120, 180])
def test_noise_is_that_of_fewer_electrons_amplified(config: Config, lux: float, level: int) -> None:
    frames = _frames(_camera(config, lux, COLOUR), 12)
    about = np.abs(frames.mean(axis=0) - level) < 12
    measured = float(np.sqrt(frames.var(axis=0, ddof=1)[about].mean()))
    assert measured == pytest.approx(_sigma(level, 200.0 / lux), rel=0.07)


def test_without_light_the_picture_is_black_in_colour_and_clear_in_black_and_white(config: Config) -> None:
    assert _brightness(_camera(config, 0.0, COLOUR)) < 8
    night = _camera(config, 0.0, GREY)
    assert _brightness(night) == pytest.approx(_brightness(_camera(config, 200.0, GREY)), rel=0.03)
    assert not _has_colour(night)
    spread = float(np.sqrt(_frames(night, 8).var(axis=0, ddof=1).mean()))
    assert 2.5 < spread < 8  # the lamp is weaker than the room's, and three colours' noise is averaged


def test_the_lamp_can_be_switched_off_and_is_off_by_day(config: Config) -> None:
    assert _brightness(_camera(config, 0.0, GREY, LAMP_OFF)) < 8
    assert np.array_equal(_frames(_camera(config, 8.0, GREY), 2), _frames(_camera(config, 8.0, GREY, LAMP_OFF), 2))


def test_left_to_itself_it_turns_to_black_and_white_in_the_dark(config: Config) -> None:
    assert _has_colour(_camera(config, 8.0, AUTO))
    night = _camera(config, 0.5, AUTO)
    assert np.array_equal(_frames(night, 2), _frames(_camera(config, 0.5, GREY), 2))
    assert not _has_colour(night)


def test_a_change_of_light_exposes_anew_and_is_taken_for_motion(config: Config) -> None:
    camera = inside(config, NOON)
    camera.device.watch(NOON)
    assert camera.device.events.active("VideoMotion") == []
    before = camera.pictures.jpeg("ExtraFormat", NOON + 0.01)
    camera.pictures.shine(20.0, NOON + 0.02)
    assert camera.pictures.jpeg("ExtraFormat", NOON + 0.03) != before  # not the one of the same frame
    at_once, settled = (_brightness(camera, NOON + seconds) for seconds in (0.1, 5.0))
    assert at_once < 0.5 * settled
    camera.device.watch(NOON + 0.1)
    assert camera.device.events.active("VideoMotion") == [0]


def test_the_side_door_switches_the_light(camera: Simulated) -> None:
    with httpx.Client(base_url=camera.side_door_url) as door:
        assert door.get("/state").json()["lux"] == 200.0
        door.post("/light", json={"lux": 0.5}).raise_for_status()
        assert door.get("/state").json()["lux"] == 0.5
        for nonsense in ({}, {"lux": -1}, {"lux": "dark"}, {"lux": float("inf")}):
            content = str(nonsense).replace("'", '"').replace("inf", "Infinity")
            assert door.post("/light", content=content).status_code == 400
        assert door.get("/state").json()["lux"] == 0.5


def test_the_jpeg_shows_the_dark_too(config: Config) -> None:
    camera = _camera(config, 0.0, COLOUR)
    image = cv2.imdecode(np.frombuffer(camera.pictures.jpeg("MainFormat", LATER), np.uint8), cv2.IMREAD_COLOR)
    assert image.mean() < 8


@pytest.mark.parametrize("light", [-1.0, float("nan"), 1e6])
def test_a_world_with_impossible_light_is_refused(world: World, light: float) -> None:
    with pytest.raises(ValidationError):
        World.model_validate({**world.model_dump(), "light": light})
