"""Neither a stop nor the end of a move waits for the disk; an answer over which the clock was set teaches nothing."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from services.camera.device import Request, Stop
from services.camera.ptz import kept
from services.camera.ptz.kept import recalled
from services.camera.ptz.skill import Skill
from tests.camera.flat import Flat


def test_the_stop_is_sent_before_what_was_learnt_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flat = Flat(tmp_path, state=tmp_path / "state").online()
    happens: list[str] = []
    submit, write = flat.service.stage.submit, kept.write_whole

    def told(request: Request, ticket: int) -> None:
        happens.extend(["stop"] if isinstance(request, Stop) else [])
        submit(request, ticket)

    def written(file: Path, text: str) -> None:
        happens.append("write")
        write(file, text)

    flat.service.stage.submit = told
    monkeypatch.setattr(kept, "write_whole", written)
    flat.send("camera/ip1/position/set", b'{"pan": 200, "id": "a"}')
    flat.until(flat.started)
    happens.clear()
    flat.order("Move", "Stop", order_id="b")
    flat.until(lambda: flat.ended("a") and flat.ended("b"))
    assert (flat.states("a")[-1], flat.states("b")[-1]) == ("cancelled", "done")
    flat.service.close()
    assert happens[0] == "stop"
    assert "write" in happens


def test_a_move_is_done_and_the_next_one_stopped_while_the_disk_takes_its_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flat, spins, write = Flat(tmp_path, state=tmp_path / "state").online(), threading.Event(), kept.write_whole

    def slow(file: Path, text: str) -> None:
        assert spins.wait(60.0)
        write(file, text)

    monkeypatch.setattr(kept, "write_whole", slow)
    flat.send("camera/ip1/position/set", b'{"pan": 200, "id": "a"}')
    flat.until(lambda: flat.ended("a"))
    flat.send("camera/ip1/position/set", b'{"pan": 300, "id": "b"}')
    flat.until(lambda: flat.states("b") == ["accepted", "running"] and flat.motors.moving)
    flat.order("Move", "Stop", order_id="c")
    flat.until(lambda: flat.ended("b") and flat.ended("c"))
    assert [flat.states(one)[-1] for one in "abc"] == ["done", "cancelled", "done"]
    assert recalled(tmp_path / "state", "ip1") is None
    spins.set()
    flat.service.close()
    skill = recalled(tmp_path / "state", "ip1")
    assert skill is not None
    assert skill.timing.count == flat.service.trips.skill.timing.count


@pytest.mark.parametrize("step_s", [3600.0, -3600.0])
def test_an_answer_over_which_the_clock_was_set_teaches_nothing(step_s: float) -> None:
    skill = Skill()
    for _ in range(20):
        skill.timed(0.3)
    tail, count = skill.timing.tail, skill.timing.count
    skill.timed(0.3 + step_s)
    assert (skill.timing.tail, skill.timing.count) == (tail, count)
