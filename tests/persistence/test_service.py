"""The service with each database behind it, driven by `handle` and `tick` as the runner does."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic

import pytest
from pydantic import SecretStr, ValidationError

from services.apartment.home import Home, Item
from services.bus import SESSION_TOPIC, Delivery, Message, topic_matches
from services.errors import BadMessage, Unavailable
from services.payloads import Diagnostic, OrderResult, stamp
from services.payloads.robot import MissionResult, MissionState
from services.peers import free_port
from services.persistence import Config, start
from services.persistence.service import Persistence
from services.storage import Address, Batch, Sample, Storage, open_storage
from services.topics import CAMERA_ORDER_RESULT, DIAGNOSTICS, HOME_STATE, MISSION_RESULT, MISSION_STATE
from tests.databases import Database

T = 1_769_839_200.0  # 2026-01-31 06:00 UTC
HOME = Home(
    items={
        "Light": Item(type="Switch", label="Light"),
        "Temp": Item(type="Number:Temperature", label="Temp", unit="°C"),
        "Power": Item(type="Number:Power", label="Power", persist=("everyUpdate", "restoreOnStartup")),
        "Secret": Item(type="String", label="Secret", persist=()),
    }
)


def state(item: str, text: str, at: float = 0.0, *, retained: bool = False) -> Message:
    """A state as it arrives."""
    return HOME_STATE.message(text, item=item)._replace(received=T + at, retain=retained)


def url(address: Address) -> str:
    """The other way round than `read_address`."""
    if address.dialect == "sqlite":
        return f"sqlite:///{address.path}"
    return f"mysql://{address.user}@localhost/{address.database}?socket={address.socket}"


def config(database: Database, home: Home = HOME) -> Config:
    password = database.address.password
    return Config(url=url(database.address), password=SecretStr(password) if password else None, home=home)


@contextmanager
def running(database: Database, home: Home = HOME) -> Iterator[Persistence]:
    with start(config(database, home), lambda message: None) as service:
        yield service


def turn(service: Persistence, *messages: Message, now: float | None = None) -> list[Message]:
    """A turn of the runner; what it published, but for its health."""
    said: list[Message] = []
    for message in messages:
        said += service.handle(message, message.received)
    said += service.tick(now if now is not None else messages[-1].received if messages else T)
    return [one for one in said if not one.topic.startswith("diagnostics/")]


def connected(service: Persistence, at: float, *came: Message) -> list[Message]:
    """The turns in which the broker hands out what it has, and the last of it, our own health; what was published."""
    service.handle(Message(SESSION_TOPIC, value=True), T + at)
    health = [one for one in service.tick(T + at) if one.topic == "diagnostics/persistence/broker"]
    return turn(service, *came, *(one._replace(retain=False, received=T + at) for one in health))


def stored(database: Database, item: str) -> list[tuple[float, float | None, str | None]]:
    """Time after T in seconds, number and text of an item's rows."""
    storage = open_storage(database.address)
    samples = storage.samples(item)
    storage.close()
    return [((sample.time - round(T * 1e6)) / 1e6, sample.num, sample.text) for sample in samples]


def test_it_listens_to_everything_that_is_stored() -> None:
    service = Persistence(Config(url="sqlite:///unused", home=HOME), lambda: pytest.fail("not yet"))
    for topic in ("home/Light/state", "camera/ip1/scan/result", "diagnostics/camera/ip1"):
        assert any(topic_matches(wanted, topic) for wanted in service.subscribes)
    assert not any(topic_matches(wanted, "camera/ip1/snapshot") for wanted in service.subscribes)


def test_changes_are_stored_with_their_times(database: Database) -> None:
    with running(database) as service:
        turn(service, state("Light", "ON", 1), state("Light", "ON", 2), state("Light", "OFF", 3.25))
        turn(service, state("Light", "UNDEF", 4), state("Secret", "x", 4), state("Unknown", "21 °C", 5))
        assert service.counters["rows"] == 4
        assert service.counters["batches"] == 2
    assert stored(database, "Light") == [(1, 1.0, "ON"), (3.25, 0.0, "OFF"), (4, None, "UNDEF")]
    assert stored(database, "Unknown") == [(5, None, "21 °C")]
    assert stored(database, "Secret") == []


def test_messages_of_one_instant_get_times_of_their_own(database: Database) -> None:
    with running(database) as service:
        turn(service, *(state("Power", f"{n} W", 1) for n in range(5)))
    assert stored(database, "Power") == [(1 + n / 1e6, float(n), None) for n in range(5)]


