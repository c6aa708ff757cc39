"""Where an axis will rest, told by a look on the last bit of its way."""

from __future__ import annotations

from dataclasses import replace
from math import hypot, isfinite

import pytest

from services.camera.device import Reading, Reply, Status
from services.camera.ptz.glide import Glide
from services.camera.ptz.goal import Pose
from services.camera.ptz.landing import Doubts, End, at_end, doubts, ends, foretell, judge, read, sight, stray
from services.camera.ptz.scale import Hop, Turned, strays
from services.camera.ptz.skill import Skill

WAY = Glide(began=0.0, place=10.0, speed=0.0, goal=40.0, top=45.0, acceleration=90.0, answered=0.0)
KNOWN = Doubts(goal=0.2, place=0.0, read=0.06, time=0.005, change=0.02)
LATE = WAY.within(0.3)  # most of the braking is done then
AIM: Pose = (40.0, 20.0, 0.0)
STANDS = read(20.0, KNOWN)


def test_a_look_that_is_as_was_reckoned_leaves_the_goal_and_little_doubt() -> None:
    end = foretell(WAY, LATE, WAY.at(LATE)[0], KNOWN)
    assert end.at == pytest.approx(40.0)
    assert end.seen == pytest.approx(40.0)
    assert end.before == 0.2
    assert 0.06 < end.doubt < 0.15
    assert not end.odd


@pytest.mark.parametrize("off", [-0.3, 0.3])
def test_what_is_off_its_course_on_its_last_bit_ends_as_far_off(off: float) -> None:
    sure = foretell(WAY, LATE, WAY.at(LATE)[0], KNOWN)
    end = foretell(WAY, LATE, WAY.at(LATE)[0] + off, KNOWN)
    assert 0.5 * abs(off) < abs(end.at - 40.0) < 1.2 * abs(off)
    assert (end.at - 40.0) * off > 0
    assert end.seen - 40.0 == pytest.approx(off, rel=0.3)
    assert end.doubt > sure.doubt


def test_the_farther_its_goal_was_in_doubt_the_more_a_look_is_believed() -> None:
    ends = [foretell(WAY, LATE, WAY.at(LATE)[0] + 0.2, replace(KNOWN, goal=goal)).at for goal in (0.05, 0.2, 0.8)]
    assert ends == sorted(ends)
    assert ends[0] < 40.1 < ends[2]


def test_before_it_brakes_a_look_tells_little_of_the_goal() -> None:
    early = WAY.brakes - 0.02
    end = foretell(WAY, early, WAY.at(early)[0], KNOWN)
    assert end.doubt == pytest.approx(end.before, rel=0.05)
    beside = foretell(WAY, early, WAY.at(early)[0] + 0.1, KNOWN)
    assert abs(beside.at - 40.0) < 0.1


def test_a_look_that_is_too_far_off_is_odd_unless_so_much_was_in_doubt() -> None:
    place = WAY.at(LATE)[0] + 1.0
    assert foretell(WAY, LATE, place, KNOWN).odd
    assert not foretell(WAY, LATE, place, replace(KNOWN, goal=1.0)).odd
    assert not foretell(WAY, LATE, place, replace(KNOWN, place=1.0)).odd


def test_where_a_long_way_at_a_speed_that_is_not_quite_known_is_over_a_look_tells_less() -> None:
    skill, still = Skill(), (0.0, 0.0, 0.0)
    skill.paces[0].cov *= 1e-3

    def hop(way: float) -> Hop:
        return Hop(still, (way / 180.0, 0.0), (way, 0.0, 0.0), still, (45.0, 27.0, 4.0), None, 0.0)

    short, far = (doubts(skill, "moveRelatively", [hop(way)], 0.0)[0].start for way in (20.0, 170.0))
    assert short < 0.02 < far / 3
    after = [
        doubts(skill, "moveRelatively", [hop(170.0), replace(hop(2.0), rested=rested)], 0.0)[0] for rested in (0.0, 1.0)
    ]
    assert after[0].start > far / 2  # the hop before may not have been over
    assert after[1].start < 0.02


def test_the_later_than_usual_a_hop_acted_the_less_is_known_of_where_it_began_and_when_it_ends() -> None:
    skill, still = Skill(), (0.0, 0.0, 0.0)
    rest = Hop(still, (0.1, 0.0), (18.0, 0.0, 0.0), still, (45.0, 27.0, 4.0), None, 1.0)
    flight = replace(rest, speeds=(-30.0, 0.0, 0.0))
    usual, late = (
        [doubts(skill, "moveRelatively", [replace(hop, moment=moment)], 0.0)[0] for hop in (rest, flight)]
        for moment in (0.003, 0.05)
    )
    assert [one.start for one in late] == pytest.approx([hypot(one.start, 0.05 * one.share) for one in usual], rel=0.01)
    assert usual[0].place == late[0].place == 0.0  # at rest it is the same whenever it acts
    assert late[1].place > usual[1].place + 0.5
    assert late[1].goal == pytest.approx(usual[1].goal)


