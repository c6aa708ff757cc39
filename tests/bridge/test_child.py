"""The bridge's own processes: when one that ended is started again."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from contextlib import closing
from multiprocessing.connection import Connection
from typing import Any

import pytest

from services.bridge.child import AGAIN_S, Child
from services.peers import wait_until

NOON = 1_768_000_000.0


def stays(wanted: Any, connection: Connection, every_s: float) -> None:
    """Until its end of the pipe closes."""
    connection.poll(None)


def ends(wanted: Any, connection: Connection, every_s: float) -> None:
    """At once."""


def started(target: Callable[[Any, Connection, float], None]) -> Iterator[Child]:
    with closing(Child("trials", target, None, 1.0)) as child:
        assert child.tend(NOON)
        yield child


@pytest.fixture
def steady() -> Iterator[Child]:
    yield from started(stays)


@pytest.fixture
def broken() -> Iterator[Child]:
    yield from started(ends)


def ended() -> None:
    """`active_children` forgets those that have ended."""
    wait_until(lambda: not multiprocessing.active_children(), "the end of the process")


def killed() -> None:
    for process in multiprocessing.active_children():
        process.kill()
    ended()


def test_one_that_runs_is_left_alone(steady: Child) -> None:
    assert not steady.tend(NOON + 1000)
    assert steady.runs
    assert steady.starts == 1


def test_one_that_ran_for_a_while_is_started_again_at_once(steady: Child) -> None:
    killed()
    assert steady.tend(NOON + AGAIN_S)
    assert steady.starts == 2


def test_one_that_ends_again_and_again_is_not_started_more_often(broken: Child) -> None:
    for start in range(3):
        ended()
        assert not broken.tend(NOON + (start + 1) * AGAIN_S - 0.1)
        assert broken.tend(NOON + (start + 1) * AGAIN_S)


def test_a_clock_that_was_set_back_does_not_keep_it_waiting(steady: Child) -> None:
    killed()
    assert not steady.tend(NOON - 3600)
    assert steady.tend(NOON - 3600 + AGAIN_S)
