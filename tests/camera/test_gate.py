"""The login gate: how many logins may fail, over all connections of a camera together."""

from __future__ import annotations

import hashlib
import threading
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import SecretStr

from services.camera.device import Away, BadLogin, Locked
from services.camera.web.digest import Login
from services.camera.web.gate import LONGEST_RETRY_S, MOST_FAILURES, RETRY_S, Book, Gate
from services.errors import DeviceError

WAIT_S = 10.0
PIECES = ("control", "pictures", "events", "sound")


class Camera:
    """Digest, a new nonce with each 401; counts logins that were refused. `odd` of the next requests meet a 401."""

    def __init__(self, password: str = "right") -> None:
        self.password, self.odd, self.lock, self.stale = password, 0, False, False
        self.flaky, self.used = False, 0  # it takes each nonce once, and does not say that it was the nonce
        self.nonces: dict[str, int] = {}
        self.failed = self.bare = self.served = 0
        self.door = threading.Lock()

    def __call__(self, request: httpx.Request) -> httpx.Response:
        with self.door:
            return self.judge(request)

    def judge(self, request: httpx.Request) -> httpx.Response:
        header = request.headers.get("authorization", "")
        if self.lock:
            self.failed += bool(header)
            return httpx.Response(401, text="Error\r\nUser Locked!\r\n")
        if not header:
            self.bare += 1
            return self.challenge()
        if self.odd:
            self.odd -= 1
            return self.challenge()
        if not self.knows(header, request.url.raw_path.decode()):
            self.failed += 1
            return self.challenge()
        if self.flaky and self.used > 1:
            return self.challenge()
        self.served += 1
        return httpx.Response(200, text="OK\r\n")

    def challenge(self) -> httpx.Response:
        nonce = str(len(self.nonces) + 1)
        self.nonces[nonce] = 0
        stale = ',stale="true"' if self.stale else ""
        return httpx.Response(401, headers={"WWW-Authenticate": f'Digest realm="A",qop="auth",nonce="{nonce}"{stale}'})

    def knows(self, header: str, uri: str) -> bool:
        said = {key: value.strip('"') for key, _, value in (part.partition("=") for part in header[7:].split(", "))}

        def digest(text: str) -> str:
            return hashlib.md5(text.encode()).hexdigest()

        first, second = digest(f"ros:A:{self.password}"), digest(f"GET:{uri}")
        middle = f"{said['nonce']}:{said['nc']}:{said['cnonce']}:auth"
        right = said["nonce"] in self.nonces and said["response"] == digest(f"{first}:{middle}:{second}")
        self.nonces[said["nonce"]] = self.used = self.nonces.get(said["nonce"], 0) + 1
        return right


class Visitors:
    """Several connections to one camera through one gate; time stands still unless it is moved or waited for."""

    def __init__(self, camera: Camera) -> None:
        self.now = 0.0
        self.pauses: list[float] = []
        self.gate = Gate(clock=lambda: self.now, pause=self.pause)
        self.clients = {
            name: httpx.Client(
                base_url="http://192.0.2.9",
                auth=Login("ros", SecretStr("right"), self.gate, urgent=name == "control"),
                transport=httpx.MockTransport(camera),
            )
            for name in PIECES
        }

    def pause(self, seconds: float) -> None:
        self.pauses.append(seconds)
        self.now += seconds

    def get(self, name: str = "control") -> int:
        return self.clients[name].get("/cgi-bin/x.cgi").status_code

    def outcome(self, name: str) -> type[DeviceError] | int:
        try:
            return self.get(name)
        except DeviceError as error:
            return type(error)

    def all_together(self) -> list[type[DeviceError] | int]:
        with ThreadPoolExecutor(len(PIECES)) as threads:
            return list(threads.map(self.outcome, PIECES, timeout=WAIT_S))


@pytest.mark.parametrize("turn", range(10))
def test_after_a_password_change_at_most_three_logins_fail_over_all_connections_together(turn: int) -> None:
    camera = Camera()
    visitors = Visitors(camera)
    assert [visitors.get(name) for name in PIECES] == [200] * 4
    camera.password = "changed"
    assert visitors.all_together() == [BadLogin] * 4
    assert camera.failed <= 3
    asked = camera.failed + camera.bare
    assert [visitors.outcome(name) for name in PIECES * 3] == [BadLogin] * 12
    assert camera.failed + camera.bare == asked


def test_a_password_that_was_never_right_is_sent_twice() -> None:
    camera = Camera("another")
    visitors = Visitors(camera)
    assert visitors.outcome("control") is BadLogin
    assert (camera.bare, camera.failed, visitors.pauses) == (1, 2, [0.5])


@pytest.mark.parametrize("odd", [1, 2])
def test_an_odd_refusal_or_two_are_not_taken_for_a_wrong_password(odd: int) -> None:
    camera = Camera()
    visitors = Visitors(camera)
    visitors.get()
    camera.odd = odd
    assert visitors.get() == 200
    assert visitors.gate.book.failures == 0
    assert visitors.pauses == [0.5] * (odd - 1)


