"""The second picture mode, there and back, on firmware that takes mode and contrast at once, and that does not."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import pytest

from services.camera.device import Away, GetPicture, Mode, Picture, Refused, Reply, Request, SetPicture
from services.camera.errands import GetContrast, SetContrast
from services.camera.plan import Plan, Stage
from services.camera.scan.modes import Modes
from services.errors import DeviceError

BEFORE = (Picture(False, False, "auto", ("auto", "bw", "Gain")), (50, 45, 50))
HIGH = (Picture(False, False, "bw", ("bw", "bw", "bw")), (80, 80, 80))
ANSWER_S = 0.3


@dataclass
class Firmware:
    """How the picture is, and what became of it; each answer takes its time."""

    refuses_both: bool = False
    deaf_to_both: bool = False
    deaf_to_contrast: bool = False
    stuck: tuple[str, ...] = ("", "", "")  # modes that stay, whatever is written
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
            case SetPicture(modes=modes, contrast=contrast):
                if contrast and self.refuses_both:
                    raise Refused("Bad Request!")
                kept = tuple(map(lambda old, new: old or new, self.stuck, modes))
                self.picture = Picture(False, False, cast(Mode, kept[0]), kept if self.picture.modes else ())
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


def test_a_camera_with_one_mode_is_restored_to_it() -> None:
    firmware, modes = Firmware(picture=Picture(False, False, "color")), Modes(None)
    firmware.run(modes.enter())
    assert firmware.picture == Picture(False, False, "bw")
    firmware.run(modes.leave())
    assert firmware.picture == Picture(False, False, "color")


def test_a_profile_that_stays_as_it_is_does_not_hinder_the_others() -> None:
    firmware, modes = Firmware(stuck=("", "", "Gain")), Modes(None)
    firmware.run(modes.enter())
    assert firmware.picture.modes == ("bw", "bw", "Gain")
    firmware.run(modes.leave())
    assert (firmware.picture, firmware.contrast) == BEFORE


def test_modes_that_all_stay_as_they_are_are_refused_although_one_is_as_wanted() -> None:
    firmware = Firmware(stuck=BEFORE[0].modes)
    with pytest.raises(Refused, match="has not changed"):
        firmware.run(Modes(None).enter())


def test_as_before_means_every_profile() -> None:
    firmware, modes = Firmware(), Modes(None)
    firmware.run(modes.enter())
    firmware.stuck = ("", "", "bw")
    with pytest.raises(Refused, match="has not changed"):
        firmware.run(modes.leave())
    assert modes.changed


def test_what_the_camera_does_not_tell_is_not_written() -> None:
    firmware, modes = Firmware(picture=Picture(False, False, "auto", ("auto", "bw", ""))), Modes(None)
    firmware.run(modes.enter())
    assert firmware.picture.modes == ("bw", "bw", "")
    firmware.run(modes.leave())
    assert firmware.picture.modes == ("auto", "bw", "")


def test_black_and_white_by_day_alone_is_not_yet_how_the_second_turn_wants_it() -> None:
    firmware, modes = Firmware(picture=Picture(False, False, "bw", ("bw", "auto", "bw")), contrast=HIGH[1]), Modes(None)
    firmware.run(modes.enter())
    assert firmware.picture == HIGH[0]
    with pytest.raises(Refused, match="already"):
        firmware.run(Modes(None).enter())


@pytest.mark.parametrize(
    ("note", "known"),
    [
        ('{"modes": ["auto", "bw", "Gain"], "contrast": [50, 45, 50]}', ("auto", "bw", "Gain")),
        ('{"modes": ["auto", "", ""], "contrast": []}', ("auto", "", "")),
        ('{"mode": "auto", "contrast": [50, 45, 50]}', ("auto", "auto", "auto")),
        ('{"modes": ["auto", "bw&Flip=true"], "contrast": []}', None),
        ('{"modes": ["auto", 2], "contrast": []}', None),
        ('{"modes": [], "contrast": []}', None),
        ('{"mode": null, "contrast": []}', None),
        ('{"mode": "auto", "contrast": ["high"]}', None),
        ('{"mode": "", "contrast": []}', None),
        ('["auto"]', None),
    ],
)
def test_a_note_of_every_version_is_read_and_nonsense_is_none(
    tmp_path: Path, note: str, known: tuple[str, ...] | None
) -> None:
    file = tmp_path / "ip1-picture.json"
    file.write_text(note)
    modes = Modes(file)
    assert modes.changed == (known is not None)
    assert (modes.noted.modes if modes.noted else None) == known


@pytest.mark.parametrize("tells", [(), ("bw", "bw", "bw")])
def test_an_older_note_is_followed_in_every_profile(tmp_path: Path, tells: tuple[str, ...]) -> None:
    file = tmp_path / "ip1-picture.json"
    file.write_text('{"mode": "auto", "contrast": [50, 45, 50]}')
    firmware, modes = Firmware(picture=Picture(False, False, "bw", tells), contrast=HIGH[1]), Modes(file)
    firmware.run(modes.leave())
    assert firmware.picture == Picture(False, False, "auto", ("auto",) * len(tells))
    assert firmware.contrast == BEFORE[1]
    assert not file.exists()
