"""The camera's clock, memory card, privacy and video modes, in virtual time."""

from __future__ import annotations

import json
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from services.camera.brands.dahua import errands as dahua
from services.camera.device import Away, Errand, Refused
from services.camera.errands import (
    GetClock,
    GetContrast,
    GetPrivacy,
    GetStorage,
    SetClock,
    SetContrast,
    SetPrivacy,
    Storage,
)
from services.camera.upkeep import drift, local
from services.errors import DeviceError
from tests.camera.flat import Flat

ZONE = "Europe/Paris"


class Things:
    """A camera's clock, contrast and privacy."""

    def __init__(self, flat: Flat, fast_s: float = 0.0) -> None:
        self.flat, self.fast_s, self.deaf = flat, fast_s, False
        self.contrast, self.private = (50, 45, 50), False
        flat.camera.answers |= {
            GetClock: lambda request: self.clock(),
            SetClock: self.set_clock,
            GetContrast: lambda request: self.contrast,
            SetContrast: self.set_contrast,
            GetPrivacy: lambda request: self.private,
            SetPrivacy: self.set_privacy,
            GetStorage: lambda request: Storage("Success", 32e9, 8e9),
        }

    def clock(self) -> datetime:
        return local(self.flat.now + self.fast_s, ZONE).replace(microsecond=0)

    def set_clock(self, request: SetClock) -> datetime:
        if not self.deaf:
            self.fast_s = (request.shown - local(self.flat.now, ZONE)).total_seconds()
        return self.clock()

    def set_contrast(self, request: SetContrast) -> tuple[int, ...]:
        self.contrast = self.contrast if self.deaf else request.values
        return self.contrast

    def set_privacy(self, request: SetPrivacy) -> bool:
        self.private = self.private if self.deaf else request.on
        return self.private


def flat_with(tmp_path: Path, fast_s: float = 0.0, **settings: Any) -> tuple[Flat, Things]:
    flat = Flat(tmp_path, places=Path(), clock={"timezone": ZONE, **settings})
    return flat, Things(flat, fast_s)


def diagnostic(flat: Flat) -> dict[str, Any]:
    found: dict[str, Any] = json.loads([one for one in flat.said if one.topic.startswith("diagnostics/")][-1].payload)
    return found


def count(flat: Flat, kind: type[Errand]) -> int:
    return sum(isinstance(errand, kind) for errand in flat.camera.errands)


@pytest.mark.parametrize("fast_s", [3600.0, -90.0, 6.0, -86400.0 * 365])
def test_a_clock_that_is_wrong_is_set_to_local_time(tmp_path: Path, fast_s: float) -> None:
    flat, things = flat_with(tmp_path, fast_s)
    flat.online().run(20)
    assert abs(things.fast_s) < 1.0
    assert count(flat, SetClock) == 1
    assert abs(float(diagnostic(flat)["values"]["time_drift_s"])) < 1.5


def test_a_clock_that_is_right_is_left_alone_and_seldom_looked_at(tmp_path: Path) -> None:
    flat, _ = flat_with(tmp_path, 2.0)
    flat.online().run(7000)
    assert (count(flat, SetClock), count(flat, GetClock)) == (0, 2)
    assert abs(float(diagnostic(flat)["values"]["time_drift_s"]) - 2.0) < 1.0


@pytest.mark.parametrize(("deaf", "setting"), [(True, True), (False, False)])
def test_a_clock_that_stays_wrong_is_told(tmp_path: Path, deaf: bool, setting: bool) -> None:
    flat, things = flat_with(tmp_path, 100.0, set=setting)
    things.deaf = deaf
    flat.online().run(20)
    assert diagnostic(flat)["level"] == 1
    assert "its clock is +100 s off" in diagnostic(flat)["message"]


def test_everything_is_looked_at_again_after_the_camera_was_away(tmp_path: Path) -> None:
    flat, things = flat_with(tmp_path)
    flat.online().run(20)
    flat.camera.away = Away("no answer")
    flat.run(30)
    flat.camera.away, things.fast_s = None, 500.0
    flat.run(40)
    assert abs(things.fast_s) < 1.0


