"""The turn, driven on the memory bus with a clock of our own."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from services.aside import Aside
from services.bus import Message
from services.bus.memory import Hub, MemoryBus
from services.errors import BadMessage, DeviceError, Unavailable
from services.runner import Runner
from services.topics import HOME_STATE, SERVICE_INFO, read


class Clock:
    """A time that only the test moves."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


class Probe:
    """A service that does what the payload says, and remembers."""

    subscribes = ("home/+/state",)

    def __init__(self) -> None:
        self.due: float | None = None
        self.handled: list[str] = []
        self.ticks = 0
        self.away = self.unsaid = False
        self.counters = {"mine": 7}

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        text = message.payload.decode()
        self.handled.append(text)
        if text == "bad":
            raise BadMessage("not what the table says")
        if text == "device":
            raise DeviceError("the camera is away")
        if text == "bug":
            raise ZeroDivisionError("a bug")
        if text == "waits" and self.away:
            raise Unavailable("database")
        if not text.startswith("saw"):
            yield HOME_STATE.message(f"saw {text}", item="Answer")

    def tick(self, now: float) -> Iterable[Message]:
        self.ticks += 1
        if self.away:
            raise Unavailable("database")
        if self.unsaid:
            raise BadMessage("a year that nobody can say")
        return ()


class Bench:
    """A probe on a bus, and somebody who talks to it."""

    def __init__(self, folder: Path | None = None, *, durable: bool = False) -> None:
        self.clock = Clock()
        self.hub = Hub(self.clock)
        self.probe = Probe()
        self.bus = MemoryBus(self.hub, durable=durable)
        self.runner = Runner("probe", self.probe, self.bus, self.clock, Aside(folder))
        self.other = MemoryBus(self.hub)
        self.other.subscribe(["#"])

    def say(self, *texts: str) -> None:
        for text in texts:
            self.other.publish(Message("home/Item/state", text.encode()))

    def unacknowledged(self) -> list[str]:
        return [m.payload.decode() for m in self.bus.unacknowledged]

    def answers(self) -> list[str]:
        return [m.payload.decode() for m in self.other.receive() if m.topic == "home/Answer/state"]


def test_a_turn_handles_everything_that_waits_ticks_once_and_publishes_in_order() -> None:
    bench = Bench()
    bench.say("a", "b", "c")
    assert bench.runner.turn() is True
    assert (bench.probe.handled, bench.probe.ticks) == (["a", "b", "c"], 1)
    assert bench.answers() == ["saw a", "saw b", "saw c"]


def test_its_own_answer_reaches_it_in_the_next_turn_only() -> None:
    bench = Bench()
    bench.say("a")
    bench.runner.turn()
    assert bench.probe.handled == ["a"]
    bench.runner.turn()
    assert bench.probe.handled == ["a", "saw a"]


@pytest.mark.parametrize(("text", "counter"), [("bad", "bad"), ("device", "device_errors")])
def test_a_bad_message_or_a_device_that_fails_is_counted_and_the_turn_goes_on(text: str, counter: str) -> None:
    bench = Bench()
    bench.say("a", text, "b")
    bench.runner.turn()
    assert bench.probe.handled == ["a", text, "b"]
    assert bench.runner.info().counters[counter] == 1


def test_a_tick_that_cannot_say_something_is_counted_and_the_service_goes_on() -> None:
    bench = Bench()
    bench.probe.unsaid = True
    bench.say("a")
    bench.runner.turn()
    assert bench.runner.info().counters["bad"] == 1
    assert bench.unacknowledged() == []
    assert bench.runner.turn(), "its own answer"
    bench.probe.due = bench.clock.now - 1.0
    assert bench.runner.due == bench.clock.now + 0.2, "it is not tried again without a pause"


def test_while_something_is_away_nothing_is_acknowledged_or_taken_and_then_all_is_done_once() -> None:
    bench = Bench(durable=True)
    bench.probe.away = True
    bench.say("a", "waits", "b")
    assert bench.runner.turn() is False
    bench.say("c")
    assert bench.runner.turn() is False
    assert bench.probe.handled == ["a", "waits", "waits"]
    assert bench.unacknowledged() == ["a", "waits", "b", "saw a", "c"]
    bench.probe.away = False
    bench.runner.turn()
    bench.runner.turn()
    assert bench.probe.handled[:7] == ["a", "waits", "waits", "waits", "b", "saw a", "c"]
    bench.runner.turn()
    assert bench.unacknowledged() == []


def test_a_tick_that_cannot_be_done_is_tried_again_and_told_in_the_diagnostics() -> None:
    bench = Bench()
    bench.probe.away = True
    for _ in range(3):
        bench.clock.now += 1.0
        assert bench.runner.turn() is False
    told = [read(m, m.received).payload for m in bench.other.receive() if m.topic == "diagnostics/service/probe"]
    assert (told[-1].level, told[-1].message) == (2, "waiting: database")
    assert bench.runner.due <= bench.clock.now + 0.2


def test_a_bug_ends_the_runner_and_after_two_crashes_the_message_is_put_aside(tmp_path: Path) -> None:
    for _ in range(2):
        bench = Bench(tmp_path)
        bench.say("bug")
        with pytest.raises(ZeroDivisionError):
            bench.runner.turn()
    bench = Bench(tmp_path)
    bench.say("bug", "a")
    bench.runner.turn()
    assert bench.probe.handled == ["a"]
    assert bench.runner.info().counters["aside"] == 1
    assert [f"{file.name}" for file in tmp_path.glob("*.json")] == bench.runner.info().aside
    assert "ZeroDivisionError" in next(tmp_path.glob("*.json")).read_text()


def test_a_bug_behind_a_local_message_puts_nothing_aside(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.runner.bus.post(Message("/local", payload=b"bug"))
    with pytest.raises(ZeroDivisionError):
        bench.runner.turn()
    assert not list(tmp_path.iterdir())


def test_info_and_diagnostics_come_by_themselves() -> None:
    bench = Bench()
    for _ in range(11):
        bench.runner.turn()
        bench.clock.now = bench.runner.due
    topics = [m.topic for m in bench.other.receive()]
    assert topics.count("service/probe/info") == 3
    assert topics.count("diagnostics/service/probe") == 11
    info = read(bench.hub.retained[SERVICE_INFO.name(service="probe")], bench.clock.now).payload
    assert info.counters["mine"] == 7
    assert info.started == "1970-01-01T00:16:40.000Z"


def test_the_service_says_when_it_wants_its_next_turn() -> None:
    bench = Bench()
    bench.runner.turn()
    bench.probe.due = bench.clock.now + 0.25
    assert bench.runner.due == bench.clock.now + 0.25
