"""Small pictures of a camera's places: taken of a camera that stands there, kept, and not taken again too soon."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import cv2
import numpy as np
import pytest

from services.dashboard.house import House
from services.dashboard.http.thumbnails import AGAIN_S, STANDS_S, TOPIC, Thumbnails
from services.dashboard.http.video import Still, Videos
from services.errors import Unavailable

NOON = 1_784_200_000.0


class Camera:
    """A house with one camera; each of its pictures has a grey of its own."""

    def __init__(self, state: Path | None) -> None:
        self.topics: dict[str, str] = {}
        self.told: list[Any] = []
        self.asked, self.away = 0, False
        self.late = 0.0  # seconds: so old is its newest picture
        self.now = NOON
        house = SimpleNamespace(
            config=SimpleNamespace(cameras=["ip1"], state=state),
            latest=self.topics.get,
            picture_of=lambda camera, which: f"http://127.0.0.1/{camera}",
            hub=SimpleNamespace(spread=self.told.extend),
        )
        self.thumbnails = Thumbnails(cast(House, house), cast(Videos, SimpleNamespace(snapshot=self._snapshot)))
        self.say("places", {"Sofa": {}, "Desk": {}})

    def say(self, what: str, payload: Any) -> None:
        self.topics[f"camera/ip1/{what}"] = json.dumps(payload)

    def at(self, place: str | None, *, moving: bool = False) -> None:
        self.say("position", {"pan": 1.0, "tilt": 2.0, "zoom": 0.0, "moving": moving, "place": place})

    def look(self, seconds: float) -> None:
        """Once a second, as the server does."""
        for _ in range(round(seconds)):
            self.now += 1.0
            asyncio.run(self.thumbnails.look(self.now))

    async def _snapshot(self, url: str) -> Still:
        self.asked += 1
        if self.away:
            raise Unavailable("it is away")
        grey = np.full((576, 1024, 3), 10 * self.asked, np.uint8)
        return Still(cv2.imencode(".jpg", grey)[1].tobytes(), self.now - self.late)

    def shows(self, place: str) -> int | None:
        """Which of its pictures is kept of a place, the first one being 1."""
        data = self.thumbnails.get("ip1", place)
        return None if data is None else round(float(cv2.imdecode(np.frombuffer(data, np.uint8), 0).mean()) / 10)


@pytest.fixture
def camera(tmp_path: Path) -> Camera:
    return Camera(tmp_path)


def test_a_place_is_taken_when_the_camera_has_stood_there_a_while(camera: Camera) -> None:
    camera.at("Sofa", moving=True)
    camera.look(10)
    camera.at("Sofa")
    camera.look(STANDS_S)
    assert camera.asked == 0, "the newest picture may be one of the turn"
    camera.look(1)
    assert (camera.asked, camera.shows("Sofa"), camera.shows("Desk")) == (1, 1, None)


def test_a_camera_that_only_passes_is_not_taken(camera: Camera) -> None:
    for place in ("Sofa", "Desk", "Sofa", "Desk"):
        camera.at(place)
        camera.look(STANDS_S - 1)
        camera.at(None, moving=True)
        camera.look(1)
    assert camera.asked == 0


def test_one_that_turns_away_while_its_picture_comes_is_not_kept(camera: Camera) -> None:
    camera.at("Sofa")
    snapshot = camera.thumbnails.videos.snapshot

    async def turns(url: str) -> Still:
        camera.at("Sofa", moving=True)
        return await snapshot(url)

    camera.thumbnails.videos.snapshot = turns  # type: ignore[method-assign]
    camera.look(STANDS_S + 1)
    assert (camera.asked, camera.shows("Sofa")) == (1, None)


def test_a_picture_from_before_it_stood_there_is_not_kept(camera: Camera) -> None:
    """A stream may be seconds late, where its viewers keep the computer busy."""
    camera.late = 6.0
    camera.at("Sofa")
    camera.look(7)
    assert (camera.asked > 0, camera.shows("Sofa")) == (True, None)
    camera.look(1)
    assert camera.shows("Sofa") == camera.asked


def test_a_scan_is_not_disturbed(camera: Camera) -> None:
    camera.at("Sofa")
    camera.say("scan/state", {"state": "running"})
    camera.look(20)
    assert camera.asked == 0
    camera.say("scan/state", {"state": "done"})
    camera.look(STANDS_S + 1)
    assert camera.asked == 1


def test_it_is_taken_again_after_an_hour_only_and_kept_over_a_restart(camera: Camera, tmp_path: Path) -> None:
    camera.at("Sofa")
    camera.look(60)
    assert camera.asked == 1
    told = json.loads(camera.told[-1].text)
    assert list(told) == ["Sofa"]
    camera.now += AGAIN_S
    camera.look(10)
    assert (camera.asked, camera.shows("Sofa")) == (2, 2)
    assert Camera(tmp_path).shows("Sofa") == 2
    assert all(one.topic == f"{TOPIC}ip1" for one in camera.told)


def test_one_camera_whose_words_are_none_takes_nothing_from_the_others(
    camera: Camera, caplog: pytest.LogCaptureFixture
) -> None:
    camera.thumbnails.house.config.cameras = ["ip0", "ip1"]  # type: ignore[misc, assignment]
    camera.topics["camera/ip0/places"] = "{"
    camera.at("Sofa")
    camera.look(STANDS_S + 1)
    assert camera.shows("Sofa") == 1
    assert caplog.text.count("no small pictures of ip0") == 1


def test_a_camera_without_a_picture_is_left_alone_for_a_while(camera: Camera) -> None:
    camera.away = True
    camera.at("Sofa")
    camera.look(60)
    assert camera.asked == 1
    camera.away = False
    camera.look(90)
    assert (camera.asked, camera.shows("Sofa")) == (2, 2)
