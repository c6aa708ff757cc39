"""A stop is on its way before anything else is done about the end of a motion; and a clock that is set is no answer."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.camera.device import Request, Stop
from services.camera.ptz import kept
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
    assert happens[0] == "stop"
    assert "write" in happens


@pytest.mark.parametrize("step_s", [3600.0, -3600.0])
def test_an_answer_over_which_the_clock_was_set_teaches_nothing(step_s: float) -> None:
    skill = Skill()
    for _ in range(20):
        skill.timed(0.3)
    tail, count = skill.timing.tail, skill.timing.count
    skill.timed(0.3 + step_s)
    assert (skill.timing.tail, skill.timing.count) == (tail, count)
