"""What a camera says of where it looks, after an order."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from services.camera.bulletin import Bulletin
from services.camera.device import Reading
from services.camera.health import Health
from services.camera.places import Places
from services.payloads import Position
from tests.camera.flat import Flat
from tests.camera.goals import random_goals
from tests.camera.motors import Motors


@pytest.fixture
def bulletin(tmp_path: Path) -> Bulletin:
    bulletin = Bulletin("ip1", Health("ip1"), Places(tmp_path), lambda message: None)
    bulletin.take(Reading(40.0, 20.0, 0.0, True), 100.0)
    return bulletin


def test_a_rest_that_was_foretold_is_said_and_moves_begin_there(bulletin: Bulletin) -> None:
    rest = Reading(40.8, 20.1, 0.0)
    bulletin.rests(rest)
    assert bulletin.position() == Position(pan=40.8, tilt=20.1, zoom=0.0, moving=False, place=None)
    assert bulletin.at_rest(100.5) == rest
    bulletin.take(Reading(40.9, 20.1, 0.0, False), 101.0)  # it was right but for a dither
    assert not bulletin.turning
    bulletin.take(Reading(42.0, 20.1, 0.0, False), 102.0)
    assert bulletin.turning


def test_where_an_order_tells_no_reading_the_newest_one_stays(bulletin: Bulletin) -> None:
    bulletin.rests(None)
    assert bulletin.at_rest(100.5) == Reading(40.0, 20.0, 0.0, True)


def test_done_tells_where_it_rests_though_it_was_looked_at_on_the_way_only(tmp_path: Path) -> None:
    flat = Flat(tmp_path, motors=Motors(relative="picture", acceleration=90.0, says="stuck"), places=Path()).online()
    foretold = 0
    for number, (pan, tilt, zoom) in enumerate(random_goals(40, 4)):
        goal = {"pan": pan, "tilt": tilt, "zoom": zoom, "id": str(number)}
        flat.send("camera/ip1/position/set", json.dumps(goal).encode())
        flat.until(lambda number=number: flat.ended(str(number)))  # type: ignore[misc]
        said, (at, tilted, _) = flat.last(str(number))["position"], flat.motors.pose
        assert said["moving"] is False
        off = max(abs((said["pan"] - at + 180) % 360 - 180), abs(said["tilt"] - tilted))
        assert off < 0.3
        foretold += flat.service.bulletin.known().moving is None  # its readings say that it moves, for ever
        flat.run(1.5)
        assert flat.payloads("position")[-1]["moving"] is False
    assert foretold > 5
