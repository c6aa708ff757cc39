"""The bridge's own processes: when one that ended is started again."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from contextlib import closing
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

import pytest

from services.bridge.child import AGAIN_S, Child
from services.peers import wait_until

NAME, NOON = "trials", 1_768_000_000.0


def stays(wanted: Any, connection: Connection, every_s: float) -> None:
    """Until its end of the pipe closes."""
    connection.poll(None)


def ends(wanted: Any, connection: Connection, every_s: float) -> None:
    """At once."""


def started(target: Callable[[Any, Connection, float], None]) -> Iterator[Child]:
    with closing(Child(NAME, target, None, 1.0)) as child:
        assert child.tend(NOON)
        yield child


@pytest.fixture
def steady() -> Iterator[Child]:
    yield from started(stays)


@pytest.fixture
def broken() -> Iterator[Child]:
    yield from started(ends)


def running() -> list[BaseProcess]:
    """Those of these tests alone; the test's own process may have others."""
    return [process for process in multiprocessing.active_children() if process.name == NAME]


def ended() -> None:
    wait_until(lambda: not running(), "the end of the process")


def killed() -> None:
    for process in running():
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
