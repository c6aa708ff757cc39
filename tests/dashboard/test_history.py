"""What was, over long spans: asked for in pieces, whole in page and table, and said where it is not."""

from __future__ import annotations

import csv
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from services import peers, topics
from services.bus import Message
from services.client import connected
from services.config import BusSettings
from services.history.service import History
from services.payloads import seconds, stamp
from services.payloads.history import HistoryReply
from services.storage import Batch, Item, Sample, open_storage
from tests.dashboard.browser import page
from tests.dashboard.parts import Running, running

pytestmark = pytest.mark.mosquitto

SINCE, UNTIL = "2026-01-01T00:00:00.000Z", "2026-02-01T00:00:00.000Z"
SPAN = f"since={SINCE}&until={UNTIL}"
CHANGES, STORED_EACH = 4500, 6
TEXTS = 700
COUNTER = (12345.678, 0.1 + 0.2, 9007199254740991.0)
Answers = Callable[[Message], Iterable[Message]]


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A dashboard whose history service a test plays."""
    try:
        with running(tmp_path_factory.mktemp("history")) as made:
            yield made
    except peers.Missing as missing:
        pytest.skip(str(missing))


@contextmanager
def answering(house: Running, answers: Answers, close: Callable[[], None] = lambda: None) -> Iterator[None]:
    """Somebody on the bus who answers questions about what was, in a thread of his own."""
    stop = threading.Event()
    with connected(BusSettings(port=house.settings.port), [topics.HISTORY_GET.filter]) as bus:

        def play() -> None:
            while not stop.is_set():
                for asked in bus.pump(0.1):
                    for said in answers(asked):
                        bus.publish(said)
            close()

        thread = threading.Thread(target=play, name="history")
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()


@pytest.fixture
def stored(house: Running, database: Path) -> Iterator[Running]:
    """With the history service."""
    service = History(lambda: open_storage("sqlite:///bus.db", database))
    with answering(house, lambda asked: service.handle(asked, time.time()), service.close):
        yield house


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A light that changes often and is stored more often, long texts, a counter."""
    folder = tmp_path_factory.mktemp("stored")
    begin = round(seconds(SINCE) * 1e6) + 1_000_000
    step = 31 * 86_400_000_000 // (CHANGES * STORED_EACH + 10)
    lights = [
        Sample("Kitchen_Light", begin + n * step + n % 7, *state(n // STORED_EACH))
        for n in range(CHANGES * STORED_EACH)
    ]
    texts = [Sample("Bedroom_Mode", begin + n * step, None, f"{n} " + "ä" * 600) for n in range(TEXTS)]
    counted = [Sample("Kitchen_Temp", begin + n * 86_400_000_000, value, None) for n, value in enumerate(COUNTER)]
    storage = open_storage("sqlite:///bus.db", folder)
    storage.add_items([Item("Kitchen_Light", "Switch"), Item("Bedroom_Mode", "String"), Item("Kitchen_Temp", "Number")])
    storage.write(Batch([*lights, *texts, *counted]))
    storage.close()
    return folder


def state(number: int) -> tuple[float, str]:
    return (1.0, "ON") if number % 2 else (0.0, "OFF")


def test_of_a_switch_every_change_of_a_month_is_told(stored: Running) -> None:
    with stored.browser() as person:
        series = person.get(f"/api/history/Kitchen_Light?{SPAN}").json()
        rows = list(csv.reader(person.get(f"/api/history/Kitchen_Light.csv?{SPAN}").text.splitlines()))
    assert series["known"] == series["since"]
    assert [told for _, told in series["rows"]] == [state(number)[1] for number in range(CHANGES)]
    assert [at for at, _ in series["rows"]] == sorted({at for at, _ in series["rows"]})
    assert rows[0] == ["time", "state"]
    assert [[stamp(at), told] for at, told in series["rows"]] == rows[1:]


def test_long_texts_are_asked_for_in_pieces_that_fit(stored: Running) -> None:
    with stored.browser() as person:
        series = person.get(f"/api/history/Bedroom_Mode?{SPAN}").json()
    assert [told.split()[0] for _, told in series["rows"]] == [str(number) for number in range(TEXTS)]


def test_a_table_has_every_digit_of_a_number(stored: Running) -> None:
    with stored.browser() as person:
        lines = person.get(f"/api/history/Kitchen_Temp.csv?{SPAN}").text.splitlines()
    cells = [line.split(",")[1:] for line in lines[1:]]
    assert cells == [["12345.678"] * 3, ["0.30000000000000004"] * 3, ["9007199254740991"] * 3]


def endless(asked: Message) -> Iterator[Message]:
    """More than anybody would wait for: each answer goes back a minute."""
    question = topics.read(asked, time.time()).payload
    begin = stamp(seconds(question.until) - 60.0)
    samples = [(begin, "ON" if question.what == "changes" else "OFF")]
    reply = HistoryReply(
        id=question.id, item=question.item, samples=samples, since=begin if question.what == "changes" else None
    )
    yield topics.HISTORY_REPLY.message(reply, id=question.id)


def test_what_is_too_much_begins_where_it_is_known_and_says_so(house: Running) -> None:
    with answering(house, endless), house.browser() as person:
        series = person.get(f"/api/history/Kitchen_Light?{SPAN}").json()
        refused = person.get(f"/api/history/Kitchen_Light.csv?{SPAN}")
    known = seconds(UNTIL) - 60 * 60.0
    assert (series["since"], series["known"]) == (seconds(SINCE), known)
    assert series["rows"][:2] == [[known, "OFF"], [known, "ON"]]
    assert refused.status_code == 422
    assert f"ask from since={stamp(known)} on" in refused.json()["error"]


def test_a_page_says_from_when_on_it_shows_what_was(house: Running, chromium: Browser) -> None:
    with answering(house, endless), page(chromium, house.url) as shown:
        shown.goto("/#/history/Kitchen_Light")
        expect(shown.get_by_role("img", name="Kitchen light")).to_be_visible()
        expect(shown.locator(".plots .why")).to_contain_text("Kitchen light: too much for one plot, shown from")


def test_a_page_that_shows_all_says_nothing_of_the_kind(stored: Running, chromium: Browser) -> None:
    with page(chromium, stored.url) as shown:
        shown.goto("/#/history/Kitchen_Light")
        expect(shown.get_by_role("img", name="Kitchen light")).to_be_visible()
        expect(shown.locator(".plots .why")).to_have_count(0)