def test_a_camera_that_forgot_its_nonces_is_no_wrong_password_however_many_connections_had_one() -> None:
    camera = Camera()
    visitors = Visitors(camera)
    for _ in range(5):
        assert [visitors.get(name) for name in PIECES] == [200] * 4
        camera.nonces = {f"x{number}": 0 for number in camera.nonces}
        assert visitors.all_together() == [200] * 4


def test_a_camera_that_refuses_good_logins_at_random_is_not_taken_for_a_wrong_password() -> None:
    camera = Camera()
    visitors = Visitors(camera)
    visitors.get()
    camera.odd = 2  # an old nonce, and a new one
    visitors.get()
    for odd in (3, 4):
        camera.odd = odd
        assert visitors.get() == 200
    assert max(visitors.pauses) == 2.0
    camera.odd = 5
    assert visitors.outcome("control") is Away
    visitors.now += 4.0
    assert visitors.get() == 200


@pytest.mark.parametrize("before", [0, 1])
def test_where_a_login_has_passed_two_refusals_prove_nothing_and_three_do(before: int) -> None:
    """Whether a good one was ever refused before or not."""
    camera = Camera()
    visitors = Visitors(camera)
    visitors.get()
    camera.odd = before
    visitors.get()
    visitors.now += 3600.0
    camera.odd = 2  # both with a new nonce
    assert visitors.get("events") == 200
    visitors.now += 3600.0
    camera.password = "changed"
    assert visitors.outcome("pictures") is BadLogin
    assert camera.failed == 3


@pytest.mark.parametrize(("odd", "most"), [(1, 3), (2, 7)])
def test_after_a_random_refusal_of_a_new_nonce_a_password_change_costs_a_few_logins_more(odd: int, most: int) -> None:
    camera = Camera()
    visitors = Visitors(camera)
    visitors.get()
    camera.odd = odd
    visitors.get()
    camera.password = "changed"
    while visitors.outcome("control") is Away:
        visitors.now += 1.0
    assert visitors.outcome("control") is BadLogin
    assert camera.failed == most


@pytest.mark.parametrize("before", range(24))
def test_where_old_nonces_are_refused_and_nothing_says_so_a_password_change_costs_three_logins(before: int) -> None:
    camera = Camera()
    camera.flaky = True
    visitors = Visitors(camera)
    for _ in range(before):
        assert [visitors.get(name) for name in PIECES] == [200] * 4
    assert camera.failed == 0
    camera.password = "changed"
    assert visitors.all_together() == [BadLogin] * 4
    assert camera.failed <= 3
    assert [visitors.outcome(name) for name in PIECES] == [BadLogin] * 4
    assert camera.failed <= 3


def test_where_old_nonces_were_always_taken_the_refusal_of_one_is_random() -> None:
    camera = Camera()
    visitors = Visitors(camera)
    for _ in range(22):
        visitors.get()
    camera.odd = 1
    visitors.get()
    camera.odd = 3
    assert visitors.get() == 200


@pytest.mark.parametrize(("before", "new"), [(1, 10), (30, 0)])
def test_after_an_old_nonce_was_refused_new_ones_are_used_for_a_while_unless_it_is_the_first_of_many(
    before: int, new: int
) -> None:
    camera = Camera()
    visitors = Visitors(camera)
    for _ in range(before):
        visitors.get()
    camera.odd = 1
    visitors.get()
    bare = camera.bare
    for _ in range(20):
        visitors.get()
    assert camera.bare == bare + new


def test_ten_seconds_after_a_random_refusal_three_failures_are_the_most_again() -> None:
    camera = Camera()
    visitors = Visitors(camera)
    visitors.get()
    camera.odd = 2
    visitors.get()
    visitors.now += 10.0
    camera.password = "changed"
    assert visitors.outcome("control") is BadLogin
    assert camera.failed == 3


def test_stale_for_ever_is_given_up_without_a_verdict_on_the_password() -> None:
    camera = Camera()
    camera.stale, camera.odd = True, 99
    visitors = Visitors(camera)
    assert visitors.get() == 401
    assert visitors.gate.book.failures == 0


def test_a_closed_gate_opens_after_a_growing_delay_for_one_login_only() -> None:
    camera = Camera("another")
    visitors = Visitors(camera)
    visitors.outcome("control")
    for delay in (RETRY_S, 2 * RETRY_S, 4 * RETRY_S):
        failed = camera.failed
        visitors.now += delay - 1
        assert [visitors.outcome(name) for name in PIECES] == [BadLogin] * 4
        assert camera.failed == failed
        visitors.now += 2
        assert [visitors.outcome(name) for name in PIECES] == [BadLogin] * 4
        assert camera.failed == failed + 1


