"""What a broker sends again after a crash makes no second row, and nothing else is taken for that."""

from __future__ import annotations

import pytest

from services.bus import Delivery, Message
from services.persistence.seen import REMEMBERED, SLOTS, Seen
from services.storage import SeenTurn
from tests.databases import Database
from tests.persistence.test_service import running, state, stored, turn


def packet(number: int, text: str = "ON", *, again: bool = False) -> Message:
    return state("Light", text, number)._replace(token=Delivery(1, number, again))


def after_a_crash(seen: Seen) -> Seen:
    """The next process, which knows what was committed."""
    kept = seen.turn()
    assert kept is not None
    fresh = Seen("persistence")
    fresh.learn([kept])
    return fresh


SECOND = [
    (packet(7, again=True), True),
    (packet(7), False),  # the id is in use again, for a new message
    (packet(8, again=True), False),
    (packet(7, "OFF", again=True), False),
    (packet(7, again=True)._replace(topic="home/Fan/state"), False),
    (packet(7, again=True)._replace(qos=0), False),
    (packet(7, again=True)._replace(token=None), False),
]


@pytest.mark.parametrize(("message", "is_second"), SECOND)
def test_only_the_same_packet_sent_again_is_a_second_one(message: Message, is_second: bool) -> None:
    seen = Seen("persistence")
    assert not seen.is_second(packet(7))
    assert after_a_crash(seen).is_second(message) is is_second


def test_as_many_packets_are_remembered_as_there_are_ids() -> None:
    seen, turns = Seen("persistence"), []
    for number in range(REMEMBERED + 500):
        seen.is_second(packet(number % 65_535 + 1, str(number)))
        if number % 100 == 0 or number > REMEMBERED:
            kept = seen.turn()
            assert kept is not None
            turns.append(kept)
            seen.committed()
    assert len({kept.slot for kept in turns}) == len(turns) < SLOTS
    fresh = Seen("persistence")
    fresh.learn(reversed(turns))
    assert not fresh.is_second(packet(1, "0", again=True))
    newest = range(REMEMBERED + 1, REMEMBERED + 500)
    assert all(fresh.is_second(packet(number % 65_535 + 1, str(number), again=True)) for number in newest)
    assert fresh.is_second(packet(1000, "999", again=True))


def test_packets_of_turns_without_rows_are_kept_with_the_next() -> None:
    seen = Seen("persistence")
    seen.is_second(packet(1))
    seen.is_second(packet(2))
    kept = seen.turn()
    assert isinstance(kept, SeenTurn)
    seen.committed()
    assert seen.turn() is None


def test_a_crash_between_commit_and_acknowledgement_makes_no_second_rows(database: Database) -> None:
    texts = ["ON", "OFF", "ON", "ON", "OFF"]
    with running(database) as service:
        turn(service, *(packet(number, text) for number, text in enumerate(texts, 1)))
    before = stored(database, "Light")
    with running(database) as service:
        turn(service, *(packet(number, text, again=True) for number, text in enumerate(texts, 1)))
        assert service.counters["redelivered"] == 5
        turn(service, packet(6, "ON"))
    assert stored(database, "Light") == [*before, (6.0, 1.0, "ON")]


def test_a_message_that_was_no_news_is_none_after_a_crash_either(database: Database) -> None:
    """Sent again behind a change it would look like one."""
    with running(database) as service:
        turn(service, packet(1, "ON"))
        turn(service, packet(2, "ON"))
        turn(service, packet(3, "OFF"))
    with running(database) as service:
        turn(service, packet(2, "ON", again=True), packet(3, "OFF", again=True))
    assert [row[2] for row in stored(database, "Light")] == ["ON", "OFF"]
