"""`apartment history` on a terminal: table, CSV, JSON, plot; times as people give them."""

from __future__ import annotations

import json
import re
import time
from datetime import tzinfo
from pathlib import Path
from xml.etree import ElementTree
from zoneinfo import ZoneInfo

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from services.__main__ import app
from services.errors import ConfigError
from services.history import command
from services.history.plot import GRID, HEIGHT, INK, LINE, WIDTH, Curve, draw
from services.history.svg import Svg
from services.payloads import seconds
from services.storage import Batch, Item, Mission, Sample, open_storage

MADRID = ZoneInfo("Europe/Madrid")
HOUR_US = 3_600_000_000


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A configuration with a database in which the laboratory got warmer over the last two days."""
    (tmp_path / "home.yaml").write_text("timezone: Europe/Madrid\nitems: {Lab: {type: Number, label: Lab, unit: °C}}\n")
    config = tmp_path / "apartment.yaml"
    config.write_text("home: home.yaml\npersistence: {url: 'sqlite:///bus.db'}\n")
    storage = open_storage("sqlite:///bus.db", tmp_path)
    storage.add_items([Item("Lab", "Number", "°C"), Item("Light", "Switch"), Item("Note", "String")])
    now = round(time.time() * 1e6)
    storage.write(
        Batch(
            [Sample("Lab", now - n * HOUR_US // 60, 20.0 + n / 100, None) for n in range(1, 2881)]
            + [Sample("Light", now - 2 * HOUR_US, 1.0, "ON"), Sample("Light", now - HOUR_US, 0.0, "OFF")]
            + [Sample("Note", now - HOUR_US, None, "hello, world")]
        )
    )
    storage.close()
    return config


def run(site: Path, *words: str, code: int = 0) -> str:
    done = CliRunner().invoke(app, ["history", *words, "--config", str(site)])
    assert done.exit_code == code, (done.output, done.exception)
    return done.output


def test_the_newest_samples_as_a_table(site: Path) -> None:
    lines = run(site, "Lab", "--limit", "3").splitlines()
    assert lines[0].split(maxsplit=1) == ["time", "state [°C]"]
    assert [float(line.split()[-1]) for line in lines[1:]] == [20.03, 20.02, 20.01]
    assert re.match(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3}\+0[12]:00 ", lines[1])


def test_the_missions_that_were_and_the_one_that_goes_on(site: Path) -> None:
    assert run(site, "--what", "missions", code=1) == ""
    storage = open_storage("sqlite:///bus.db", site.parent)
    began = round(time.time() * 1e6) - HOUR_US
    found = Mission(
        "m1", "tiago", 582, "found", "seen", "Sofa", 1.0, 2.0, 0.5, "tiago", began, began + 41_500_000, "[]"
    )
    goes = Mission("m2", "tiago", 17, "go", "to Hall", "Hall", None, None, None, None, began + HOUR_US // 2, None, None)
    storage.write(Batch(rows=[found, goes]))
    storage.close()
    head, first, second = run(site, "--what", "missions").splitlines()
    assert head.split() == ["time", "robot", "marker", "state", "seconds", "place", "position", "reason", "mission"]
    assert re.search(r"tiago +582 +found +41\.5 +Sofa +1\.00 2\.00 0\.50 +seen +m1$", first)
    assert re.search(r"tiago +17 +go +Hall +to Hall +m2$", second)
    assert (
        run(site, "--what", "missions", "--csv", "--limit", "1")
        .splitlines()[1]
        .endswith(",tiago,17,go,,Hall,,to Hall,m2")
    )
    assert [one["mission"] for one in json.loads(run(site, "--what", "missions", "--json", "--since", "45m"))] == ["m2"]


def test_means_as_comma_separated_values(site: Path) -> None:
    lines = run(site, "Lab", "--since", "24h", "--every", "6h", "--csv").splitlines()
    assert lines[0] == "time,count,min [°C],mean [°C],max [°C]"
    assert len(lines) in (5, 6)
    assert sum(int(line.split(",")[1]) for line in lines[1:]) in (1439, 1440)


def test_time_in_each_state_as_json(site: Path) -> None:
    told = json.loads(run(site, "Light", "--what", "durations", "--since", "90m", "--json"))
    assert told["durations"]["ON"] == pytest.approx(1800, abs=60)
    assert told["durations"]["OFF"] == pytest.approx(3600, abs=60)


def test_a_text_with_a_comma_is_one_value(site: Path) -> None:
    assert run(site, "Note", "--csv").splitlines()[1].endswith(',"hello, world"')


def test_changes_of_all_items(site: Path) -> None:
    assert "Light" in run(site, "--what", "changes", "--since", "3h", "--limit", "200", "--csv").replace(",", " ")


def test_changes_are_found_behind_many_samples_that_are_none(site: Path) -> None:
    storage = open_storage("sqlite:///bus.db", site.parent)
    now = round(time.time() * 1e6)
    storage.write(Batch([Sample("Light", now - HOUR_US + n * 100_000, 0.0, "OFF") for n in range(1, 25_001)]))
    storage.close()
    lines = run(site, "Light", "--what", "changes", "--since", "3h", "--limit", "3", "--csv").splitlines()
    assert [line.rpartition(",")[2] for line in lines] == ["state", "ON", "OFF"]


def test_comma_separated_values_have_every_digit_and_the_table_those_that_people_read(site: Path) -> None:
    storage = open_storage("sqlite:///bus.db", site.parent)
    storage.add_items([Item("Meter", "Number", "kWh")])
    storage.write(Batch([Sample("Meter", round(time.time() * 1e6) - HOUR_US, 12345.678, None)]))
    storage.close()
    asked = ("Meter", "--since", "2h", "--every", "1d")
    assert run(site, *asked, "--csv").splitlines()[1].split(",")[1:] == ["1", "12345.678", "12345.678", "12345.678"]
    assert run(site, *asked).splitlines()[1].split()[-3:] == ["12345.7"] * 3


def test_nothing_found_ends_with_one(site: Path) -> None:
    assert run(site, "Lab", "--until", "2020-01-01", code=1).strip() == ""


@pytest.mark.parametrize(("words", "kind"), [(["--since", "2h"], "steps"), (["--since", "2d"], "band"), ([], "band")])
def test_a_plot_is_a_picture_with_a_time_axis_and_the_unit(
    site: Path, tmp_path: Path, words: list[str], kind: str
) -> None:
    run(site, "Lab", *words, "--plot", str(tmp_path / "lab.svg"))
    picture = ElementTree.parse(tmp_path / "lab.svg").getroot()
    tag = "{http://www.w3.org/2000/svg}"
    texts = [text.text or "" for text in picture.iter(f"{tag}text")]
    assert texts[0] == "Lab, °C"
    assert len([text for text in texts if re.fullmatch(r"\d\d:\d\d|\d{4}-\d\d-\d\d", text)]) >= 3
    assert (picture.find(f"{tag}polygon") is not None) is (kind == "band")
    assert max(len(line.attrib["points"].split()) for line in picture.iter(f"{tag}polyline")) > 100


def test_a_plot_may_be_a_png_which_shows_the_same_and_nothing_else(site: Path, tmp_path: Path) -> None:
    run(site, "Lab", "--since", "2d", "--plot", str(tmp_path / "lab.png"))
    pixels = cv2.imread(str(tmp_path / "lab.png"))
    assert pixels is not None
    assert pixels.shape[1] / pixels.shape[0] == WIDTH / HEIGHT
    colours = {tuple(reversed(colour)) for colour in np.unique(pixels.reshape(-1, 3), axis=0).tolist()}
    assert {(255, 255, 255), INK, GRID, LINE} <= colours
    refused = CliRunner().invoke(app, ["history", "Lab", "--plot", "lab.pdf", "--config", str(site)]).exception
    assert isinstance(refused, ConfigError)


def svg(curve: Curve, zone: tzinfo) -> str:
    sheet = Svg(WIDTH, HEIGHT)
    draw(sheet, curve, zone)
    return sheet.file().decode()


def test_ticks_are_round_on_the_homes_clock_and_values_within_the_frame() -> None:
    since = round(seconds("2026-01-31T05:40:00Z") * 1e6)
    drawn = svg(Curve("<Lab>", None, [(since, 1.0), (since + 6 * HOUR_US, 9.0)], since, since + 8 * HOUR_US), MADRID)
    root = ElementTree.fromstring(drawn)
    texts = [text.text for text in root.iter("{http://www.w3.org/2000/svg}text")]
    assert texts[0] == "<Lab>"
    assert [text for text in texts if text and re.fullmatch(r"\d\d:\d\d", text)] == [
        "07:00", "08:00", "09:00", "10:00", "11:00", "12:00", "13:00", "14:00",
    ]  # fmt: skip
    assert texts[-1] == "2026-01-31 06:40 to 2026-01-31 14:40 CET"


def test_a_flat_line_and_a_single_value_can_be_drawn() -> None:
    for points in ([(0, 5.0)], [(0, 0.0), (10, 0.0)], [(0, -1e9), (10, 1e9)]):
        assert 'stroke="#1f5f8b"' in svg(Curve("x", "W", points, 0, 60_000_000), MADRID)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [("", None), ("90s", "2026-01-31T06:58:30.000Z"), ("2026-01-31T07:30", "2026-01-31T06:30:00.000Z"),
     ("2026-07-01", "2026-06-30T22:00:00.000Z"), ("2026-01-31T07:30Z", "2026-01-31T07:30:00.000Z")],
)  # fmt: skip
def test_times_are_an_age_or_the_homes_clock(text: str, wanted: str | None) -> None:
    assert command.moment(text, seconds("2026-01-31T07:00:00Z"), MADRID) == wanted


def test_what_is_no_time_or_length_is_told() -> None:
    for text in ("soon", "9999999w", f"{'9' * 400}w", "0001-01-01"):
        with pytest.raises(ConfigError, match=f"expected how long ago .*, got '{text}'"):
            command.moment(text, 0.0, ZoneInfo("Asia/Tokyo"))
    with pytest.raises(ConfigError, match="expected a length"):
        command.every_s("often")


def test_the_width_of_a_plots_buckets_fits_the_kept_means() -> None:
    year = 365 * 24 * HOUR_US
    assert command.width_s(0, year) % 300 == 0
    assert year / 1e6 / command.width_s(0, year) <= command.POINTS
    assert command.width_s(0, HOUR_US) == 4
