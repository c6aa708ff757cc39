"""What is not there any more is not shown as if it were: a picture, a service, an answer, the connection, a state."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from services import peers
from services.config import BusSettings
from services.peers import mosquitto
from tests.dashboard.browser import WAIT_MS, faults, page, view
from tests.dashboard.parts import Running, configured, running, service
from tests.dashboard.streaming import Streaming, camera
from tests.network import network

pytestmark = [pytest.mark.chromium, pytest.mark.mosquitto]
SOON_S = 20.0
NO_ANSWER_MS = 10_000
SILENT_MS = 30_000
expect.set_options(timeout=WAIT_MS)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A dashboard and a broker; whoever else there is, is played."""
    try:
        with running(tmp_path_factory.mktemp("alone")) as made:
            yield made
    except peers.Missing as missing:
        pytest.skip(str(missing))


@pytest.fixture
def shown(alone: Running, chromium: Browser) -> Iterator[Page]:
    with page(chromium, alone.url) as made:
        made.clock.install()
        yield made


def say(alone: Running, topic: str, payload: Any) -> None:
    """A state: as text, or anything else as JSON."""
    alone.bus.say(topic, payload if isinstance(payload, str) else json.dumps(payload), retain=True)


def begun(alone: Running) -> None:
    """A camera that scans, and a robot on its way."""
    say(alone, "service/camera-ip1/status", "online")
    say(alone, "service/mission/status", "online")
    say(alone, "camera/ip1/status", {"state": "online", "reason": ""})
    say(alone, "camera/ip1/position", {"pan": 41.0, "tilt": 30.0, "zoom": 0.0, "place": "Sofa"})
    say(alone, "camera/ip1/places", {"Sofa": {"pan": 41.0, "tilt": 30.0}})
    say(alone, "camera/ip1/scan/state", {"state": "running", "targets": [582], "place": "Sofa", "progress": 0.4})
    mission = {"state": "go", "id": "one", "marker": 582, "place": "sofa", "since": "2026-01-31T07:05:00Z"}
    say(alone, "mission/tiago/state", {**mission, "reason": "on the way to sofa", "waiting": []})


BRIGHT = """() => {
  const pen = Object.assign(document.createElement("canvas"), {width: 1, height: 1}).getContext("2d");
  pen.drawImage(document.querySelector(".video img"), 0, 0, 1, 1);
  return pen.getImageData(0, 0, 1, 1).data[0];
}"""


def test_a_picture_that_stands_still_is_told_and_moves_again_when_its_service_is_back(
    alone: Running, shown: Page
) -> None:
    over = shown.locator(".video .over")
    with camera(shade=40) as source:
        streams(alone, source)
        view(shown, "camera")
        expect(over).to_be_hidden()
        peers.wait_until(lambda: abs(shown.evaluate(BRIGHT) - 40) < 10, "the picture", SOON_S)
    expect(over).to_contain_text("No picture for")
    expect(shown.locator(".video.old")).to_be_visible()
    with camera(shade=200) as source:
        streams(alone, source)
        expect(over).to_be_hidden()
        peers.wait_until(lambda: abs(shown.evaluate(BRIGHT) - 200) < 10, "the new picture", SOON_S)
        source.stands.set()  # the camera hangs, its service does not
        expect(over).to_contain_text(re.compile(r"No picture for \d+ s: the camera gives none"))
        assert faults(shown) == []
        source.stands.clear()
        expect(over).to_be_hidden()


def streams(alone: Running, source: Streaming) -> None:
    say(alone, "camera/ip1/stream", {"rtsp": True, "mjpeg": False, "url": source.url})


def test_a_service_that_is_gone_is_shown_wherever_it_would_be_believed(alone: Running, shown: Page) -> None:
    begun(alone)
    view(shown, "camera")
    expect(shown.locator(".head .badge")).to_have_text("online")
    expect(shown.locator("main")).to_contain_text("Looking from Sofa")
    say(alone, "service/camera-ip1/status", "offline")
    say(alone, "service/mission/status", "offline")
    expect(shown.locator(".head .badge")).to_have_text("service offline")
    expect(shown.locator("main")).to_contain_text("It ended with its service")
    expect(shown.get_by_role("button", name="Cancel")).to_be_disabled()
    view(shown, "apartment")
    of_camera, of_robot = shown.locator(".line-link", has_text="ip1"), shown.locator(".line-link", has_text="tiago")
    expect(of_camera).to_contain_text("service offline")
    expect(of_camera).to_contain_text("last seen at Sofa")
    expect(shown.locator(".view.gone")).to_have_count(1)
    expect(shown.locator("main")).not_to_contain_text("Scanning")
    expect(of_robot).to_contain_text("mission service offline")
    expect(of_robot).not_to_contain_text("marker 582")
    view(shown, "missions")
    now = shown.locator("[data-robot=tiago] .now")
    expect(now).to_have_text("The mission service is offline")
    assert faults(shown) == []
    say(alone, "service/mission/status", "online")
    expect(now).to_contain_text("On the way: marker 582")
    say(alone, "service/camera-ip1/status", "online")
    view(shown, "camera")
    expect(shown.locator(".head .badge")).to_have_text("online")


