"""What is due, in its order, at the simulation's own times."""

from __future__ import annotations

import pytest

from services.simulators.agenda import LONGEST_GAP_S, Agenda


def test_actions_run_in_the_order_of_their_times_and_then_of_asking() -> None:
    agenda, done = Agenda(), []
    agenda.run(0.0)
    for when, name in ((5.0, "b"), (1.0, "a"), (5.0, "c")):
        agenda.at(when, lambda time, name=name: done.append((name, time)))
    agenda.run(4.0)
    assert done == [("a", 1.0)]
    assert agenda.due == 5.0
    agenda.run(9.0)
    assert done == [("a", 1.0), ("b", 5.0), ("c", 5.0)]
    assert agenda.due is None


def test_an_action_may_ask_for_the_next_and_none_is_left_out() -> None:
    agenda, done = Agenda(), list[float]()

    def again(time: float) -> None:
        done.append(time)
        agenda.at(time + 1.0, again)

    agenda.run(0.0)
    agenda.at(1.0, again)
    agenda.run(5.5)
    assert done == [1.0, 2.0, 3.0, 4.0, 5.0]


@pytest.mark.parametrize("speed", [0.5, 1.0, 60.0])
def test_due_is_told_in_the_clocks_time(speed: float) -> None:
    agenda = Agenda(speed)
    agenda.run(1000.0)
    agenda.at(1030.0, lambda time: None)
    assert agenda.due == pytest.approx(1000.0 + 30.0 / speed)
    assert agenda.time(1002.0) == 1000.0 + 2.0 * speed


@pytest.mark.parametrize("speed", [0.3, 7.0, 60.0, 3333.0])
def test_what_is_due_is_done_when_it_is_due(speed: float) -> None:
    agenda, done = Agenda(speed), list[float]()
    agenda.run(1_769_857_200.123)
    for step in range(1000):
        agenda.at(1_769_857_200.123 + 0.7123 * step, done.append)
    while agenda.due is not None:
        before = len(done)
        agenda.run(agenda.due)
        assert len(done) > before


@pytest.mark.parametrize("jump", [LONGEST_GAP_S + 1, -3600.0])
def test_a_clock_that_is_set_takes_the_agenda_along(jump: float) -> None:
    agenda, done = Agenda(), list[float]()
    agenda.run(0.0)
    agenda.at(10.0, done.append)
    agenda.run(jump)
    assert done == []
    agenda.run(jump + 10.0)
    assert done == [jump + 10.0]