def test_a_clock_that_steps_back_reorders_nothing(database: Database, caplog: pytest.LogCaptureFixture) -> None:
    with running(database) as service:
        turn(service, state("Power", "1 W", 100))
        turn(service, state("Power", "2 W", 40))
        turn(service, state("Power", "3 W", 101))
        assert service.counters["clock_steps"] == 1
    assert "60.0 s behind" in caplog.text
    assert stored(database, "Power") == [(100, 1.0, None), (100.000001, 2.0, None), (101, 3.0, None)]


def test_times_go_on_after_a_restart_with_the_clock_behind(database: Database) -> None:
    with running(database) as service:
        turn(service, state("Power", "1 W", 100))
    with running(database) as service:
        turn(service)
        turn(service, state("Power", "2 W", 40))
    assert stored(database, "Power") == [(100, 1.0, None), (100.000001, 2.0, None)]


YEARS = 3 * 365 * 86_400.0


def test_rows_that_are_years_ahead_move_no_other_ones_time(
    database: Database, caplog: pytest.LogCaptureFixture
) -> None:
    with running(database) as service:
        turn(service, state("Power", "1 W", 1), state("Temp", "20 °C", 2), state("Temp", "35 °C", YEARS))
    for again in range(2):
        with running(database) as service:
            turn(service, state("Temp", "20 °C", 100 + again), state("Power", f"{again} W", 110 + again))
    assert "see `apartment db check`: Temp" in caplog.text
    assert stored(database, "Power") == [(1, 1.0, None), (110, 0.0, None), (111, 1.0, None)]
    assert stored(database, "Temp") == [(2, 20.0, None), (YEARS, 35.0, None)]  # 20 °C was no change: it was not 35
    with running(database) as service:
        assert connected(service, 200) == []
        said = {one.topic: one.payload.decode() for one in turn(service, now=T + 202)}
    assert said == {"home/Power/state": "1 W", "home/Temp/state": "20 °C"}


def test_a_clock_that_was_ahead_for_a_minute_is_right_afterwards(
    database: Database, caplog: pytest.LogCaptureFixture
) -> None:
    with running(database) as service:
        turn(service, state("Power", "1 W", 1), state("Power", "2 W", YEARS), state("Power", "3 W", 60))
        turn(service, state("Power", "4 W", 61))
    assert "1095.0 days ahead" in caplog.text
    assert stored(database, "Power") == [(1, 1.0, None), (60, 3.0, None), (61, 4.0, None), (YEARS, 2.0, None)]


def test_a_clock_that_has_just_begun_to_count_goes_on_from_what_is_stored(database: Database) -> None:
    with running(database) as service:
        turn(service, state("Power", "1 W", 1))
    with running(database) as service:
        turn(service, state("Power", "2 W", 60 - T), state("Power", "3 W", 100))
    assert stored(database, "Power") == [(1, 1.0, None), (1.000001, 2.0, None), (100, 3.0, None)]


def test_a_number_in_another_unit_is_kept_as_text_and_counted(database: Database) -> None:
    with running(database) as service:
        turn(service, state("Temp", "21.5 °C", 1), state("Temp", "70 °F", 2), state("Temp", "71 °F", 3))
        assert service.counters["unit_mismatch"] == 2
    assert stored(database, "Temp") == [(1, 21.5, None), (2, None, "70 °F"), (3, None, "71 °F")]


def test_the_unit_is_the_models_else_that_of_the_first_value(database: Database) -> None:
    with running(database) as service:
        turn(service, state("Power", "5", 1), state("Temp", "21", 1.5))
        turn(service, state("Power", "6 W", 2))
        turn(service, state("Power", "7 kW", 3))
    storage = open_storage(database.address)
    assert {name: item.unit for name, item in storage.items.items()} == {"Temp": "°C", "Power": "W"}
    storage.close()
    assert stored(database, "Power") == [(1, 5.0, None), (2, 6.0, None), (3, None, "7 kW")]


def test_the_same_number_written_differently_is_no_change(database: Database) -> None:
    with running(database) as service:
        turn(service, state("Temp", "21.5 °C", 1), state("Temp", "21.50 °C", 2), state("Temp", "21.5", 3))
    assert len(stored(database, "Temp")) == 1


def test_an_illegal_state_is_refused_and_the_others_are_stored(database: Database) -> None:
    with running(database) as service:
        with pytest.raises(BadMessage):
            service.handle(state("Light", "maybe", 1), T)
        turn(service, state("Light", "ON", 2))
    assert len(stored(database, "Light")) == 1