def test_however_fast_a_hop_takes_the_place_of_another_it_ends_as_far_off_as_the_first_one_began() -> None:
    """All of them go on from where the camera is, and that is beside where it is thought to be by as much."""
    skill, still = Skill(), (0.0, 0.0, 0.0)
    turned = Turned((), 0.0, 20.0, 0.0, 0.0)
    first = Hop(still, (0.1, 0.0), (18.0, 0.0, 0.0), (45.0, 0.0, 0.0), (45.0, 27.0, 4.0), (turned, turned), 0.0)
    known = [
        doubts(skill, "moveRelatively", [first, replace(first, speeds=(speed, 0.0, 0.0), turned=None)], 0.0)[0]
        for speed in (5.0, 25.0, 44.0)
    ]
    assert all(one.place >= one.share * turned.doubt for one in known)


def test_what_hops_from_rest_showed_says_nothing_of_those_that_begin_in_flight() -> None:
    skill, still = Skill(), (0.0, 0.0, 0.0)
    rest = Hop(still, (0.1, 0.0), (18.0, 0.0, 0.0), still, (45.0, 27.0, 4.0), None, 1.0)
    flight = replace(rest, speeds=(0.0, -8.0, 0.0))

    def shares() -> list[float]:
        return [doubts(skill, "moveRelatively", [hop], 0.0)[0].share for hop in (rest, flight)]

    before = shares()
    exact = [End(20.0, 0.1, 0.2, 20.0, 0.06)] * 2
    for _ in range(20):
        stray(strays(skill.scales["moveRelatively"], [rest]), (replace(WAY, goal=20.0),) * 2, (KNOWN, KNOWN), exact)
    after = shares()
    assert after[0] < before[0] / 2
    assert after[1] == before[1]


def test_a_short_hop_is_looked_at_before_it_brakes_but_not_before_that_shows_whether_it_goes() -> None:
    short, still = replace(WAY, goal=WAY.place + 2.0), replace(WAY, place=20.0, goal=20.0)
    known, skill = replace(KNOWN, goal=0.06, time=0.001, change=0.005, share=0.15), Skill()
    when = sight(skill, (short, still, still), (known, known))
    assert when is not None
    seen = when + skill.read_late
    assert short.began < seen < short.brakes
    stays = foretell(short, seen, short.place, known)
    assert stays.odd
    assert judge((short.goal, 20.0, 0.0), 0.42, (stays, STANDS)) == "unsure"


@pytest.mark.parametrize("way", [0.0, 1e-9, -1e-9, -30.0])
def test_an_axis_that_hardly_goes_or_is_at_its_goal_has_an_end(way: float) -> None:
    glide = replace(WAY, goal=WAY.place + way)
    for when in (glide.began, glide.within(0.1), glide.ends, glide.ends + 1.0):
        end = foretell(glide, when, glide.at(when)[0], KNOWN)
        assert all(map(isfinite, (end.at, end.doubt, end.before, end.seen, end.noise)))
        assert end.at == pytest.approx(glide.goal, abs=1e-6)


@pytest.mark.parametrize(("moving", "odd"), [(True, False), (False, True), (None, False)])
def test_a_camera_that_says_it_rests_before_it_should_does_not_go_as_was_reckoned(
    moving: bool | None, odd: bool
) -> None:
    skill, still = Skill(says_moving=True), replace(WAY, place=20.0, goal=20.0)
    place = WAY.at(LATE)[0]
    reply = Reply(Status(), 1, Reading(place, 20.0, 0.0, moving), None, LATE, LATE + skill.timing.usual)
    told = ends(skill, (WAY, still, still), (KNOWN, KNOWN), reply, (place, 20.0, 0.0))
    assert [end.odd for end in told] == [odd, odd]
    rested = replace(reply, sent=WAY.ends + 0.1, received=WAY.ends + 0.1 + skill.timing.usual)
    told = ends(skill, (WAY, still, still), (KNOWN, KNOWN), rested, (40.3, 20.0, 0.0))
    assert (told[0] == read(40.3, KNOWN)) is odd
    assert told[0].odd is bool(moving)  # and one that says it moves when it should rest does not either