def test_a_robot_that_says_nothing_any_more_is_told(alone: Running, shown: Page) -> None:
    begun(alone)
    view(shown, "apartment")
    say(alone, "robot/tiago/pose", {"x": 1.0, "y": 1.0, "yaw_deg": 0.0, "stamp": "2026-01-31T07:05:00Z"})
    link = shown.locator(".line-link", has_text="tiago")
    expect(link).to_contain_text("marker 582")
    shown.clock.fast_forward(11_000)
    expect(link).to_contain_text("not heard of since")
    say(alone, "robot/tiago/pose", {"x": 1.1, "y": 1.0, "yaw_deg": 0.0, "stamp": "2026-01-31T07:05:01Z"})
    shown.reload()  # so that its clock is right again
    expect(link).to_contain_text("marker 582")


def test_an_order_that_nobody_answers_is_told(alone: Running, shown: Page) -> None:
    begun(alone)
    view(shown, "camera")
    unanswered(shown, shown.locator(".places button"), "Goto Sofa: no answer")
    view(shown, "missions")
    for name, told in (("Find", "Find 582"), ("Cancel", "Cancel"), ("Where was it last?", "Where was it last")):
        unanswered(shown, shown.get_by_role("button", name=name), f"{told}: no answer")
    view(shown, "apartment")
    unanswered(shown, shown.locator("[data-item=Kitchen_Plug]"), "Washing machine: no answer")


def unanswered(shown: Page, control: Locator, told: str) -> None:
    """Presses it; when the time for an answer is over it is told, and that goes away by and by."""
    ordered(shown, control)
    shown.clock.fast_forward(NO_ANSWER_MS)
    expect(shown.locator(".toast.bad")).to_have_text(told)
    shown.clock.fast_forward(NO_ANSWER_MS)
    expect(shown.locator(".toast")).to_have_count(0)


def ordered(shown: Page, control: Locator) -> str | None:
    """Presses it; the id of the order that goes out."""
    with shown.expect_response(lambda answer: answer.request.method == "POST") as taken:
        control.press("Enter")
    assert taken.value.status == 202
    found: str | None = taken.value.json()["id"]
    return found


def test_the_cancel_of_a_mission_sends_no_robot(alone: Running, shown: Page) -> None:
    begun(alone)
    view(shown, "missions")
    sent: list[str] = []
    shown.on(
        "request", lambda request: sent.append(request.url.rpartition("/")[2]) if request.method == "POST" else None
    )
    ordered(shown, shown.get_by_role("button", name="Cancel"))
    ordered(shown, shown.get_by_role("button", name="Where was it last?"))
    assert sent == ["cancel", "where"]


def test_an_order_that_is_answered_is_left_alone_until_its_service_goes_away(alone: Running, shown: Page) -> None:
    begun(alone)
    view(shown, "camera")
    log, toasts = shown.locator(".log li"), shown.locator(".toast")
    for state in ("running", "done"):
        result = {"id": ordered(shown, shown.locator(".places button")), "key": "Goto", "value": "Sofa", "state": state}
        alone.bus.say("camera/ip1/order_result", json.dumps(result))
        expect(log.first).to_contain_text(state)
        shown.clock.fast_forward(NO_ANSWER_MS)
        expect(toasts).to_have_count(0)
    say(alone, "service/camera-ip1/status", "offline")
    expect(shown.locator(".head .badge")).to_have_text("service offline")
    shown.clock.fast_forward(NO_ANSWER_MS)
    expect(toasts).to_have_text("Goto Sofa: it was running when its service or the broker went away")


def test_a_page_without_the_dashboard_or_the_broker_says_so_in_words(tmp_path: Path, chromium: Browser) -> None:
    with ExitStack() as stack:
        try:
            broker = stack.enter_context(mosquitto.private(tmp_path / "mosquitto", anonymous=True))
        except peers.Missing as missing:
            pytest.skip(str(missing))
        down = stack.pop_all()
        with ExitStack() as serving:
            url = serving.enter_context(
                service(configured(tmp_path, broker.port), BusSettings(port=broker.port), tmp_path)
            )
            try:
                shown = serving.enter_context(page(chromium, url))
                view(shown, "devices")
                expect(shown.locator(".cut")).to_be_empty()
            finally:
                down.close()
            expect(shown.locator(".cut")).to_contain_text("The dashboard has no broker, so nothing can be ordered.")
            expect(shown.locator(".cut")).to_contain_text(re.compile(r"What is shown is of \d\d:\d\d:\d\d or before"))
            assert faults(shown) == []
            with mosquitto.private(tmp_path / "mosquitto", port=broker.port, anonymous=True):
                expect(shown.locator(".cut")).to_be_empty()
                expect(shown.locator(".link")).to_have_attribute("data-state", "live")


