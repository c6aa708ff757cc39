"""What a person does and sees: every view in Chromium, against the simulated apartment on real parts."""

from __future__ import annotations

import json
import re
import statistics
import time
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from services import peers
from services.client import Client
from services.simulated import Simulated
from tests.dashboard.browser import DESKTOP, PHONE, VIEWS, WAIT_MS, faults, page, unpressed, view
from tests.dashboard.conftest import address
from tests.dashboard.parts import PASSWORD, USERS, running

pytestmark = [pytest.mark.chromium, pytest.mark.mosquitto]
TARGET = 582
ROUNDS = 5
LONG_MS = 120_000  # a scan or a mission on a busy machine
expect.set_options(timeout=WAIT_MS)


def switched(page: Page, item: str) -> Any:
    return page.locator(f"[data-item={item}] [role=switch]")


def test_a_light_is_switched_and_shows_it_when_the_home_confirms(shown: Page, bus: Client) -> None:
    bus.say("home/Kitchen_Light/command", "OFF")
    view(shown, "devices")
    light = switched(shown, "Kitchen_Light")
    expect(light).to_have_attribute("aria-checked", "false")
    light.click()
    bus.until(lambda one: one.topic == "home/Kitchen_Light/command" and one.payload == b"ON", 20.0)
    bus.until(lambda one: one.topic == "home/Kitchen_Light/state" and one.payload == b"ON", 20.0)
    expect(light).to_have_attribute("aria-checked", "true")
    expect(shown.locator("[data-item=Kitchen_Light]")).to_have_attribute("aria-busy", "false")


def test_a_control_waits_for_the_device_and_tells_when_nobody_answers(shown: Page, flat: Simulated) -> None:
    shown.clock.install()
    view(shown, "devices")
    card = shown.locator("[data-item=Kitchen_Plug]")
    shown.route("**/command", lambda route: route.fulfill(status=202, json={"id": None}))  # it never gets there
    switched(shown, "Kitchen_Plug").click()
    expect(card).to_have_attribute("aria-busy", "true")
    shown.clock.fast_forward(10_000)
    expect(card.locator(".note")).to_have_text("no answer")
    expect(card).to_have_attribute("aria-busy", "false")


def test_a_slider_is_moved_by_the_keyboard(shown: Page, bus: Client) -> None:
    bus.say("home/Hall_Dimmer/command", "0")
    view(shown, "devices")
    slider = shown.locator("[data-item=Hall_Dimmer] input")
    expect(slider).to_have_value("0")
    slider.focus()
    bus.forget()
    slider.press("ArrowRight")
    bus.until(lambda one: one.topic == "home/Hall_Dimmer/command" and one.payload == b"10", 20.0)
    expect(shown.locator("[data-item=Hall_Dimmer] .value")).to_have_text("10 %")


WATCH = """() => {
  const value = document.querySelector("[data-item=Home_Location] .value");
  const seen = {}, waiting = {};
  new MutationObserver(() => {
    seen[value.textContent] ??= Date.now();
    waiting[value.textContent]?.(seen[value.textContent]);
  }).observe(value, {subtree: true, childList: true, characterData: true});
  window.seenAt = (text) => new Promise((done, failed) => {
    waiting[text] = done;
    if (seen[text]) done(seen[text]);
    setTimeout(() => failed(new Error(`${text} was never seen`)), 20000);
  });
}"""


def test_a_change_is_seen_within_300_ms_of_its_message(shown: Page, bus: Client) -> None:
    """The middle one of ten; a machine that is busy with other things may be late for a while, and is asked again."""
    view(shown, "devices")
    value = shown.locator("[data-item=Home_Location] .value")
    expect(value).to_be_visible()
    shown.evaluate(WATCH)
    medians = []
    while len(medians) < ROUNDS and min(medians, default=300.0) >= 300.0:
        late = []
        for number in range(10):
            text = f"{len(medians)}.{number},0.0"
            said = time.time() * 1000
            bus.say("home/Home_Location/state", text)
            late.append(shown.evaluate("text => window.seenAt(text)", text) - said)
        medians.append(statistics.median(late))
    assert min(medians) < 300.0, medians