def test_a_computer_that_learns_the_time_late_sets_the_clock_right_again(tmp_path: Path) -> None:
    late_s = 600.0
    flat, things = flat_with(tmp_path, late_s)  # the camera knows the time, we do not
    flat.online().run(20)
    flat.now, things.fast_s = flat.now + late_s, things.fast_s - late_s
    flat.run(20)
    assert abs(things.fast_s) < 1.0


def test_an_ordered_reboot_is_followed_by_a_look_at_everything(tmp_path: Path) -> None:
    flat, things = flat_with(tmp_path)
    flat.online().run(20)
    flat.order("Reboot", "True")
    flat.run(1)
    flat.camera.away = Away("connection refused")
    flat.run(60)
    assert flat.payloads("status")[-1]["state"] == "rebooting"
    flat.camera.away, things.fast_s = None, 500.0
    flat.until(flat.ended, 30)
    flat.run(20)
    assert flat.states()[-1] == "done"
    assert abs(things.fast_s) < 1.0


@pytest.mark.parametrize(("down_s", "state", "status"), [(60, "done", "online"), (200, "failed", "offline")])
def test_a_camera_that_restarts_without_confirming_the_order_is_waited_for(
    tmp_path: Path, down_s: float, state: str, status: str
) -> None:
    flat, _ = flat_with(tmp_path)
    flat.online().run(5)
    flat.camera.away = Away("the connection was reset")
    flat.order("Reboot", "True")
    flat.run(down_s)
    flat.camera.away = None if state == "done" else flat.camera.away
    flat.until(flat.ended, 30)
    assert flat.last()["state"] == state
    assert flat.payloads("status")[-1]["state"] == status
    assert "rebooting" in [one["state"] for one in flat.payloads("status")]


def test_the_diagnostics_tell_card_settings_queue_and_alarm(tmp_path: Path) -> None:
    flat, _ = flat_with(tmp_path)
    flat.online().run(30)
    values = diagnostic(flat)["values"]
    told = {key: values[key] for key in ("storage", "storage_used_percent", "flip", "mirror", "privacy", "contrast")}
    assert told == {"storage": "Success", "storage_used_percent": "25", "flip": "on", "mirror": values["mirror"],
                    "privacy": "off", "contrast": "50 45 50"}  # fmt: skip
    assert int(values["request_queue"]) in (0, 1)
    assert values["alarm"] == "off"


def test_what_a_camera_does_not_have_is_not_asked_for_again_and_again(tmp_path: Path) -> None:
    flat = Flat(tmp_path, places=Path()).online()
    flat.run(7000)
    assert [count(flat, kind) for kind in (GetClock, GetStorage, GetPrivacy, GetContrast)] == [1, 1, 1, 1]
    assert diagnostic(flat)["values"]["storage"] == "none"


def test_scan_mode_is_black_and_white_at_high_contrast_and_leaving_it_restores_the_contrast(tmp_path: Path) -> None:
    flat, things = flat_with(tmp_path)
    flat.online()
    flat.order("VideoMode", "scan")
    flat.until(flat.ended, 20)
    assert (flat.last()["state"], flat.camera.picture.mode, things.contrast) == ("done", "bw", (80, 80, 80))
    flat.order("VideoMode", "scan", order_id="2")
    flat.until(lambda: flat.ended("2"), 20)
    flat.order("VideoMode", "color", order_id="3")
    flat.until(lambda: flat.ended("3"), 20)
    assert (flat.camera.picture.mode, things.contrast) == ("color", (50, 45, 50))


def test_scan_mode_of_an_earlier_run_is_left_for_the_usual_contrast(tmp_path: Path) -> None:
    flat, things = flat_with(tmp_path)
    things.contrast = (80, 80, 80)
    flat.online().order("VideoMode", "auto")
    flat.until(flat.ended, 20)
    assert things.contrast == (50, 50, 50)


