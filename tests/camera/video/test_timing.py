"""When a picture was exposed, from stream times and arrivals alone."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest

from services.camera.video.timing import Exposure, Held, StreamClock

LATENCY_S, UNSURE_S, STEP_S = 0.3, 0.1, 1 / 15


def settled(relation: StreamClock, seconds: float = 5.0) -> float:
    """A calm beginning; the stream time at its end."""
    steps = int(seconds / STEP_S)
    for number in range(steps):
        relation.take(number * STEP_S, 1000 + number * STEP_S + LATENCY_S)
    return steps * STEP_S


def test_the_fastest_packets_tell_the_relation_and_waiting_ones_do_not_move_it() -> None:
    relation, jitter = StreamClock(LATENCY_S, UNSURE_S), random.Random(1)
    start = settled(relation)
    for number in range(300):
        stream_s = start + number * STEP_S
        exposure = relation.take(stream_s, 1000 + stream_s + LATENCY_S + jitter.expovariate(10))
        assert abs(exposure.at - (1000 + stream_s)) < 0.01
        assert exposure.uncertainty == UNSURE_S


def test_pictures_of_an_unsteady_camera_do_not_seem_to_have_come_before_they_did() -> None:
    """FFmpeg hands each one on when the next begins, however far that is from it."""
    relation, held, rng = StreamClock(0.0, UNSURE_S), Held(), random.Random(3)
    times = [0.0]
    for number in range(600):
        times.append(times[-1] + (STEP_S if number < 60 or rng.random() < 0.7 else rng.uniform(0.04, 0.3)))
    for number, (stream_s, following) in enumerate(pairwise(times)):
        exposure = relation.take(stream_s, 1000 + following - held.take(stream_s))
        if number > 60:
            assert abs(exposure.at - (1000 + stream_s)) < 0.03


def test_pictures_that_arrive_later_and_later_are_a_queue_and_keep_their_time_of_exposure() -> None:
    relation = StreamClock(LATENCY_S, UNSURE_S)
    start = settled(relation)
    assert not relation.queueing
    for number in range(300):
        stream_s = start + number * STEP_S
        exposure = relation.take(stream_s, 1000 + stream_s + LATENCY_S + 0.1 * number * STEP_S)
        assert abs(exposure.at - (1000 + stream_s)) < 0.01
    assert relation.queueing
    assert relation.latency == pytest.approx(LATENCY_S + 0.1 * 300 * STEP_S, abs=0.3)


def test_a_short_pause_of_the_network_is_no_queue() -> None:
    relation = StreamClock(LATENCY_S, UNSURE_S)
    start = settled(relation)
    for number in range(100):
        stream_s = start + number * STEP_S
        burst = 1000 + start + 1.0 + LATENCY_S  # nothing comes for a second, then all at once
        relation.take(stream_s, max(burst, 1000 + stream_s + LATENCY_S))
    assert not relation.queueing


def test_nothing_is_believed_of_the_first_pictures_of_a_connection() -> None:
    relation = StreamClock(LATENCY_S, UNSURE_S)
    first = relation.take(7.0, 1000.0)  # it may come from a store, and be seconds old
    assert not first.after(998.5)
    assert relation.take(7.5, 1000.1).uncertainty > 1.5


def test_a_new_time_base_begins_anew() -> None:
    relation = StreamClock(LATENCY_S, UNSURE_S)
    settled(relation)
    exposure = relation.take(0.0, 2000.0)  # the encoder has restarted
    assert exposure.at == pytest.approx(2000.0 - LATENCY_S)
    assert exposure.uncertainty > 1.5


def test_quartz_that_drifts_is_followed() -> None:
    relation = StreamClock(LATENCY_S, UNSURE_S)
    for number in range(20000):
        true = 1000 + number * STEP_S
        exposure = relation.take(number * STEP_S * (1 - 100e-6), true + LATENCY_S)
    assert abs(exposure.at - true) < 0.02
    assert not relation.queueing


@pytest.mark.parametrize(
    ("exposure", "moment", "after"),
    [
        (Exposure(10.0, 0.1), 9.8, True),
        (Exposure(10.0, 0.1), 9.95, False),
        (Exposure(10.0, 0.1), 10.5, False),
    ],
)
def test_only_a_picture_that_is_surely_from_after_the_end_of_a_move_counts(
    exposure: Exposure, moment: float, after: bool
) -> None:
    assert exposure.after(moment) is after