def test_the_retained_states_of_a_reconnect_make_no_rows(database: Database) -> None:
    with running(database) as service:
        turn(service, state("Light", "ON", 1), state("Power", "5 W", 1))
        turn(service, state("Light", "ON", 2, retained=True), state("Power", "5 W", 2, retained=True))
        assert len(stored(database, "Light")) == len(stored(database, "Power")) == 1
        turn(service, state("Light", "OFF", 3, retained=True), state("Power", "6 W", 3, retained=True))
    with running(database) as service:
        turn(service, state("Light", "OFF", 4, retained=True), state("Power", "6 W", 4, retained=True))
    assert [row[1] for row in stored(database, "Light")] == [1.0, 0.0]
    assert [row[1] for row in stored(database, "Power")] == [5.0, 6.0]


def test_diagnostics_are_stored_when_they_change(database: Database) -> None:
    def told(level: int, message: str, at: float) -> Message:
        diagnostic = Diagnostic(level=level, message=message, values={"at": str(at)})
        return DIAGNOSTICS.message(diagnostic, component="camera/ip1")._replace(received=T + at, retain=False)

    with running(database) as service:
        turn(service, told(0, "fine", 1), told(0, "fine", 2), told(2, "no answer", 3), told(2, "no answer", 4))
    with running(database) as service:
        turn(service, told(2, "no answer", 5), told(0, "fine", 6))
    rows = database.rows("SELECT level, message FROM diagnostic ORDER BY time")
    assert rows == [(0, "fine"), (2, "no answer"), (0, "fine")]


def ordered(outcome: str, at: float, camera: str = "ip1", order: str = "o1") -> Message:
    result = OrderResult.model_validate({"id": order, "key": "Goto", "value": "Kitchen", "state": outcome})
    return CAMERA_ORDER_RESULT.message(result, cam=camera)._replace(received=T + at)


def test_an_order_is_one_row_that_ends_in_its_final_state(database: Database) -> None:
    with running(database) as service:
        turn(service, ordered("accepted", 1), ordered("running", 2))
    with running(database) as service:
        turn(service, ordered("done", 3))
    assert database.rows("SELECT order_id, camera, name, value, state FROM camera_order") == [
        ("o1", "ip1", "Goto", "Kitchen", "done")
    ]


def test_orders_with_an_id_that_was_used_before_are_rows_of_their_own(database: Database) -> None:
    with running(database) as service:
        turn(service, ordered("accepted", 1), ordered("accepted", 2, "ip2"), ordered("refused", 3, order="O1"))
        turn(service, ordered("done", 4), ordered("failed", 5, "ip2"))
        turn(service, ordered("accepted", 1001), ordered("cancelled", 1002), ordered("refused", 1003))
    told = database.rows("SELECT camera, order_id, state FROM camera_order ORDER BY at")
    assert told == [
        ("ip1", "o1", "done"), ("ip2", "o1", "failed"), ("ip1", "O1", "refused"),
        ("ip1", "o1", "cancelled"), ("ip1", "o1", "refused"),
    ]  # fmt: skip


def test_an_order_that_the_broker_sends_again_is_no_second_one(database: Database) -> None:
    told = [ordered("accepted", 1), ordered("running", 2), ordered("done", 3)]
    for again in (False, True):
        sent = (one._replace(token=Delivery(1, packet, again)) for packet, one in enumerate(told, 7))
        with running(database) as service:
            turn(service, *sent, now=T + 9)
            assert service.counters["redelivered"] == (3 if again else 0)
    assert database.rows("SELECT order_id, state FROM camera_order") == [("o1", "done")]


def test_a_mission_is_one_row_and_another_with_its_id_a_second(database: Database) -> None:
    def step(state: str, robot: str, at: float, after_s: float) -> Message:
        told = MissionState(state=state, id="1", marker=582, since=stamp(T + at), elapsed_s=round(after_s, 1))
        return MISSION_STATE.message(told, robot=robot)._replace(received=T + at, retain=False)

    def end(state: str, robot: str, at: float, after_s: float) -> Message:
        told = MissionResult(id="1", marker=582, state=state, elapsed_s=round(after_s, 1), stamp=stamp(T + at))
        return MISSION_RESULT.message(told, robot=robot)._replace(received=T + at)

    with running(database) as service:
        turn(service, step("go", "tiago", 1, 0), step("go", "rosie", 1.04, 0))
        turn(service, end("refused", "tiago", 5, 0))  # the same id again, while it drives
    with running(database) as service:
        turn(service, step("look", "tiago", 8.33, 7.33), end("found", "tiago", 20.26, 19.26))
        turn(service, step("found", "tiago", 20.26, 19.26)._replace(retain=True), end("failed", "rosie", 21.04, 20))
        turn(service, step("go", "tiago", 100, 0), end("not_found", "tiago", 130, 30))
    told = database.rows("SELECT robot, state FROM mission ORDER BY started")
    assert told == [("tiago", "found"), ("rosie", "failed"), ("tiago", "refused"), ("tiago", "not_found")]