@pytest.mark.parametrize(("key", "value", "why"), [("VideoMode", "scan", "contrast"), ("Privacy", "ON", "privacy")])
def test_a_camera_that_says_ok_and_does_nothing_is_found_out(tmp_path: Path, key: str, value: str, why: str) -> None:
    flat, things = flat_with(tmp_path)
    things.deaf = True
    flat.online().order(key, value)
    flat.until(flat.ended, 20)
    assert flat.last()["state"] == "refused"
    assert why in flat.last()["error"]


def test_privacy_is_switched_and_read_back(tmp_path: Path) -> None:
    flat, things = flat_with(tmp_path)
    flat.online().order("Privacy", "ON")
    flat.until(flat.ended, 20)
    flat.run(2)
    assert things.private
    assert diagnostic(flat)["values"]["privacy"] == "on"


@pytest.mark.parametrize("moment", [1_767_225_600.0, 1_784_200_466.4])  # in winter and in summer
def test_drift_is_measured_against_the_clock_on_the_wall(moment: float) -> None:
    shown = local(moment + 7.0, ZONE).replace(microsecond=0)
    assert abs(drift(shown, moment - 0.3, moment + 0.3, ZONE) - 7.0) <= 0.5


def talk(errand: Errand, *bodies: str | Refused) -> tuple[list[str], object]:
    """The targets that are sent, and the answer or the error."""
    dialogue, targets = dahua.dialogue(errand), list[str]()
    waiting = list(bodies)
    try:
        targets.append(next(dialogue))
        while True:
            body = waiting.pop(0)
            targets.append(dialogue.throw(body) if isinstance(body, Refused) else dialogue.send(body))
    except StopIteration as stop:
        return targets, stop.value
    except DeviceError as error:
        return targets, error


NOON = datetime(2026, 7, 16, 11, 54, 26)
MASK = "table.LeLensMask[0].Enable={}\r\ntable.LeLensMask[0].LastPosition=[-0.95,0.035,0.0078]\r\n"


def test_the_time_is_written_with_percent_20_and_read_back() -> None:
    targets, shown = talk(SetClock(NOON), "OK\r\n", "result=2026-07-16 11:54:27\r\n")
    assert targets[0] == "/cgi-bin/global.cgi?action=setCurrentTime&time=2026-07-16%2011:54:26"
    assert shown == NOON + timedelta(seconds=1)


def test_privacy_is_the_table_of_the_lens_mask() -> None:
    targets, on = talk(SetPrivacy(True), MASK.format("false"), "OK\r\n", MASK.format("true"))
    assert targets[1] == "/cgi-bin/configManager.cgi?action=setConfig&LeLensMask[0].Enable=true"
    assert on is True


@pytest.mark.parametrize("no", ["", "Error\r\n", Refused("Bad Request!")])
def test_a_camera_without_a_lens_mask_says_so_before_anything_is_written(no: str | Refused) -> None:
    targets, error = talk(SetPrivacy(True), no)
    assert len(targets) == 1
    assert "has no privacy mode" in str(error)


def test_contrast_is_read_and_written_for_each_profile() -> None:
    body = "".join(f"table.VideoColor[0][{p}].{key}=5{p}\r\n" for p in range(3) for key in ("Brightness", "Contrast"))
    targets, values = talk(SetContrast((80, 80, 80)), "OK\r\n", body)
    assert targets[0].endswith(
        "setConfig&VideoColor[0][0].Contrast=80&VideoColor[0][1].Contrast=80&VideoColor[0][2].Contrast=80"
    )
    assert values == (50, 51, 52)


@pytest.mark.parametrize(
    ("body", "storage"),
    [
        ("", Storage("none")),
        (
            "list.info[0].Detail[0].IsError=false\r\nlist.info[0].Detail[0].TotalBytes=31900000000.000000\r\n"
            "list.info[0].Detail[0].UsedBytes=1000000000.000000\r\nlist.info[0].Name=/dev/sda0\r\n"
            "list.info[0].State=Success\r\n",
            Storage("Success", 31.9e9, 1e9),
        ),
    ],
)
def test_a_memory_card_is_read_or_none(body: str, storage: Storage) -> None:
    assert talk(GetStorage(), body)[1] == storage