def test_when_the_password_is_right_again_everybody_comes_in_at_the_next_opening() -> None:
    camera = Camera("another")
    visitors = Visitors(camera)
    visitors.outcome("control")
    camera.password = "right"
    visitors.now += RETRY_S + 1
    assert [visitors.get(name) for name in PIECES] == [200] * 4


def test_a_password_that_was_wrong_and_is_right_again_is_no_random_refusal_another_change_costs_three_logins() -> None:
    camera = Camera()
    visitors = Visitors(camera)
    visitors.get()
    camera.password = "changed"
    assert visitors.outcome("control") is BadLogin
    camera.password = "right"
    visitors.now += RETRY_S + 1
    visitors.get()
    failed, camera.password = camera.failed, "changed again"
    while visitors.outcome("control") is Away:
        visitors.now += 1.0
    assert camera.failed - failed == 3


def test_an_account_that_was_locked_while_the_gate_was_shut_for_random_refusals_is_no_sign_of_more_of_them() -> None:
    book = Book(good=True, odd_until=1.0)
    for _ in range(3):
        book.tries(urgent=True)
        book.failed(0.0, sure=False)
        book.back(urgent=True, answered=True)
    assert isinstance(book.closed(0.0), Away)
    book.close(0.0, "locked")
    book.passed(book.tries(urgent=True), 5.0)
    assert book.odd_until == 1.0


def test_a_locked_account_is_told_and_later_asked_without_a_password() -> None:
    camera = Camera()
    visitors = Visitors(camera)
    visitors.get()
    camera.lock = True
    assert visitors.outcome("control") is Locked
    assert visitors.outcome("events") is Locked
    failed = camera.failed
    visitors.now += RETRY_S + 1
    assert visitors.outcome("control") is Locked
    assert camera.failed == failed
    camera.lock = False
    visitors.now += 2 * RETRY_S + 1
    assert visitors.get() == 200


def test_the_pause_never_exceeds_the_longest() -> None:
    book, now = Book(), 0.0
    for _ in range(20):
        book.close(now, "wrong")
        assert book.opens_at is not None
        assert book.opens_at - now <= LONGEST_RETRY_S
        now = book.opens_at


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 3)), max_size=60))
def test_whatever_the_order_of_tries_and_answers_no_more_than_three_fail(steps: list[tuple[bool, int]]) -> None:
    """A pair says whether a try is urgent, and how many outstanding ones are refused after it began."""
    book, flying, failed = Book(), list[bool](), 0
    for urgent, answers in steps:
        if book.closed(0.0) is None and book.may_try(urgent=urgent):
            book.tries(urgent=urgent)
            flying.append(urgent)
        for _ in range(min(answers, len(flying))):
            book.failed(0.0, sure=False)
            book.back(urgent=flying.pop(), answered=True)
            failed += 1
    assert failed + len(flying) <= 3


def test_logins_without_an_answer_count_as_one_that_failed_because_the_camera_locks_after_five() -> None:
    book = Book()
    for _ in range(2):
        book.tries(urgent=True)
    for _ in range(2):
        book.back(urgent=True, answered=False)
    for _ in range(2):
        assert book.closed(0.0) is None
        assert book.may_try(urgent=True)
        book.tries(urgent=True)
        book.failed(0.0, sure=False)
        book.back(urgent=True, answered=True)
    assert isinstance(book.closed(0.0), BadLogin)


def test_a_login_that_passes_settles_those_without_an_answer() -> None:
    book = Book()
    book.tries(urgent=True)
    book.back(urgent=True, answered=False)
    book.passed(book.tries(urgent=True), 0.0)
    assert not book.unanswered


def test_an_answer_from_before_a_refusal_does_not_open_the_way_for_more() -> None:
    book = Book()
    early = book.tries(urgent=False)
    late = book.tries(urgent=True)
    book.failed(0.0, sure=False)
    book.passed(early, 0.0)
    assert (early, late, book.failures) == (0, 0, 1)


def test_while_a_stop_is_owed_only_what_is_urgent_is_sent() -> None:
    camera = Camera()
    visitors = Visitors(camera)
    visitors.gate.owe(True)
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(visitors.get, "pictures")
        assert visitors.get("control") == 200
        assert (camera.served, waiting.done()) == (1, False)
        visitors.gate.owe(False)
        assert waiting.result(WAIT_S) == 200
    assert camera.served == 2


def test_a_request_that_logs_in_twice_waits_not_for_itself_and_its_repeats_count_as_new() -> None:
    gate = Gate()
    for _ in range(MOST_FAILURES + 1):
        with gate.login() as soap:
            with gate.login() as http:
                http.failed()  # an old nonce
            with gate.login() as http:
                http.passed()
            soap.passed()
    gate.check()
    assert (gate.book.failures, gate.book.flying, gate.book.others) == (0, 0, 0)