class TestRestoring:
    def test_items_that_the_broker_lost_are_given_back_without_a_new_row(self, database: Database) -> None:
        with running(database) as service:
            turn(service, state("Light", "ON", 1), state("Temp", "21 °C", 1), state("Power", "5 W", 1))
        with running(database) as service:
            assert turn(service, state("Light", "ON", 9)) == []
            assert connected(service, 10, state("Light", "OFF", 9.5)) == []
            assert service.due == T + 12
            said = turn(service, now=T + 12)
            assert [(one.topic, one.payload.decode(), one.retain, one.once) for one in said] == [
                ("home/Power/state", "5 W", True, True),
                ("home/Temp/state", "21 °C", True, True),
            ]
            assert service.due is None
            echoes = [one._replace(retain=False, received=T + 12.1) for one in said]
            turn(service, *echoes)
            turn(service, *(one._replace(retain=True, received=T + 13) for one in said))
            assert turn(service, now=T + 99) == []
            assert service.counters["restored"] == 2
        assert [row[1] for row in stored(database, "Power")] == [5.0]
        assert [row[1] for row in stored(database, "Temp")] == [21.0]
        assert [row[1] for row in stored(database, "Light")] == [1.0, 0.0]

    def test_nothing_is_said_before_the_broker_is_there(self, database: Database) -> None:
        with running(database) as service:
            turn(service, state("Light", "ON", 1))
        with running(database) as service:
            assert service.due is None
            assert turn(service, now=T + 1000) == []

    def test_what_an_older_connection_left_behind_shows_nothing(self, database: Database) -> None:
        with running(database) as service:
            turn(service, state("Light", "ON", 1))
        with running(database) as service:
            (older,) = service.tick(T + 5)
        with running(database) as service:
            turn(service, older._replace(retain=False, received=T + 9))
            turn(service, state("Power", "5 W", 9))
            assert turn(service, now=T + 1000) == []
            assert connected(service, 1000) == []
            assert [one.topic for one in turn(service, now=T + 1002)] == ["home/Light/state"]

    def test_an_update_after_its_restoring_is_stored(self, database: Database) -> None:
        with running(database) as service:
            turn(service, state("Power", "5 W", 1))
        with running(database) as service:
            assert connected(service, 10) == []
            (restored,) = turn(service, now=T + 12)
            turn(service, restored._replace(retain=False, received=T + 12))
            turn(service, state("Power", "5 W", 13))
        assert [row[0] for row in stored(database, "Power")] == [1, 13]


class Failing:
    """A storage in front of a real one that fails when told to: the errors are real, their moment is chosen."""

    def __init__(self, real: Storage) -> None:
        self.real = real
        self.opened = 0
        self.away = False
        self.lose_answer = False
        self.refuses: Callable[[Batch], bool] = lambda batch: False

    def open(self) -> Storage:
        self.opened += 1
        if self.away:
            raise Unavailable("away")
        return self

    def write(self, batch: Batch) -> None:
        if self.away:
            raise Unavailable("away")
        if self.refuses(batch):
            raise BadMessage("refused")
        self.real.write(batch)
        if self.lose_answer:
            self.lose_answer = False
            raise Unavailable("lost during COMMIT")

    def close(self) -> None:
        pass

    @property
    def items(self):  # type: ignore[no-untyped-def]
        return self.real.items

    def __getattr__(self, name: str) -> object:
        return getattr(self.real, name)


@pytest.fixture
def failing(tmp_path: Path) -> Iterator[Failing]:
    real = open_storage("sqlite:///bus.db", tmp_path)
    yield Failing(real)
    real.close()