def test_a_connection_that_dies_without_a_word_is_noticed_and_made_again(alone: Running, chromium: Browser) -> None:
    with (
        network(urlsplit(alone.url).port or 0) as way,
        page(chromium, f"http://127.0.0.1:{way.port}") as shown,
    ):
        shown.clock.install()
        view(shown, "devices")
        link, banner = shown.locator(".link"), shown.locator(".cut")
        humidity = shown.locator("[data-item=Lab_Humidity] .value")
        say(alone, "home/Lab_Humidity/state", "41.5")
        expect(humidity).to_contain_text("41.5")
        way.cut()
        say(alone, "home/Lab_Humidity/state", "")  # nobody tells this page that it was taken away
        shown.clock.fast_forward(SILENT_MS)
        expect(link).to_have_attribute("data-state", "connecting")
        expect(banner).to_contain_text("No connection to the dashboard. What is shown is of")
        way.mend()
        expect(link).to_have_attribute("data-state", "live")
        expect(banner).to_be_empty()
        say(alone, "home/Bedroom_Temp/state", "19.5 °C")
        expect(shown.locator("[data-item=Bedroom_Temp] .value")).to_have_text("19.5 °C")
        expect(humidity).to_have_text("–")


def test_health_goes_on_for_whoever_reads_it_by_the_keyboard(alone: Running, shown: Page) -> None:
    say(alone, "diagnostics/tried", {"level": 0, "message": "fine", "values": {"turns": "1"}})
    view(shown, "health")
    row = shown.locator("[data-path='/tried']")
    row.press("Enter")
    expect(row).to_have_attribute("aria-expanded", "true")
    say(alone, "diagnostics/tried", {"level": 2, "message": "broken", "values": {"turns": "2", "teeth": "none"}})
    expect(row.locator(".said")).to_have_text("broken")
    expect(row.locator(".pair")).to_have_text(["turns2", "teethnone"])
    expect(shown.locator(".head .badge")).not_to_have_text("OK")
    expect(row).to_be_focused()
    assert shown.evaluate("document.activeElement.matches(':focus-visible')")
    row.press("ArrowUp")
    expect(shown.locator("[data-path='/service/dashboard']")).to_be_focused()


def test_a_page_whose_clock_is_wrong_tells_what_is_stale_all_the_same(alone: Running, shown: Page) -> None:
    shown.clock.set_system_time(datetime.now(UTC) + timedelta(hours=1))
    view(shown, "health")
    expect(shown.locator("[data-path='/service/dashboard'] > .line .dot")).to_have_attribute("aria-label", "OK")
    expect(shown.locator(".services tbody")).to_contain_text("online")


def test_a_component_that_died_before_the_page_was_opened_is_stale(alone: Running, shown: Page) -> None:
    say(alone, "diagnostics/ghost", {"level": 0, "message": "fine"})
    dot = shown.locator("[data-path='/ghost'] .dot")
    for _ in range(2):
        view(shown, "health")
        expect(dot).to_have_attribute("aria-label", "Stale")
        expect(shown.locator(".head .badge")).to_have_text("Stale")
        shown.reload()


def test_a_state_that_nobody_knows_is_not_shown_as_off(alone: Running, shown: Page) -> None:
    items = ("Kitchen_Light", "Radio_Player", "Lamp_Color")
    view(shown, "devices")
    cards = {item: shown.locator(f"[data-item={item}]") for item in items}
    dimmer = shown.locator("[data-item=Hall_Dimmer] input")
    expect(dimmer).to_have_value("0")  # not in the middle, where browsers put one of which they know nothing
    for card in cards.values():
        expect(card.locator(".value")).to_have_text("–")  # nobody has said anything
    expect(shown.locator("[data-item=Bedroom_Mode] select")).to_have_value("")
    switch, play = cards["Kitchen_Light"].get_by_role("switch"), cards["Radio_Player"].locator("button").nth(1)
    off = {"Kitchen_Light": "OFF", "Radio_Player": "PAUSE", "Lamp_Color": "0,0,0"}
    for unknown in ("NULL", "UNDEF"):
        say(alone, "home/Hall_Dimmer/state", "30")
        expect(dimmer).to_have_value("30")
        say(alone, "home/Hall_Dimmer/state", unknown)
        expect(dimmer).to_have_value("0")
        expect(dimmer).to_have_attribute("aria-label", "Hall light, state unknown")
        for item, card in cards.items():
            say(alone, f"home/{item}/state", unknown)
            expect(card.locator(".value")).to_have_text("–")
            expect(card.locator("[aria-label$=', state unknown']")).to_have_count(1)
        expect(switch).to_have_attribute("aria-label", "Kitchen light, state unknown")
        assert faults(shown) == []
        for item, card in cards.items():
            say(alone, f"home/{item}/state", off[item])
            expect(card.locator(".value")).to_be_hidden()
            expect(card.locator("[aria-label$=', state unknown']")).to_have_count(0)
        expect(switch).to_have_attribute("aria-checked", "false")
        expect(play).to_have_attribute("aria-label", re.compile("play or pause$"))
    say(alone, "home/Kitchen_Light/state", "UNDEF")
    view(shown, "apartment")
    mark = shown.locator("[data-item=Kitchen_Light]")
    expect(mark).to_have_attribute("aria-label", "Kitchen light: state unknown")
    say(alone, "home/Kitchen_Light/state", "OFF")
    expect(mark).to_have_attribute("aria-label", "Kitchen light: OFF")