def test_it_has_arrived_where_it_surely_ends_at_the_goal() -> None:
    end = foretell(WAY, LATE, WAY.at(LATE)[0], KNOWN)
    assert judge(AIM, 0.42, (end, STANDS)) == "there"
    assert judge(AIM, 0.42, (end, replace(STANDS, at=20.4, seen=20.4))) == "unsure"
    assert judge(AIM, 0.42, (replace(end, seen=40.5), STANDS)) == "unsure"
    assert judge(AIM, 0.42, (replace(end, doubt=0.3), STANDS)) == "unsure"
    assert judge(AIM, 0.42, (replace(end, odd=True), STANDS)) == "unsure"


def test_a_look_on_the_way_may_be_as_far_off_as_its_noise() -> None:
    early = WAY.within(2.0)
    end = foretell(WAY, early, WAY.at(early)[0], replace(KNOWN, goal=0.06))
    assert judge(AIM, 0.42, (end, STANDS)) == "there"
    assert judge(AIM, 0.42, (replace(end, seen=40.5, noise=0.6), STANDS)) == "there"
    assert judge(AIM, 0.42, (replace(end, seen=40.7, noise=0.6), STANDS)) == "unsure"


def test_the_less_is_in_doubt_the_earlier_on_the_way_a_look_is_had() -> None:
    skill, still = Skill(), replace(WAY, place=20.0, goal=20.0)
    exact = replace(KNOWN, time=0.001, change=0.005, share=0.15)
    known = [replace(exact, goal=0.06), replace(exact, goal=0.6), replace(exact, goal=0.6, time=0.01)]
    looks = [sight(skill, (WAY, still, still), (one, one)) or 0.0 for one in known]
    assert WAY.brakes - skill.read_late < looks[0] < looks[2] - 0.05
    assert looks[0] <= looks[1] < looks[2]  # the slower it is, the less it matters of which moment a look is


def test_where_a_hop_began_is_not_believed_before_it_brakes_unless_experience_leaves_little_doubt() -> None:
    early, off = WAY.brakes, 0.3
    place, known = WAY.at(early)[0] + off, replace(KNOWN, goal=0.05, place=0.3, time=0.001, change=0.005)
    new, familiar = (foretell(WAY, early, place, replace(known, share=share)).at - 40.0 for share in (1.0, 0.15))
    assert new < off / 2 < familiar < off


def test_however_little_experience_leaves_in_doubt_a_look_shows_how_far_a_hop_goes() -> None:
    short, still = replace(WAY, goal=WAY.place + 5.8), replace(WAY, place=20.0, goal=20.0)
    known, skill = replace(KNOWN, goal=0.06, time=0.001, change=0.005, share=0.15), Skill()
    when = sight(skill, (short, still, still), (known, known))
    assert when is not None
    seen = when + skill.read_late
    assert seen > short.brakes + 0.02
    farther = replace(short, goal=short.goal + 0.7)  # one of 5.8 degrees did that after many exact ones
    told = foretell(short, seen, farther.at(seen)[0], known)
    assert judge((short.goal, 20.0, 0.0), 0.42, (told, STANDS)) == "unsure"


def test_doubt_of_the_hops_before_the_last_one_is_doubt_of_where_that_began() -> None:
    skill, still = Skill(), (0.0, 0.0, 0.0)

    def hop(way: float) -> Hop:
        return Hop(still, (way / 180.0, 0.0), (way, 0.0, 0.0), still, (45.0, 27.0, 4.0), None, 1.0)

    alone, chain = (doubts(skill, "moveRelatively", hops, 0.0)[0] for hops in ([hop(2.0)], [hop(40.0), hop(2.0)]))
    assert alone.place == 0.0
    assert chain.goal == pytest.approx(alone.goal)
    assert chain.place > 5 * chain.goal


@pytest.mark.parametrize(("doubt", "verdict"), [(0.1, "beside"), (0.24, "unsure"), (0.5, "unsure")])
def test_a_hop_goes_on_from_there_where_it_surely_ends_beside(doubt: float, verdict: str) -> None:
    beside = End(at=40.7, doubt=doubt, before=0.6, seen=40.7, noise=doubt)
    assert judge(AIM, 0.42, (beside, STANDS)) == verdict
    assert judge(AIM, 0.42, (replace(beside, at=41.5), STANDS)) == ("beside" if doubt < 0.25 else "unsure")
    assert judge(AIM, 0.42, (replace(beside, at=41.5, odd=True), STANDS)) == "unsure"


def test_the_reading_of_the_end_is_where_it_will_rest_and_says_nothing_of_motion() -> None:
    ends = (End(-10.126, 0.1, 0.2, -10.1, 0.1), End(20.0, 0.1, 0.2, 20.0, 0.1))
    assert at_end(Reading(350.9, 19.4, 2.0, True), ends) == Reading(349.87, 20.0, 2.0, None)
