"""The HTTP API against a real broker: who may what, orders that reach the bus, what foreign pages cannot do."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import httpx
import pytest
import uvicorn
from openapi_spec_validator import validate

from services import dashboard, peers, topics
from services.config import BusSettings
from services.dashboard.sessions import FREE_TRIES
from services.dashboard.settings import Tls
from services.payloads import seconds
from services.payloads.history import HistoryReply
from services.payloads.robot import MissionResult
from services.peers import mosquitto
from tests.bus.test_tls import certificates
from tests.dashboard.parts import PASSWORD, USERS, Browser, Running, configured, running, service

pytestmark = pytest.mark.mosquitto


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A dashboard with users."""
    try:
        with running(tmp_path_factory.mktemp("guarded"), users=USERS, names=("flat.example",)) as made:
            yield made
    except peers.Missing as missing:
        pytest.skip(str(missing))


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A dashboard without users."""
    try:
        with running(tmp_path_factory.mktemp("opened")) as made:
            yield made
    except peers.Missing as missing:
        pytest.skip(str(missing))


PRIVATE = [
    "/api/apartment", "/api/states", "/api/live", "/api/history/Kitchen_Temp", "/api/cameras/ip1/stream.mjpg",
    "/api/cameras/ip1/snapshot.jpg", "/api/cameras/ip1/places", "/api/robots/tiago/map.png",
    "/api/cameras/ip1/scan.jpg", "/api/missions/tiago/past",
]  # fmt: skip
ORDERS = {
    "/api/items/Kitchen_Light/command": {"value": "ON"},
    "/api/items/Kitchen_Light/state": {"value": "ON"},
    "/api/cameras/ip1/orders/Goto": {"value": "Kitchen"},
    "/api/cameras/ip1/position": {"pan": 10},
    "/api/cameras/ip1/centre": {"right": 0.5, "down": 0.5},
    "/api/cameras/ip1/snapshot": {},
    "/api/missions/tiago/find": {"find": 582},
    "/api/missions/tiago/cancel": {},
    "/api/missions/tiago/where": {"find": 582},
    "/api/publish": {"topic": "home/Kitchen_Light/command", "payload": "ON"},
}


@pytest.mark.parametrize("path", PRIVATE)
def test_who_is_not_logged_in_sees_nothing(guarded: Running, path: str) -> None:
    with guarded.browser() as stranger:
        assert stranger.get(path).status_code == 401


@pytest.mark.parametrize("path", ORDERS)
def test_who_is_not_logged_in_or_only_looks_orders_nothing(guarded: Running, path: str) -> None:
    with guarded.browser() as stranger, guarded.browser("vic") as viewer:
        assert stranger.post(path, ORDERS[path]).status_code == 401
        assert viewer.post(path, ORDERS[path]).status_code == 403


def test_every_order_of_the_api_is_tried_here(guarded: Running) -> None:
    with guarded.browser() as anybody:
        paths = anybody.get("/api/openapi.json").json()["paths"]
    known = {path for path, methods in paths.items() if "post" in methods} - {"/api/login", "/api/logout"}
    names = {"Kitchen_Light": "{item}", "ip1": "{camera}", "Goto": "{key}", "tiago": "{robot}"}
    assert known == {"/".join(names.get(part, part) for part in path.split("/")) for path in ORDERS}


def test_the_api_is_described_as_openapi_wants(guarded: Running) -> None:
    with guarded.browser() as anybody:
        validate(anybody.get("/api/openapi.json").json())


def test_a_login_makes_a_new_session_that_no_script_can_read(guarded: Running) -> None:
    with guarded.browser() as person:
        person.http.cookies.set("apartment", "planted-by-somebody", domain="127.0.0.1")
        cookie = person.login("ann").headers["set-cookie"]
        assert "planted" not in cookie
        for word in ("HttpOnly", "SameSite=strict", "Path=/"):
            assert word in cookie
        first = person.http.cookies["apartment"]
        assert person.get("/api/session").json()["role"] == "operator"
        person.login("ann")
        assert person.http.cookies["apartment"] != first
        with httpx.Client(base_url=guarded.url, cookies={"apartment": first}, trust_env=False, timeout=30) as old:
            assert old.get("/api/apartment").status_code == 401


def test_logging_out_ends_the_session(guarded: Running) -> None:
    with guarded.browser("ann") as person:
        token = person.http.cookies["apartment"]
        assert person.post("/api/logout").status_code == 200
        with httpx.Client(base_url=guarded.url, cookies={"apartment": token}, trust_env=False, timeout=30) as again:
            assert again.get("/api/apartment").status_code == 401


def test_a_wrong_login_is_refused_in_the_same_words_and_who_goes_on_is_slowed_down(guarded: Running) -> None:
    """A dashboard of its own: tries are counted by address, too, and all tests come from one."""
    folder = Path(guarded.folder, "guessed")
    with running(folder, users=USERS) as made, made.browser() as person:
        guesses = [("ann", "wrong"), ("nobody", PASSWORD), ("", "")]
        assert len(guesses) == FREE_TRIES
        answers = [person.login(*guess) for guess in guesses]
        assert [answer.status_code for answer in answers] == [401] * FREE_TRIES
        assert len({answer.text for answer in answers}) == 1
        assert not any("set-cookie" in answer.headers for answer in answers)
        answer = person.login("ann")  # even the right one
        for more in range(6):  # a machine so busy that the first second is over: each wrong one doubles it
            if answer.status_code == 429:
                break
            for _ in range(FREE_TRIES + more):
                person.login("ann", "wrong")
            answer = person.login("ann")
        assert answer.status_code == 429
        assert int(answer.headers["retry-after"]) >= 1


@pytest.mark.parametrize(
    "headers",
    [{"X-CSRF-Token": ""}, {"X-CSRF-Token": "guessed"}, {"Origin": "http://evil.example"}, {"Origin": "null"},
     {"Sec-Fetch-Site": "cross-site"}, {"Sec-Fetch-Site": "same-site"}],
)  # fmt: skip
def test_a_foreign_page_orders_nothing(guarded: Running, headers: dict[str, str]) -> None:
    with guarded.browser("ann") as person:
        path = "/api/items/Kitchen_Light/command"
        assert person.post(path, {"value": "ON"}, **headers).status_code == 403
        own = {"Origin": guarded.url, "Sec-Fetch-Site": "same-origin"}
        assert person.post(path, {"value": "ON"}, **own).status_code == 202


def test_a_form_cannot_log_in(guarded: Running) -> None:
    with guarded.browser() as person:
        data = {"user": "ann", "password": PASSWORD}
        assert person.http.post("/api/login", data=data).status_code == 422
        assert person.http.post("/api/login", json=data, headers={"Origin": "http://evil.example"}).status_code == 403


@pytest.mark.parametrize(
    ("host", "known"),
    [("127.0.0.1:1", True), ("localhost", True), ("[::1]:8088", True), ("192.0.2.7:8088", True), ("FLAT.example", True),
     ("evil.example", False), ("evil.example:8088", False), ("", False), ("127.0.0.1.evil.example", False)],
)  # fmt: skip
def test_only_our_own_names_are_answered(guarded: Running, host: str, known: bool) -> None:
    answer = httpx.get(f"{guarded.url}/api/session", headers={"Host": host}, trust_env=False, timeout=30)
    assert answer.status_code == (200 if known else 403)


@pytest.mark.parametrize("path", ["/", "/main.js", "/api/session", "/nothing", "/../settings.py", "/api/live"])
def test_every_answer_carries_the_strict_headers(guarded: Running, path: str) -> None:
    headers = httpx.get(f"{guarded.url}{path}", trust_env=False, timeout=30).headers
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert "server" not in headers


@pytest.mark.parametrize("path", ["/../settings.py", "/%2e%2e/settings.py", "/views/../../service.py", "/vendor"])
def test_nothing_but_the_page_is_served(guarded: Running, path: str) -> None:
    with guarded.browser() as person:
        assert person.get(path).status_code == 404


def test_without_users_this_machine_is_the_operator_and_nobody_comes_by_a_proxy(opened: Running) -> None:
    with opened.browser() as person:
        assert person.get("/api/session").json()["role"] == "operator"
        assert person.get("/api/session", headers={"X-Forwarded-For": "192.0.2.1"}).status_code == 403
        assert person.get("/api/session", headers={"Host": "192.0.2.7"}).status_code == 403


SAID = {
    "/api/items/Kitchen_Light/command": ("home/Kitchen_Light/command", "ON"),
    "/api/items/Kitchen_Light/state": ("home/Kitchen_Light/set", "ON"),
    "/api/cameras/ip1/orders/Goto": ("camera/ip1/order/Goto", {"value": "Kitchen", "by": "human"}),
    "/api/cameras/ip1/position": ("camera/ip1/position/set", {"pan": 10.0, "tilt": None, "zoom": None}),
    "/api/cameras/ip1/snapshot": ("camera/ip1/snapshot/get", ""),
    "/api/missions/tiago/find": ("mission/tiago/order", {"find": 582, "cancel": False}),
    "/api/missions/tiago/cancel": ("mission/tiago/order", {"find": None, "cancel": True}),
    "/api/missions/tiago/where": ("mission/tiago/where", {"marker": 582}),
    "/api/publish": ("home/Kitchen_Light/command", "ON"),
}


@pytest.mark.parametrize("path", SAID)
def test_an_order_is_a_message_on_the_bus(guarded: Running, path: str) -> None:
    topic, wanted = SAID[path]
    guarded.bus.forget()
    with guarded.browser("ann") as person:
        answer = person.post(path, ORDERS[path])
    assert answer.status_code == 202
    message = guarded.bus.until(lambda message: message.topic == topic, 20.0, topic)
    assert not message.retain
    if isinstance(wanted, str):
        assert message.payload.decode() == wanted
    else:
        payload = json.loads(message.payload)
        assert {key: payload[key] for key in wanted} == wanted
        assert payload["id"] == answer.json()["id"]


@pytest.mark.parametrize(
    ("path", "body", "why"),
    [
        ("/api/items/Nothing/command", {"value": "ON"}, "no item"),
        ("/api/items/Kitchen_Light/command", {"value": 5}, "string"),
        ("/api/items/Kitchen_Light/command", {"value": "ON", "more": 1}, "more"),
        ("/api/cameras/ip2/orders/Goto", {"value": "Kitchen"}, "expected one of ip1"),
        ("/api/cameras/ip1/position", {}, "at least one"),
        ("/api/missions/r2d2/find", {"find": 1}, "expected one of tiago"),
        ("/api/missions/tiago/find", {"find": -1}, "greater"),
        ("/api/publish", {"topic": "service/mission/status", "payload": "offline"}, "may not say"),
    ],
)
def test_an_order_that_is_wrong_is_told_why(guarded: Running, path: str, body: object, why: str) -> None:
    with guarded.browser("ann") as person:
        answer = person.post(path, body)
    assert answer.status_code == 422
    assert why in answer.json()["error"]


@pytest.mark.parametrize(
    ("path", "text", "why"),
    [
        ("/api/cameras/ip1/position", '{"pan": 1e305}', "pan: "),
        ("/api/cameras/ip1/orders/Zoom", '{"value": 1e400}', "value: "),
        ("/api/cameras/ip1/orders/Scan", '{"value": {"targets": [-1e400]}}', "value: "),
    ],
)
def test_a_number_that_nobody_can_take_is_told(guarded: Running, path: str, text: str, why: str) -> None:
    with guarded.browser("ann") as person:
        headers = {"X-CSRF-Token": person.csrf, "Content-Type": "application/json"}
        answer = person.http.post(path, content=text, headers=headers)
    assert answer.status_code == 422
    assert answer.json()["error"].startswith(why)


def test_a_body_that_nobody_needs_is_refused(guarded: Running) -> None:
    with guarded.browser("ann") as person:
        assert person.post("/api/publish", {"topic": "x", "payload": "x" * 70_000}).status_code == 413


def test_states_and_places_can_be_asked_for(guarded: Running) -> None:
    guarded.bus.say("home/Kitchen_Temp/state", "21.5 °C", retain=True)
    guarded.bus.say("camera/ip1/places", '{"Sofa": {"pan": 1.0, "tilt": 2.0, "zoom": 0.0, "preset": 2}}', retain=True)
    with guarded.browser("vic") as person:
        peers.wait_until(lambda: person.get("/api/cameras/ip1/places").status_code == 200, "the places")
        assert person.get("/api/cameras/ip1/places").json()["Sofa"]["tilt"] == 2.0
        found = person.get("/api/states", params={"topics": "home/+/state"}).json()
        assert found["home/Kitchen_Temp/state"] == "21.5 °C"
        assert person.get("/api/states", params={"topics": "home/<x>"}).status_code == 422


def test_a_state_that_somebody_takes_away_is_gone(guarded: Running) -> None:
    topic = "camera/ip1/scan/state"
    guarded.bus.say(topic, '{"state": "idle"}', retain=True)
    with guarded.browser("vic") as person:

        def kept() -> bool:
            return topic in person.get("/api/states", params={"topics": topic}).json()

        peers.wait_until(kept, "the state")
        guarded.bus.say(topic, "", retain=True)
        peers.wait_until(lambda: not kept(), "the state to go")


def test_a_page_hears_of_a_change_within_a_moment(guarded: Running) -> None:
    with (
        guarded.browser("vic") as person,
        person.http.stream("GET", "/api/live", params={"topics": "home/Bedroom_Temp/state"}) as answer,
    ):
        lines = answer.iter_lines()
        assert next(lines) == "event: snapshot"
        begin = time.time()
        guarded.bus.say("home/Bedroom_Temp/state", "19.5 °C", retain=True)
        data = next(line for line in lines if line.startswith("data: [[") and "19.5" in line)
        heard_ms = json.loads(data[6:])[0][2]
    assert abs(heard_ms / 1000 - begin) < 15.0


def answered(guarded: Running, path: str, **replies: dict[str, object]) -> httpx.Response:
    """The answer to a question that the history service is played for; `replies` by what is asked."""
    guarded.bus.forget()
    with guarded.browser("vic") as person, ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(person.get, path)
        told: set[str] = set()
        while len(told) < len(replies):
            asked = guarded.bus.payload("history/get", lambda one: one.id not in told, 20.0)
            told.add(asked.id)
            reply = HistoryReply(id=asked.id, item=asked.item, samples=[]).model_copy(update=replies[asked.what])
            guarded.bus.publish(topics.HISTORY_REPLY.message(reply, id=asked.id))
        return waiting.result(30.0)


BUCKETS = {"unit": "°C", "buckets": [("2026-01-31T07:05:00Z", 3, 20.0, 20.5, 21.0)]}


def test_what_was_of_a_number_comes_in_as_many_points_as_a_plot_has(guarded: Running) -> None:
    path = "/api/history/Kitchen_Temp?since=2026-01-31T00:00:00Z&until=2026-02-01T00:00:00Z&points=100"
    series = answered(guarded, path, samples=BUCKETS).json()
    assert series["every"] == 900  # the least round width that gives no more than 100
    assert series["unit"] == "°C"
    assert series["rows"] == [[seconds("2026-01-31T07:05:00Z"), 20.0, 20.5, 21.0]]


def test_what_was_of_a_state_begins_with_what_it_was_before(guarded: Running) -> None:
    path = "/api/history/Kitchen_Light?since=2026-01-31T00:00:00Z&until=2026-02-01T00:00:00Z"
    series = answered(
        guarded, path, changes={"samples": [("2026-01-31T07:05:00Z", "ON")]},
        last={"samples": [("2026-01-29T07:05:00Z", "OFF")]},
    ).json()  # fmt: skip
    since = seconds("2026-01-31T00:00:00Z")
    assert series["rows"] == [[since, "OFF"], [seconds("2026-01-31T07:05:00Z"), "ON"]]


def test_a_table_holds_nothing_that_a_spreadsheet_would_run(guarded: Running) -> None:
    samples = {"samples": [("2026-01-31T07:05:00Z", '=HYPERLINK("x")')]}
    path = "/api/history/Bedroom_Mode.csv?since=2026-01-31T00:00:00Z&until=2026-02-01T00:00:00Z"
    table = answered(guarded, path, changes=samples, last={}).text
    assert table == 'time,state\r\n2026-01-31T07:05:00.000Z,"\'=HYPERLINK(""x"")"\r\n'


def test_past_missions_are_those_of_the_database_and_of_that_robot(guarded: Running) -> None:
    result = {"id": "m1", "marker": 582, "state": "found", "stamp": "2026-01-31T07:05:00.000Z",
              "story": [{"at_s": 0.0, "state": "go", "text": "to Sofa"}]}  # fmt: skip
    told = [("tiago", MissionResult.model_validate(result)), ("other", MissionResult.model_validate(result))]
    (found,) = answered(guarded, "/api/missions/tiago/past", missions={"missions": told}).json()["missions"]
    assert {key: found[key] for key in result} == result


def test_the_newest_analysed_picture_of_a_scan_can_be_fetched(guarded: Running) -> None:
    with guarded.browser("vic") as person:
        path = "/api/cameras/ip1/scan.jpg"
        assert person.get(path).status_code == 422
        for number in range(2):
            jpeg = b"\xff\xd8%d" % number
            guarded.bus.say("camera/ip1/scan/image", jpeg, qos=0)
            guarded.bus.say("camera/stranger/scan/image", b"\xff\xd8", qos=0)
            peers.wait_until(lambda jpeg=jpeg: person.get(path).content == jpeg, "the picture")  # type: ignore[misc]
        assert person.get(path).headers["content-type"] == "image/jpeg"
        assert person.get("/api/cameras/stranger/scan.jpg").status_code == 422


@pytest.mark.parametrize(
    "query",
    [
        "since=yesterday",
        "since=2026-02-01T00:00:00Z&until=2026-01-01T00:00:00Z",
        "until=0001-01-01T00:00:00Z",
        "points=0",
        "points=9999999",
        f"points={'9' * 5000}",
    ],
)
def test_a_span_that_is_none_is_told(guarded: Running, query: str) -> None:
    with guarded.browser("vic") as person:
        assert person.get(f"/api/history/Kitchen_Temp?{query}").status_code == 422
        assert person.get("/api/history/Nothing").status_code == 422


def test_a_page_that_is_open_hears_nothing_more_after_its_session_was_ended(guarded: Running) -> None:
    with (
        guarded.browser("ann") as person,
        person.http.stream("GET", "/api/live", params={"topics": "diagnostics/#"}) as answer,
    ):
        lines = answer.iter_lines()
        assert next(lines) == "event: snapshot"
        assert person.post("/api/logout").status_code == 200
        assert len(list(lines)) < 20  # diagnostics come every second: it ends at the next, or this one goes on for ever


def test_a_stream_is_not_opened_by_head(guarded: Running) -> None:
    with guarded.browser("vic") as person:
        assert person.http.head("/api/live").status_code == 405


def test_over_tls_the_cookie_goes_over_tls_alone(tmp_path: Path) -> None:
    try:
        ca, cert, key = certificates(tmp_path / "ca", "our own CA")
    except peers.Missing as missing:
        pytest.skip(str(missing))
    beside = [Path(os.path.relpath(file, tmp_path / "tls" / "config")) for file in (cert, key)]
    tls = Tls(cert=beside[0], key=beside[1])  # paths start from the configuration's folder
    with running(tmp_path / "tls", ca, users=USERS, tls=tls) as made, made.browser() as person:
        assert made.url.startswith("https://")
        answer = person.login("ann")
        assert answer.headers["set-cookie"].startswith("__Host-apartment=")
        assert "Secure" in answer.headers["set-cookie"]
        assert "max-age" in answer.headers["strict-transport-security"]
        assert person.get("/api/session").json()["user"] == "ann"
        path = "/api/items/Kitchen_Light/command"
        assert person.post(path, {"value": "ON"}, Origin=made.url).status_code == 202
        assert person.post(path, {"value": "ON"}, Origin=made.url.replace("https", "http")).status_code == 403


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_server_that_cannot_start_is_no_dashboard_and_lets_its_port_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def fails(_server: uvicorn.Server, sockets: list[socket.socket]) -> None:
        ports.append(sockets[0].getsockname()[1])
        raise ValueError("something of the library")

    ports: list[int] = []
    monkeypatch.setattr(uvicorn.Server, "startup", fails)
    with (
        pytest.raises(OSError, match="does not answer") as caught,
        dashboard.start(configured(tmp_path, peers.free_port()), lambda _: None),
    ):
        pass
    assert isinstance(caught.value.__cause__, ValueError)
    with socket.create_server(("127.0.0.1", ports[0])):
        pass


def test_who_does_not_read_keeps_nobody_waiting(guarded: Running) -> None:
    """More than the network's own buffers hold goes to a page that takes nothing, and to one beside it."""
    items, rounds, text = 50, 12, "x" * 15_000
    host, port = guarded.url.removeprefix("http://").split(":")
    with guarded.browser("vic") as person, socket.socket() as lazy:
        lazy.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        lazy.connect((host, int(port)))
        cookie = f"Cookie: apartment={person.http.cookies['apartment']}"
        lazy.sendall(
            f"GET /api/live?topics=home/%2B/state HTTP/1.1\r\nHost: {host}:{port}\r\n{cookie}\r\n\r\n".encode()
        )
        with person.http.stream("GET", "/api/live", params={"topics": "home/+/state"}) as answer:
            lines = answer.iter_lines()
            assert next(lines) == "event: snapshot"
            for number in range(rounds):
                for item in range(items):
                    guarded.bus.say(f"home/Large_{item}/state", f"{number} {text}", retain=True)
                assert next(line for line in lines if f'Large_{items - 1}/state","{number} xxx' in line)
        assert lazy.recv(12) == b"HTTP/1.1 200"
    for item in range(items):
        guarded.bus.say(f"home/Large_{item}/state", "", retain=True)


