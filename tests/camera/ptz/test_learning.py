"""What readings teach of the motors, and what they must not teach."""

from __future__ import annotations

import random
from copy import deepcopy
from typing import Literal

import numpy as np
import pytest

from services.camera.device import Direction, MoveTo, Reading, Reply, Start, Status
from services.camera.ptz.course import PAN, READ_DEG, ZOOM, Course
from services.camera.ptz.drive import Drive, judge
from services.camera.ptz.goal import Limits
from services.camera.ptz.move import goto
from services.camera.ptz.pace import PAN_RATES, READ_LATE, TILT_RATES, Pace, Seen, Told, taught
from services.camera.ptz.skill import Skill
from tests.camera.motors import Motors, drive

LIMITS = Limits()


def some_readings(rng: random.Random, usual: float) -> list[tuple[list[Told], Seen]]:
    """Turns and readings on the way; how late each answer came is told from what is usual."""
    found = []
    for _ in range(20):
        answered = rng.uniform(0.2, 0.5)
        told = [Told(1000.0, answered - usual, rng.choice((3, 6, 8)))]
        asked = 1000.0 + rng.uniform(0.2, 2.0)
        found.append((told, Seen(asked, rng.uniform(0.2, 0.5) - usual, rng.uniform(1.0, 60.0), 0.1)))
    return found


@pytest.mark.parametrize("seed", range(5))
def test_what_was_learnt_stays_as_true_when_another_delay_of_answers_is_the_usual_one(seed: int) -> None:
    pace, rng = Pace(PAN_RATES), random.Random(seed)
    for told, seen in some_readings(rng, 0.3):
        pace.learn(told, seen)
    moved = deepcopy(pace)
    moved.measure_late_from(0.07)
    before, after = some_readings(random.Random(9), 0.3), some_readings(random.Random(9), 0.37)
    for (told, seen), (told_then, seen_then) in zip(before, after, strict=True):
        assert moved.expected(told_then, seen_then) == pytest.approx(pace.expected(told, seen), rel=1e-3, abs=1e-3)


def zoom_rate_after(rate: float, begun: float, turn: Direction, reading: float) -> float:
    """What the rate of zoom, so far thought to be this, is thought to be after a turn of 1.5 s led there."""
    skill = Skill()
    skill.paces[ZOOM].mean[0] = rate
    course = Course(LIMITS, skill, (0.0, 20.0, begun))
    course.tell(Reply(Start(turn, 1), 1, None, None, 999.7, 1000.0), turn.value)
    seen = Reading(0.0, 20.0, reading)
    course.read(Reply(Status(), 2, seen, None, 1001.5, 1001.8), seen)
    return skill.paces[ZOOM].rate(1)


def test_a_reading_on_the_way_tells_where_it_is_however_little_was_known_of_the_way_to_there() -> None:
    course = Course(LIMITS, Skill(), (-100.0, 20.0, 0.0))
    course.skill.senses[PAN].sure = True
    for level, answered in ((8, 1000.0), (1, 1002.0)):  # fast, and then slowly: what was fast is not told apart
        course.tell(Reply(Start(Direction.RIGHT, level), 1, None, None, answered - 0.3, answered), (level, 0, 0))
    asked = 1004.7
    assert course.doubt(PAN, asked) == course.model_doubt(PAN, asked) > 10.0
    seen = Reading(340.0, 20.0, 0.0)
    course.read(Reply(Status(), 2, seen, None, asked, 1005.0), seen)
    assert READ_DEG < course.doubt(PAN, asked) < 4 * READ_DEG < course.model_doubt(PAN, asked)
    assert course.doubt(PAN, asked) < course.doubt(PAN, asked + 10.0) <= course.model_doubt(PAN, asked + 10.0)
    course.stand(LIMITS.pose(seen))
    assert course.doubt(PAN, 1015.0) == 0.0


@pytest.mark.parametrize("rate", [5.0, 9.5, 20.0, 45.0, 70.0])
def test_what_comes_less_far_than_was_thought_is_slow_and_does_not_only_take_long_to_be_fast(rate: float) -> None:
    pace, half = Pace(PAN_RATES), 1 / (2 * 120.0)
    for level, speed, looks in ((1, rate / 15, (1.5, 6.0)), (8, rate, (0.6, 1.1))):
        for seconds in looks:
            travel = speed * seconds - half * speed * speed
            pace.learn([Told(1000.0, 0.0, level)], Seen(1000.0 + seconds, 0.0, travel, 0.1))
        pace.age()
    assert pace.rate(8) == pytest.approx(rate, rel=0.2)


@pytest.mark.parametrize(
    ("here", "reads", "turned"),
    [
        pytest.param(100.0, [96.0, 92.0], False, id="it goes as it should"),
        pytest.param(100.0, [104.0, 108.0], True, id="it goes the other way"),
        pytest.param(100.0, [121.0, 117.0], False, id="it was farther, for a stop had no effect, and comes back"),
        pytest.param(100.0, [100.0, 100.0], False, id="it stands, as if the start had had no effect"),
        pytest.param(179.0, [179.0, 179.0], True, id="it stands at an end of its way, and should have left that"),
        pytest.param(179.0, [175.0, 171.0], False, id="it leaves that"),
    ],
)
def test_which_way_an_axis_turns_is_doubted_only_where_it_surely_goes_the_other_way(
    here: float, reads: list[float], turned: bool
) -> None:
    skill = Skill()
    skill.senses[PAN].sure, before = True, skill.senses[PAN].sign
    course = Course(LIMITS, skill, (here, 20.0, 0.0))
    course.tell(Reply(Start(Direction.LEFT, 3), 1, None, None, 999.7, 1000.0), (-2, 0, 0))  # 3 degrees/s
    for number, pan in enumerate(reads):
        seen = Reading(pan, 20.0, 0.0)
        asked = 1001.3 + 1.3 * number
        course.read(Reply(Status(), 2 + number, seen, None, asked, asked + 0.3), seen)
    assert (skill.senses[PAN].sign != before) == turned


