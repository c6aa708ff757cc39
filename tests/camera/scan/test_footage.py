"""Which pictures of a stream belong to which visit: none of a turning camera, none twice, none from another place."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import numpy as np
import pytest

from services.camera.scan.footage import Footage, Glimpse, Visit
from services.camera.video.likeness import Likeness
from services.camera.video.newest import Frame, Upright
from services.camera.video.timing import Exposure

LATENCY_S = 0.8
START = 1000.0


def frame(number: int, at: float, unsure: float = 0.4) -> Frame:
    return Frame(number, lambda: np.zeros((9, 16, 3), np.uint8), Exposure(at, unsure), at + LATENCY_S, Upright())


@dataclass
class Camera:
    """Hops between poses with a stream that arrives late; the footage knows of the exposures only what is told."""

    footage: Footage
    off_s: float = 0.0  # how far exposures are told too late
    jitter_s: float = 0.0
    rng: random.Random = field(default_factory=lambda: random.Random(1))
    now: float = START
    pose: float = 0.0  # the number of the place; between two, it turns
    poses: dict[int, float] = field(default_factory=dict)  # by frame: where it was truly exposed
    flying: list[tuple[float, Frame, Likeness]] = field(default_factory=list)
    given: list[tuple[Visit, Frame]] = field(default_factory=list)
    last: float = 0.0

    def live(self, seconds: float, to: float | None = None) -> None:
        """Lets time pass, at rest or on the way to another pose."""
        begun, came_from = self.now, self.pose
        for _ in range(round(seconds / 0.1)):
            self.now += 0.1
            if to is not None:
                self.pose = came_from + (to - came_from) * min(1.0, (self.now - begun) / seconds)
            number = len(self.poses) + 1
            self.poses[number] = self.pose
            told = self.now + self.off_s + self.rng.uniform(-self.jitter_s, self.jitter_s)
            like: Likeness = "same" if self.pose == self.last else "moved"
            self.last = self.pose
            self.flying.append((self.now + LATENCY_S + self.off_s, frame(number, told), like))
            while self.flying and self.flying[0][0] <= self.now:
                _, picture, how = self.flying.pop(0)
                self.given += self.footage.take(Glimpse(picture, how, 0.0))

    def hop(self, to: float, seconds: float, wanted: int, stays: float) -> Visit:
        self.footage.leave(self.now - 0.1, self.now)
        self.live(seconds, to)
        visit = Visit(wanted, self.now + 0.02)
        self.footage.open(visit)
        self.live(stays)
        return visit


@pytest.mark.parametrize(("off_s", "jitter_s"), [(0.0, 0.0), (0.3, 0.0), (-0.3, 0.02), (0.1, 0.04)])
def test_every_visit_gets_its_own_pictures_although_they_come_when_it_is_over(off_s: float, jitter_s: float) -> None:
    camera = Camera(Footage(), off_s, jitter_s)
    camera.live(2.0)
    visits = [camera.hop(float(number), 1.2, 8, 1.1) for number in range(1, 8)]
    camera.footage.leave(camera.now, camera.now)
    camera.live(3.0, 9.0)
    whose = [(visits.index(visit) + 1, camera.poses[picture.number]) for visit, picture in camera.given]
    assert {pose for _, pose in whose} == set(map(float, range(1, 8)))
    assert all(number == pose for number, pose in whose)
    assert [visit.got for visit in visits] == [8] * 7


def test_no_picture_is_given_twice() -> None:
    camera = Camera(Footage())
    camera.live(1.0)
    for number in range(1, 5):
        camera.hop(float(number), 0.8, 4, 1.5)
    camera.live(2.0)
    numbers = [picture.number for _, picture in camera.given]
    assert len(numbers) == len(set(numbers)) == 16


def test_how_late_the_picture_is_is_learnt_from_when_it_begins_to_move() -> None:
    camera = Camera(Footage(), off_s=0.25)
    camera.live(1.0)
    for number in range(1, 6):
        camera.hop(float(number), 1.0, 4, 1.0)
    camera.live(2.0)
    picture = frame(1, camera.now)
    assert camera.footage.offset == pytest.approx(-0.25, abs=0.06)
    assert camera.footage.unsure(picture) < 0.15 < picture.exposure.uncertainty


def test_a_visit_lasts_as_long_as_its_pictures_need_and_longer_where_some_were_lost() -> None:
    camera = Camera(Footage())
    camera.live(1.0)
    first = camera.footage.long_enough(Visit(8, 0.0))
    for number in range(1, 16):
        camera.hop(float(number), 1.0, 8, 1.0)
    camera.live(1.5)
    visit = Visit(8, camera.now)
    assert 0.6 <= camera.footage.long_enough(visit) - visit.since < 0.95 < first
    for number in range(16, 22):
        late = camera.hop(float(number), 1.0, 8, 1.0)
        late.since -= 0.3  # it was read at rest before the pictures showed it
    camera.live(1.5)
    assert camera.footage.long_enough(visit) - visit.since > 0.95


def test_visits_last_the_longer_the_more_they_differ() -> None:
    lasts = []
    for differ in (0.0, 0.15):
        camera = Camera(Footage())
        camera.live(1.0)
        for number in range(1, 10):
            camera.hop(float(number), 1.0, 8, 1.3).since += differ * (-1) ** number
        camera.live(1.5)
        visit = Visit(8, camera.now)
        lasts.append(camera.footage.long_enough(visit) - visit.since)
    assert lasts[0] + 0.15 < lasts[1] < lasts[0] + 0.35


def test_a_visit_is_over_when_the_motion_that_ended_it_was_seen() -> None:
    camera = Camera(Footage())
    camera.live(1.0)
    camera.hop(1.0, 1.0, 4, 1.0)
    short = camera.hop(2.0, 1.0, 20, 1.0)
    camera.footage.leave(camera.now - 0.1, camera.now)
    camera.live(LATENCY_S - 0.3, 3.0)
    assert not short.over
    camera.live(0.6, 3.0)
    assert short.over
    assert 9 <= short.got <= 11


def test_a_visit_teaches_once_how_long_they_last_and_one_that_waited_for_the_stream_does_not() -> None:
    def lasts(*, teaches: bool, flashes: bool) -> float:
        footage = Footage()
        for number in range(1, 8):
            visit = Visit(8, START + number * 10, teaches=teaches or number > 1)
            footage.open(visit)
            footage.leave(visit.since + 1.2, visit.since + 1.2)
            pictures = [*[0.0] * (12 if number > 1 else 3), *([9.0, 0.0, 0.0, 0.0, 0.0] if flashes else [])]
            for step, lighter in enumerate(pictures):
                picture = frame(number * 100 + step, visit.since + 0.05 + step / 10, 0.01)
                footage.take(Glimpse(picture, "same" if step else "moved", lighter))
            footage.take(Glimpse(frame(number * 100 + 50, visit.since + 2.0, 0.01), "moved", 0.0))
        ends = Visit(8, START + 100.0)
        return footage.long_enough(ends) - ends.since

    usual = lasts(teaches=False, flashes=False)
    assert usual == pytest.approx(lasts(teaches=False, flashes=True), abs=0.06)
    assert usual + 0.2 < lasts(teaches=True, flashes=False)


def test_pictures_of_a_light_that_has_not_settled_are_not_taken_after_a_change_of_the_mode() -> None:
    footage = Footage()
    visit = Visit(3, START, steady=True)
    footage.open(visit)
    steps = [30.0, 7.0, 7.0, 5.0, 0.3, 0.2, 0.1, 0.2]
    given = []
    for number, step in enumerate(steps):
        given += footage.take(Glimpse(frame(number, START + 0.5 + number / 10, 0.1), "same", step))
    assert [picture.number for _, picture in given] == [4, 5, 6]


def test_a_visit_whose_pictures_do_not_come_is_given_up() -> None:
    footage = Footage()
    footage.open(Visit(4, START))
    footage.leave(START + 1.0, START + 1.0)
    assert footage.pending(START + 1.5, LATENCY_S)
    assert not footage.pending(START + 10.0, LATENCY_S)


def test_where_nothing_can_be_seen_time_alone_tells_whose_a_picture_is() -> None:
    footage = Footage()
    visit = Visit(20, START)
    footage.open(visit)
    footage.leave(START + 1.0, START + 1.0)
    given = []
    for number in range(30):
        given += footage.take(Glimpse(frame(number, START - 1.0 + number / 10, 0.1), "unclear", 0.0))
    times = [picture.exposure.at for _, picture in given]
    assert times
    assert min(times) > START
    assert max(times) < START + 1.0