def test_a_robots_map_is_a_picture(guarded: Running) -> None:
    with guarded.browser("vic") as person:
        answer = person.get("/api/robots/tiago/map.png")
    assert answer.headers["content-type"] == "image/png"
    assert answer.content.startswith(b"\x89PNG")


def test_the_page_is_small() -> None:
    """Everything together, as it travels: under 300 kB."""
    from services.dashboard.http.files import Files

    assert sum(len(file.packed) for file in Files()._files.values()) < 300_000


def test_while_the_broker_is_away_nothing_is_ordered_and_afterwards_all_is_well(tmp_path: Path) -> None:
    order = ("/api/items/Kitchen_Light/command", {"value": "ON"})
    with ExitStack() as stack:
        try:
            broker = stack.enter_context(mosquitto.private(tmp_path / "mosquitto", anonymous=True))
        except peers.Missing as missing:
            pytest.skip(str(missing))
        down = stack.pop_all()
        settings = BusSettings(port=broker.port)
        with service(configured(tmp_path, broker.port), settings, tmp_path) as url, Browser(url) as person:
            try:
                peers.wait_until(lambda: person.get("/api/broker").json()["online"], "the broker", 30.0)
                assert person.post(*order).status_code == 202
            finally:
                down.close()
            peers.wait_until(lambda: not person.get("/api/broker").json()["online"], "the end of the broker", 30.0)
            answer = person.post(*order)
            assert (answer.status_code, answer.json()) == (503, {"error": "the broker is away"})
            with mosquitto.private(tmp_path / "mosquitto", port=broker.port, anonymous=True):
                peers.wait_until(lambda: person.get("/api/broker").json()["online"], "the broker again", 30.0)
                assert person.post(*order).status_code == 202