@pytest.mark.parametrize(
    ("rate", "begun", "turn", "reading", "becomes"),
    [
        (1.0, 8.0, Direction.ZOOM_OUT, 4.0, "more"),
        (9.0, 8.0, Direction.ZOOM_OUT, 4.0, "less"),
        (1.0, 8.0, Direction.ZOOM_OUT, 0.0, "more"),
        (9.0, 8.0, Direction.ZOOM_OUT, 0.0, "the same"),
        (1.0, 0.0, Direction.ZOOM_IN, 0.0, "the same"),  # told in steps, the last step may not be over
    ],
)
def test_a_reading_at_an_end_of_the_range_may_show_that_it_went_faster_never_that_it_went_slower(
    rate: float, begun: float, turn: Direction, reading: float, becomes: str
) -> None:
    after = zoom_rate_after(rate, begun, turn, reading)
    assert becomes == ("more" if after > rate else "less" if after < rate else "the same")


def test_firmware_that_seemed_to_honour_tilt_is_found_out_when_it_stays() -> None:
    skill = Skill(honours={"PositionABS": "yes"})
    judge(skill, (10.0, 20.0, 0.0), Drive(MoveTo(40.0, 24.0, 0.0, "PositionABS"), (40.0, 24.0, 0.0)), (40.0, 20.0, 0.0))
    assert skill.honours["PositionABS"] == "pan"


@pytest.mark.parametrize("says", ["honest", "idle"])
def test_a_tilt_that_was_not_asked_for_shows_by_itself_that_firmware_goes_beside(
    says: Literal["honest", "idle"],
) -> None:
    """The first goal may be for zoom alone: it was led there by start and stop, and so was each one after it."""
    motors, skill = Motors(absolute="full", tilt_off=-2.0, acceleration=90.0, says=says), Skill()
    run, took = drive(goto(LIMITS.goal(90.0, 20.0, 4.0), LIMITS, skill, 1060.0), motors)
    assert run.error is None
    assert took < 6.0
    assert abs(motors.pose[1] - 20.0) <= 0.5
    assert (skill.honours["PositionABS"], skill.beside["PositionABS"][1]) == ("yes", pytest.approx(-2.0, abs=0.2))
    assert not any(isinstance(request, Start) for request in motors.sent)


@pytest.mark.parametrize("faster", [0.6, 1.6])
def test_what_is_wrong_although_it_was_known_well_is_learnt_anew(faster: float) -> None:
    """Turns rest far from where they should; if that were not believed, the next ones would too."""
    truth, pace = Pace(PAN_RATES), Pace(PAN_RATES)
    pace.mean[: len(PAN_RATES)] *= faster
    pace.cov *= 1e-4
    missed = []
    for turn in range(6):
        told = [Told(1000.0, 0.0, 8), Told(1001.5 + 0.1 * turn, 0.0, 0)]
        rests = truth.travel(told, 1010.0)
        missed.append(abs(pace.travel(told, 1010.0) - rests))
        pace.learn(told, Seen(1010.0, 0.0, rests, 0.3))
    assert missed[0] > 5.0
    assert missed[-1] < 0.5


@pytest.mark.parametrize(("off", "forgotten"), [(0.3, False), (1.5, True)])
def test_two_readings_that_dither_do_not_make_what_was_known_forgotten(off: float, forgotten: bool) -> None:
    """Where a short turn began was read as well as where it ended: both together may be beside by 0.3 degrees."""
    pace = Pace(PAN_RATES)
    pace.cov *= 1e-4
    told = [Told(1000.0, 0.0, 1), Told(1001.5, 0.0, 0)]
    pace.learn(told, Seen(1010.0, 0.0, pace.travel(told, 1010.0) + off, 0.08))
    assert (pace.doubt(8) > 0.05 * pace.rate(8)) is forgotten


def test_what_another_axis_learns_of_answers_is_as_if_it_was_seen_here() -> None:
    """Exactly so: readings of two axes have nothing in common but the moment that they tell of."""
    pan, tilt, direct = Pace(PAN_RATES), Pace(TILT_RATES), Pace(TILT_RATES)
    told = [Told(1000.0, 0.0, 5)]
    for pace in (tilt, direct):
        pace.learn(told, Seen(1001.0, 0.1, pace.travel(told, 1001.0) + 1.0, 0.1))
    pan.agree(tilt)
    for pace in (pan, direct):
        slope = np.zeros(len(pace.mean))
        slope[len(pace.guess) + READ_LATE] = 1.0
        pace.mean, pace.cov = taught(pace.mean, pace.cov, slope, 0.05, 0.03)
    tilt.agree(pan)
    assert tilt.mean == pytest.approx(direct.mean, abs=1e-9)
    assert tilt.cov == pytest.approx(direct.cov, abs=1e-9)
    assert tilt.rate(5) != pytest.approx(TILT_RATES[4], rel=0.01)