def test_the_camera_is_centred_by_a_click_and_its_view_turns_on_the_plan(shown: Page, bus: Client) -> None:
    bus.say("camera/ip1/order/RTSP", "ON")
    view(shown, "camera")
    expect(shown.locator(".video.seen")).to_be_visible()
    before = bus.payload("camera/ip1/position", lambda one: not one.moving)
    picture = shown.locator(".video img")
    expect(picture).to_have_attribute("src", re.compile("stream.mjpg"))
    expect(shown.locator(".video .over")).to_be_hidden()
    box = picture.bounding_box()
    assert box is not None
    bus.forget()
    picture.click(position={"x": box["width"] * 0.75, "y": box["height"] * 0.5})
    done = bus.payload("camera/ip1/order_result", lambda one: one.key == "Position" and one.state == "done", 60.0)
    assert done.position is not None
    # a quarter of the picture, 1152 pixels wide at a focal length of 579 pixels, and the camera looks down
    assert 22 < (done.position.pan - before.pan) % 360 < 40
    shown.evaluate("location.hash = '#/apartment'")
    at = shown.locator(".view[data-camera=ip1]")
    expect(at).to_have_attribute("data-azimuth", re.compile("."))
    azimuth = 35.0 - done.position.pan
    peers.wait_until(lambda: abs(float(at.get_attribute("data-azimuth") or 0.0) - azimuth) < 1.0, "the view to turn")


def test_the_joystick_turns_while_it_is_held_and_stops_when_it_is_let_go(shown: Page, bus: Client) -> None:
    view(shown, "camera")
    pad = shown.locator(".pad")
    box = pad.bounding_box()
    assert box is not None
    moves = lambda value: lambda one: one.topic == "camera/ip1/order/Move" and json.loads(one.payload)["value"] == value  # noqa: E731
    shown.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    shown.mouse.down()
    shown.mouse.move(box["x"] + box["width"] * 0.8, box["y"] + box["height"] / 2)
    bus.until(moves("Right 5 0.8"), 20.0)
    bus.payload("camera/ip1/position", lambda one: one.moving, 20.0)
    shown.mouse.up()
    bus.until(moves("Stop"), 20.0)
    expect(shown.locator(".where")).not_to_contain_text("moving")
    pad.focus()
    shown.keyboard.down("ArrowUp")
    bus.until(moves("Up 4 0.8"), 20.0)
    bus.forget()
    shown.evaluate("window.dispatchEvent(new Event('blur'))")  # another window takes the keys
    bus.until(moves("Stop"), 20.0)
    shown.keyboard.up("ArrowUp")


def test_a_scan_is_started_and_what_it_found_is_on_the_plan(shown: Page, bus: Client) -> None:
    assert bus.order("ip1", "SetRoutine", "Living room").state == "done"  # one place is quick
    view(shown, "camera")
    shown.get_by_label("Markers").fill(f"{TARGET}")
    shown.get_by_role("button", name="Scan", exact=True).click()
    expect(shown.locator(".view-camera")).to_contain_text("Looking from")
    expect(shown.locator(".found")).to_contain_text(f"{TARGET}", timeout=LONG_MS)
    view(shown, "apartment")
    marker = shown.locator(f"[data-marker='{TARGET}']")
    expect(marker).to_be_visible()
    expect(marker).to_have_attribute("aria-label", f"Marker {TARGET}, Living room")
    bus.payload("camera/ip1/scan/state", lambda one: one.state == "done", LONG_MS / 1000)


def test_a_mission_is_sent_and_cancelled(shown: Page, bus: Client) -> None:
    view(shown, "missions")
    panel = shown.locator("[data-robot=tiago]")
    expect(panel.locator(".now")).to_contain_text("Waiting for orders")
    shown.get_by_label("Marker", exact=True).fill("17")
    shown.get_by_role("button", name="Find").click()
    expect(panel.locator(".now")).to_contain_text("marker 17")
    expect(panel.locator(".timeline li").first).to_be_visible()
    shown.get_by_role("button", name="Cancel").click()
    expect(shown.locator("details .badge").first).to_have_text("Cancelled", timeout=LONG_MS)


def test_a_plot_is_zoomed_by_dragging_and_taken_away_as_a_table(shown: Page, flat: Simulated) -> None:
    view(shown, "history")
    shown.get_by_role("button", name="1 h", exact=True).click()
    plot = shown.locator(".u-over").first
    expect(plot).to_be_visible()
    expect(shown.locator(".plots")).to_have_attribute("aria-busy", "false")
    before = shown.get_by_label("From").input_value()
    box = plot.bounding_box()
    assert box is not None
    shown.mouse.move(box["x"] + box["width"] * 0.7, box["y"] + 40)
    shown.mouse.down()
    shown.mouse.move(box["x"] + box["width"] * 0.98, box["y"] + 60, steps=4)
    with shown.expect_response(lambda answer: "/api/history/" in answer.url):
        shown.mouse.up()
    expect(shown.get_by_role("button", name="Zoom out")).to_be_enabled()
    expect(shown.get_by_label("From")).not_to_have_value(before)
    with shown.expect_download() as taken:
        shown.get_by_label("Kitchen temperature as CSV").click()
    assert taken.value.path().read_bytes().startswith(b"time,least,mean,greatest\r\n")