class TestADatabaseThatIsAway:
    def test_gathered_rows_are_kept_and_committed_once(self, failing: Failing) -> None:
        service = Persistence(Config(url="sqlite:///unused", home=HOME), failing.open)
        turn(service, state("Light", "ON", 1))
        failing.away = True
        service.handle(state("Light", "OFF", 2), T + 2)
        for at in (2.0, 2.05, 2.2, 3.0):
            with pytest.raises(Unavailable):
                service.tick(T + at)
        failing.away = False
        service.tick(T + 60)
        assert [(s.time - round(T * 1e6), s.text) for s in failing.real.samples("Light")] == [
            (1_000_000, "ON"), (2_000_000, "OFF"),
        ]  # fmt: skip
        assert service.counters["reconnects"] == 2  # the first and the one after the loss

    def test_a_commit_whose_answer_was_lost_is_not_written_twice(self, failing: Failing) -> None:
        service = Persistence(Config(url="sqlite:///unused", home=HOME), failing.open)
        failing.lose_answer = True
        service.handle(state("Power", "5 W", 1), T + 1)
        with pytest.raises(Unavailable):
            service.tick(T + 1)
        service.tick(T + 2)
        assert len(failing.real.samples("Power")) == 1

    def test_attempts_come_at_growing_intervals_and_the_others_fail_at_once(self, failing: Failing) -> None:
        service = Persistence(Config(url="sqlite:///unused", home=HOME), failing.open)
        failing.away = True
        pauses, now = [], T
        for _ in range(9):
            with pytest.raises(Unavailable, match="away"):
                service.tick(now)
            opened = failing.opened
            assert service.due is not None
            with pytest.raises(Unavailable, match="away"):
                service.tick(service.due - 0.001)
            assert failing.opened == opened
            pauses.append(round(service.due - now, 3))
            now = service.due
        assert pauses == [0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0, 5.0]

    def test_it_is_told_once_and_so_is_its_return(self, failing: Failing, caplog: pytest.LogCaptureFixture) -> None:
        service = Persistence(Config(url="sqlite:///unused", home=HOME), failing.open)
        failing.away = True
        with caplog.at_level(logging.INFO):
            for n in range(20):
                with pytest.raises(Unavailable):
                    service.tick(T + n)
            failing.away = False
            service.tick(T + 60)
            service.tick(T + 61)
        assert [record.message for record in caplog.records] == [
            "waiting for the database: away", "the database is back",
        ]  # fmt: skip

    def test_the_service_starts_without_it(self, tmp_path: Path) -> None:
        away = Config(url=f"mysql://me@127.0.0.1:{free_port()}/bus", home=HOME, folder=tmp_path)
        with start(away, lambda message: None) as service:
            service.handle(state("Light", "ON", 1), T + 1)
            with pytest.raises(Unavailable):
                service.tick(T + 1)


def test_one_value_that_the_database_refuses_is_dropped_alone(
    failing: Failing, caplog: pytest.LogCaptureFixture
) -> None:
    failing.refuses = lambda batch: any(sample.num == 13.0 for sample in batch.samples)
    service = Persistence(Config(url="sqlite:///unused", home=HOME), failing.open)
    turn(service, *(state("Power", f"{n} W", n) for n in range(50)))
    assert service.counters["refused"] == 1
    assert service.counters["rows"] == 49
    assert [sample.num for sample in failing.real.samples("Power")] == [n for n in range(50) if n != 13]
    assert "refused by the database" in caplog.text


@pytest.mark.parametrize("samples", range(4))
@pytest.mark.parametrize("rows", range(4))
def test_halves_hold_everything_and_get_smaller(samples: int, rows: int) -> None:
    batch = Batch([Sample("X", n, None, "") for n in range(samples)], [None] * rows)  # type: ignore[list-item]
    one, other = batch.halves()
    assert one.samples + other.samples == batch.samples
    assert len(one.rows) + len(other.rows) == rows
    if len(batch) > 1:
        assert 0 < len(one) < len(batch)


def test_an_unknown_strategy_or_address_is_told_at_the_start() -> None:
    with pytest.raises(ValidationError, match="everyMoon"):
        Item(type="Switch", label="Light", persist=("everyMoon",))
    with pytest.raises(ValidationError, match="expected sqlite:///FILE"):
        Config(url="oracle://me@host/bus", home=HOME)


def test_twenty_thousand_states_in_turns_of_a_thousand(database: Database) -> None:
    names = [f"I{n}" for n in range(100)]
    home = Home(
        items={name: Item(type="Number:Power", label=name, unit="W", persist=("everyUpdate",)) for name in names}
    )
    began = monotonic()
    with running(database, home) as service:
        for n in range(0, 20_000, 1000):
            turn(service, *(state(names[k % 100], f"{k} W", k / 1000) for k in range(n, n + 1000)))
        assert service.counters["rows"] == 20_000
        assert service.counters["batches"] == 20
    assert monotonic() - began < 20.0  # under a second on a quiet machine
    assert database.rows("SELECT COUNT(*), COUNT(DISTINCT time) FROM sample") == [(20_000, 20_000)]
