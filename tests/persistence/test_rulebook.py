"""`persistence.yaml`: lines with groups, cron strategies and filters, and what the service makes of them."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest

from services.apartment.home import Home, Item
from services.bus import Message
from services.errors import ConfigError
from services.persistence import Config, check
from services.persistence.service import Persistence
from services.storage import open_storage
from services.topics import HOME_STATE
from tests.databases import Database
from tests.persistence.test_service import url

MADRID = ZoneInfo("Europe/Madrid")
ROOT = Path(__file__).parents[2]
HOME = Home(
    timezone="Europe/Madrid",
    groups={"gClimate": "Climate", "gEmpty": "None"},
    items={
        "Temp": Item(type="Number:Temperature", label="Temp", unit="°C", groups=("gClimate",)),
        "Humidity": Item(type="Number", label="Humidity", unit="%", groups=("gClimate",)),
        "Light": Item(type="Switch", label="Light"),
        "Outside": Item(type="Number", label="Outside", ros=False),
    },
)


def written(folder: Path, text: str) -> Path:
    file = folder / "persistence.yaml"
    file.write_text(text)
    return file


class Site:
    """The service with a file of strategies, and a clock that only the test moves."""

    def __init__(self, database: Database, file: Path, now: datetime) -> None:
        self.now = now
        self.database = database
        config = Config(url=url(database.address), strategies=file, home=HOME)
        self.service = Persistence(config, lambda: open_storage(database.address))
        self.service.tick(now.timestamp())

    def says(self, item: str, text: str) -> None:
        message = HOME_STATE.message(text, item=item)
        self.service.handle(
            Message(message.topic, message.payload, received=self.now.timestamp()), self.now.timestamp()
        )
        self.service.tick(self.now.timestamp())

    def goes_on(self, span: timedelta) -> None:
        """As the runner does: a tick whenever one is due."""
        end = self.now.timestamp() + span.total_seconds()
        while (due := self.service.due) is not None and due <= end:
            self.service.tick(due)
        self.now = datetime.fromtimestamp(end, self.now.tzinfo)

    def rows(self, item: str) -> list[tuple[str, object]]:
        storage = open_storage(self.database.address)
        found = [(datetime.fromtimestamp(one.time / 1e6, MADRID), one.text or one.num) for one in storage.samples(item)]
        storage.close()
        return [(when.strftime("%d %H:%M:%S"), value) for when, value in found]


@pytest.mark.parametrize(("day", "firings"), [("2026-03-29", 46), ("2026-10-25", 50), ("2026-01-31", 48)])
def test_a_day_of_a_cron_strategy_makes_exactly_its_rows(
    database: Database, tmp_path: Path, day: str, firings: int
) -> None:
    lines = "items: [{items: [ROS *], strategy: [half, everyChange]}]"
    file = written(tmp_path, f"strategies: {{half: '0 */30 * * * ?'}}\n{lines}\n")
    begin = datetime.fromisoformat(f"{day}T00:00:00").replace(tzinfo=MADRID)
    site = Site(database, file, begin - timedelta(seconds=1))
    site.says("Light", "ON")
    site.says("Outside", "3")
    end = (begin + timedelta(days=1)).timestamp()
    site.goes_on(timedelta(seconds=end - site.now.timestamp() - 1))
    rows = site.rows("Light")
    assert len(rows) == 1 + firings
    assert {value for _, value in rows} == {"ON"}
    times = [
        datetime.fromtimestamp(begin.timestamp() + n * 1800, MADRID).strftime("%d %H:%M:%S") for n in range(firings)
    ]
    assert [when for when, _ in rows[1:]] == times
    assert len(site.rows("Outside")) == 1  # in no line: as home.yaml says
    site.service.connection.close()


def test_after_a_pause_a_cron_strategy_fires_once_and_unknown_states_never(database: Database, tmp_path: Path) -> None:
    file = written(tmp_path, "strategies: {m: '0 * * * * ?'}\nitems: [{items: [Light, Temp], strategy: [m]}]\n")
    site = Site(database, file, datetime(2026, 1, 31, 7, 0, 30, tzinfo=MADRID))
    site.says("Light", "ON")
    site.says("Temp", "UNDEF")
    site.service.tick(site.now.timestamp() + 3600)
    site.service.tick(site.now.timestamp() + 3601)
    assert site.rows("Light") == [("31 08:00:30", "ON")]
    assert site.rows("Temp") == []
    site.service.connection.close()


def test_a_line_stores_only_what_its_filters_let_pass(database: Database, tmp_path: Path) -> None:
    file = written(
        tmp_path,
        "filters: {half: {threshold: 0.5, unit: °C}, sane: {include: [-40, 60]}, calm: {time: 1m}}\n"
        "items:\n"
        "- {items: [gClimate*, '!Humidity'], strategy: [everyChange], filter: [half, sane]}\n"
        "- {items: [Humidity], strategy: [everyUpdate], filter: [calm]}\n",
    )
    site = Site(database, file, datetime(2026, 1, 31, 7, tzinfo=MADRID))
    for text in ("20 °C", "20.4 °C", "20.5 °C", "20.6 °C", "20.7 °C", "1000 °C", "UNDEF", "20.7 °C"):
        site.says("Temp", text)
        site.now += timedelta(seconds=1)
    assert [value for _, value in site.rows("Temp")] == [20.0, 20.6, "UNDEF", 20.7]
    for n in range(5):
        site.says("Humidity", f"{50 + n} %")
        site.now += timedelta(seconds=40)
    assert [value for _, value in site.rows("Humidity")] == [50.0, 52.0, 54.0]
    site.service.connection.close()
    again = Site(database, file, site.now)
    again.says("Temp", "21 °C")
    again.says("Temp", "21.3 °C")
    assert [value for _, value in again.rows("Temp")][4:] == [21.3]  # measured by what was stored before the restart
    again.service.connection.close()


WRONG = [
    ("items: [{items: [Nothing], strategy: [everyChange]}]", "expected an item, Group* or *, got 'Nothing'"),
    ("items: [{items: [gNone*], strategy: [everyChange]}]", "expected an item, Group* or *, got 'gNone*'"),
    ("items: [{items: [Light], strategy: [everyMoon]}]", "expected of everyChange, everyUpdate, restoreOnStartup, got"),
    ("items: [{items: [Light]}]", "items[0].strategy: Field required"),
    ("items: [{items: [Light], strategy: [everyChange], filter: [none]}]", "expected of the filters (there are none)"),
    ("strategies: {x: often}\nitems: []", "strategies.x: expected six or seven fields"),
    ("strategies: {everyChange: '0 0 0 * * ?'}\nitems: []", "expected a name that is not built in"),
    ("filters: {x: {threshold: 1, unit: W}}\nitems: [{items: [Temp], strategy: [everyChange], filter: [x]}]",
     "expected items in W, as the filter x says, got Temp"),
    ("lines: []", "expected one of strategies, filters, items, got 'lines'"),
    ("", "got nothing"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "told"), WRONG)
def test_a_fault_of_the_file_is_told_with_its_line(tmp_path: Path, text: str, told: str) -> None:
    config = Config(url="sqlite:///x.db", strategies=Path("persistence.yaml"), home=HOME, folder=tmp_path)
    written(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        check(config)
    assert any(told in fault for fault in caught.value.faults), caught.value.faults
    assert all(fault.startswith(f"{tmp_path}/persistence.yaml:") for fault in caught.value.faults)


def test_what_is_left_out_wins_wherever_it_stands_and_groups_mean_their_members(tmp_path: Path) -> None:
    file = written(tmp_path, "items: [{items: ['!Temp', '*', '!gEmpty*'], strategy: [everyUpdate, restoreOnStartup]}]")
    rules = Config(url="sqlite:///x.db", strategies=file, home=HOME).rules
    assert {name for name, rule in rules.items() if rule.lines[0].update} == {"Humidity", "Light", "Outside"}
    assert rules["Light"].restore