def test_health_shows_components_services_and_rates(shown: Page) -> None:
    view(shown, "health")
    expect(shown.get_by_role("treeitem").filter(has_text="persistence").first).to_be_visible()
    expect(shown.locator(".services")).to_contain_text("mission")
    expect(shown.locator(".rates")).to_contain_text("diagnostics")
    item = shown.locator("[data-path='/service/dashboard']")
    item.press("Enter")
    expect(item.locator(".pair").first).to_be_visible()


def test_the_bus_is_filtered_read_and_spoken_to(shown: Page, bus: Client) -> None:
    view(shown, "bus")
    shown.get_by_label("Filter topics").fill("camera/+/status")
    expect(shown.locator(".topic")).to_have_count(1)
    expect(shown.locator(".topic .kind")).to_have_text("retained")
    shown.locator(".topic .name").click()
    expect(shown.locator("pre.payload")).to_contain_text('"state": "online"')
    shown.get_by_label("Topic", exact=True).fill("home/Radio_Player/command")
    shown.get_by_role("textbox", name="Payload").fill("PLAY")
    shown.get_by_role("button", name="Publish").click()
    bus.until(lambda one: one.topic == "home/Radio_Player/command" and one.payload == b"PLAY", 20.0)
    shown.get_by_label("Topic", exact=True).fill("service/mission/status")
    shown.get_by_role("button", name="Publish").click()
    expect(shown.locator(".toast.bad")).to_contain_text("may not say that")


def test_axe_finds_no_serious_fault_on_any_view_and_none_is_wider_than_the_screen(shown: Page) -> None:
    found = {}
    for name in VIEWS:
        view(shown, name)
        if name == "history":
            expect(shown.locator(".plots")).to_have_attribute("aria-busy", "false")
        if name == "health":
            expect(shown.locator(".rate").first).to_be_visible()
        for size, scheme in ((DESKTOP, "light"), (PHONE, "dark")):
            shown.set_viewport_size(size)
            shown.emulate_media(color_scheme=scheme)
            found[f"{name}, {scheme}"] = faults(shown)
            wide = shown.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
            assert wide <= 0, f"{name}, {scheme}: {wide} pixels wider than the screen"
    assert {name: faults for name, faults in found.items() if faults} == {}


def test_the_page_loads_less_than_300_kilobytes_and_nothing_from_elsewhere(flat: Simulated, chromium: Browser) -> None:
    with page(chromium, address(flat)) as made:
        loaded: dict[str, int] = {}
        session = made.context.new_cdp_session(made)
        urls: dict[str, str] = {}
        session.on(
            "Network.responseReceived", lambda event: urls.update({event["requestId"]: event["response"]["url"]})
        )
        session.on(
            "Network.loadingFinished", lambda event: loaded.update({event["requestId"]: event["encodedDataLength"]})
        )
        session.send("Network.enable")
        for name in VIEWS:
            view(made, name)
        expect(made.locator(".topic").first).to_be_visible()
        files = {urls[key]: size for key, size in loaded.items() if key in urls and "/api/" not in urls[key]}
    assert files
    assert all(url.startswith((address(flat), "data:")) for url in urls.values())
    assert sum(files.values()) < 300_000, files


def test_a_login_is_refused_then_granted_and_who_only_looks_has_no_controls(
    chromium: Browser, tmp_path_factory: pytest.TempPathFactory
) -> None:
    with running(tmp_path_factory.mktemp("login"), users=USERS) as made, page(chromium, made.url) as shown:
        made.bus.say("home/Kitchen_Light/state", "OFF", retain=True)
        shown.goto("/#/devices")
        shown.get_by_label("Name").fill("vic")
        shown.get_by_label("Password").fill("wrong")
        shown.get_by_role("button", name="Log in").click()
        assert unpressed(shown) == []
        expect(shown.get_by_role("alert")).to_have_text("wrong name or password")
        assert faults(shown) == []
        shown.get_by_label("Password").fill(PASSWORD)
        shown.get_by_label("Password").press("Enter")
        expect(shown.locator("[data-item=Kitchen_Light] .value")).to_have_text("OFF")
        expect(shown.get_by_role("switch")).to_have_count(0)
        shown.get_by_title("Log out").click()
        expect(shown.get_by_role("button", name="Log in")).to_be_visible()


def test_a_page_that_was_cut_off_has_everything_again(shown: Page, flat: Simulated, bus: Client) -> None:
    view(shown, "devices")
    shown.context.set_offline(True)
    bus.say("home/Bedroom_Mode/command", "eco")
    bus.until(lambda one: one.topic == "home/Bedroom_Mode/state" and one.payload == b"eco", 20.0)
    shown.context.set_offline(False)
    expect(shown.locator("[data-item=Bedroom_Mode] select")).to_have_value("eco")
