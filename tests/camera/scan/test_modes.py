"""The second picture mode, there and back, on firmware that takes mode and contrast at once, and that does not."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from services.camera.device import Away, GetPicture, Picture, Refused, Reply, Request, SetPicture
from services.camera.errands import GetContrast, SetContrast
from services.camera.plan import Plan, Stage
from services.camera.scan.modes import Modes
from services.errors import DeviceError

BEFORE = (Picture(False, False, "auto"), (50, 45, 50))
HIGH = (Picture(False, False, "bw"), (80, 80, 80))
ANSWER_S = 0.3


@dataclass
class Firmware:
    """How the picture is, and what became of it; each answer takes its time."""

    refuses_both: bool = False
    deaf_to_both: bool = False
    deaf_to_contrast: bool = False
    away_at: type[Request] | None = None  # type: ignore[valid-type]
    picture: Picture = BEFORE[0]
    contrast: tuple[int, ...] = BEFORE[1]
    changed_at: list[float] = field(default_factory=list)
    now: float = 100.0

    def run(self, plan: Plan[Any]) -> Any:
        """A plan to its end; raises what ended it."""
        asked: list[tuple[Request, int]] = []
        run = (stage := Stage(lambda request, ticket: asked.append((request, ticket)))).begin(
            plan, self.now, lambda run, now: None
        )
        for _ in range(20):
            if run.done:
                break
            (request, ticket), sent = asked.pop(), self.now
            self.now += ANSWER_S
            try:
                reply = Reply(request, ticket, self._answer(request), None, sent, self.now)
            except DeviceError as error:
                reply = Reply(request, ticket, None, error, sent, self.now)
            stage.reply(reply, self.now)
        if run.error is not None:
            raise run.error
        assert run.done
        return run.result

    def _answer(self, request: Request) -> object:
        if self.away_at is type(request):
            raise Away("it restarts")
        match request:
            case SetPicture(mode=mode, contrast=contrast):
                if contrast and self.refuses_both:
                    raise Refused("Bad Request!")
                self.picture = Picture(False, False, mode or self.picture.mode)
                if contrast and not self.deaf_to_both and not self.deaf_to_contrast:
                    self.contrast = contrast
                self.changed_at.append(self.now)
                return self.picture
            case SetContrast(values):
                if not self.deaf_to_contrast:
                    self.contrast = values
                    self.changed_at.append(self.now)
                return self.contrast
            case GetPicture():
                return self.picture
            case GetContrast():
                return self.contrast
        raise AssertionError(request)


@pytest.mark.parametrize(
    ("firmware", "changes"),
    [(Firmware(), 1), (Firmware(refuses_both=True), 2), (Firmware(deaf_to_both=True), 2)],
)
def test_mode_and_contrast_change_and_are_as_before_in_the_end(firmware: Firmware, changes: int) -> None:
    modes = Modes(None)
    changed = firmware.run(modes.enter())
    assert (firmware.picture, firmware.contrast) == HIGH
    assert len(firmware.changed_at) == changes
    assert firmware.changed_at[-1] - ANSWER_S <= changed <= firmware.changed_at[-1]
    firmware.run(modes.leave())
    assert (firmware.picture, firmware.contrast) == BEFORE
    assert len(firmware.changed_at) == 2 * changes
    assert not modes.changed


def test_a_contrast_that_stays_as_it_is_does_not_hinder_the_mode() -> None:
    firmware, modes = Firmware(deaf_to_contrast=True), Modes(None)
    firmware.run(modes.enter())
    assert (firmware.picture, firmware.contrast) == (HIGH[0], BEFORE[1])
    firmware.run(modes.leave())
    assert (firmware.picture, firmware.contrast) == BEFORE


@pytest.mark.parametrize("at", [SetPicture, SetContrast])
def test_a_camera_that_goes_away_meanwhile_is_still_to_be_restored(at: type[Request]) -> None:  # type: ignore[valid-type]
    firmware, modes = Firmware(deaf_to_both=True), Modes(None)
    firmware.run(modes.enter())
    firmware.away_at = at
    with pytest.raises(Away):
        firmware.run(modes.leave())
    assert modes.changed
    firmware.away_at = None
    firmware.run(modes.leave())
    assert (firmware.picture, firmware.contrast) == BEFORE
    assert not modes.changed


def test_the_note_is_whole_at_every_moment(tmp_path: Path) -> None:
    """Whoever has begun to read it reads on in the old one: it is replaced, and not written over."""
    file = tmp_path / "cameras" / "ip1-picture.json"
    Firmware().run(Modes(file).enter())
    before = f" {file.read_text()}"
    file.write_text(before)
    with file.open() as reader:
        modes = Modes(file)
        Firmware().run(modes.enter())
        assert file.read_text() == before.strip()
        assert reader.read() == before
