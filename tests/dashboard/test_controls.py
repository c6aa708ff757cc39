"""Every control of every view is pressed as a person would, and what comes of it is looked at on the bus.

Each test ends by asking the page which of its controls nobody has used: a new one cannot be forgotten.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from services.client import Client
from services.payloads import OrderResult, ServiceInfo
from services.peers import wait_until
from services.simulated import Simulated
from tests.dashboard.browser import VIEWS, WAIT_MS, page, unpressed, view
from tests.dashboard.parts import running

pytestmark = [pytest.mark.chromium, pytest.mark.mosquitto]
SOON_S = 20.0
LONG_S = 120.0  # a move, a scan or a mission on a busy machine
MARKER = 582
expect.set_options(timeout=WAIT_MS)


def commanded(bus: Client, item: str, press: Callable[[], object]) -> str:
    """What an item is commanded after a press."""
    bus.forget()
    press()
    return bus.until(lambda one: one.topic == f"home/{item}/command", SOON_S, f"a command to {item}").payload.decode()


def ordered(bus: Client, key: str, press: Callable[[], object], end: str = "done") -> Any:
    """The value of the order that a press gives the camera, when that has ended so."""
    bus.forget()
    press()
    order = json.loads(bus.until(lambda one: one.topic == f"camera/ip1/order/{key}", SOON_S, key).payload)
    result: OrderResult = bus.payload(
        "camera/ip1/order_result", lambda one: one.id == order["id"] and one.final, LONG_S
    )
    assert result.state == end, result
    return order["value"]


def button(page: Page, name: str) -> Locator:
    return page.get_by_role("button", name=name, exact=True)


def test_the_frame_leads_to_every_view_and_changes_colours(shown: Page) -> None:
    view(shown, "apartment")
    for name in reversed(VIEWS):
        shown.get_by_role("link", name=name.capitalize()).click()
        expect(shown.locator(f"main.view-{name} h1")).to_have_text(name.capitalize())
        expect(shown.locator("nav [aria-current=page]")).to_have_attribute("data-view", name)
    colours, html = shown.get_by_title("Colours"), shown.locator("html")
    for theme in ("light", "dark"):
        colours.click()
        expect(html).to_have_attribute("data-theme", theme)
    dark = shown.evaluate("getComputedStyle(document.body).backgroundColor")
    colours.click()
    expect(colours).to_have_text("auto")
    assert shown.evaluate("getComputedStyle(document.body).backgroundColor") != dark  # the machine's own is light
    shown.get_by_role("link", name="Health").click()
    expect(shown.locator("main.view-health h1")).to_be_focused()  # a view takes the focus when it is there
    shown.get_by_text("Skip to content").focus()
    shown.keyboard.press("Enter")
    expect(shown.locator("main.view-health")).to_be_focused()
    assert unpressed(shown, "body") == unpressed(shown, "main")


def test_the_plan_switches_what_can_be_switched_and_leads_on(shown: Page, bus: Client) -> None:
    view(shown, "apartment")
    marks = shown.locator(".thing[role=button]")
    expect(marks.first).to_be_visible()
    for mark in marks.all():
        item = mark.get_attribute("data-item") or ""
        first = commanded(bus, item, lambda mark=mark: mark.click(force=True))
        bus.payload(f"home/{item}/state", lambda state, first=first: state == first, SOON_S)
        expect(mark).to_have_attribute("aria-label", re.compile(f": {first}$"))
        assert {first, commanded(bus, item, lambda mark=mark: mark.press("Enter"))} == {"ON", "OFF"}
    shown.get_by_role("link", name="ip1").click()
    expect(shown.locator("main.view-camera")).to_be_visible()
    shown.go_back()
    shown.locator("main").get_by_role("link", name="tiago").click()
    expect(shown.locator("main.view-missions")).to_be_visible()
    shown.go_back()
    expect(shown.locator("main.view-apartment")).to_be_visible()
    assert unpressed(shown) == []


def test_every_device_is_commanded_by_its_own_control(shown: Page, bus: Client) -> None:
    view(shown, "devices")
    expect(shown.locator("[data-item=Radio_Volume] .value")).to_contain_text("%")
    for card in shown.locator(".card").all():
        item = card.get_attribute("data-item") or ""
        for control in card.locator("button, input, select").all():
            command = commanded(bus, item, lambda control=control: used(control))
            assert COMMANDS[kind_of(control)].fullmatch(command), (item, command)
            expect(card).to_have_attribute("aria-busy", "false")  # the home has confirmed it
            expect(card.locator(".note")).to_have_text("")
    search = shown.get_by_label("Filter devices")
    search.fill("shutter")
    expect(shown.locator(".card:visible")).to_have_count(1)
    search.fill("")
    assert unpressed(shown) == []


COMMANDS = {  # what a control of that kind says
    "switch": re.compile("ON|OFF"), "range": re.compile(r"\d+"), "color": re.compile(r"\d+,\d+,\d+"),
    "select": re.compile(r"\w+"), "off": re.compile("OFF"), "less": re.compile(r"[\d.]+ .+"),
    "more": re.compile(r"[\d.]+ .+"), "up": re.compile("UP"), "stop": re.compile("STOP"), "down": re.compile("DOWN"),
    "previous": re.compile("PREVIOUS"), "next": re.compile("NEXT"), "play or pause": re.compile("PLAY|PAUSE"),
}  # fmt: skip


def kind_of(control: Locator) -> str:
    """What kind of control it is: its role, its type, or what its label says after the device's name."""
    found: str = control.evaluate(
        "one => one.role ?? (one.localName === 'button' ? one.ariaLabel.split(': ').pop() : "
        "one.localName === 'select' ? 'select' : one.type)"
    )
    return found


def used(control: Locator) -> None:
    """Uses it as a person does: to another value than it has."""
    kind = kind_of(control)
    if kind == "range":
        control.press("ArrowLeft" if control.input_value() == control.get_attribute("max") else "ArrowRight")
    elif kind == "color":
        control.fill("#3060c0" if control.input_value() != "#3060c0" else "#c06030")
    elif kind == "select":
        other = control.evaluate("one => [...one.options].find((o) => !o.disabled && o.value !== one.value).value")
        control.select_option(other)
    else:
        control.click()


def test_every_control_of_the_camera_does_what_it_says(shown: Page, bus: Client, flat: Simulated) -> None:
    view(shown, "camera")
    expect(shown.locator(".where")).to_contain_text("Pan")
    watched(shown, bus)
    turned(shown, bus)
    saved(shown, bus)
    scanned(shown, bus)
    heard(shown, bus, flat)
    looked(shown, bus)
    assert unpressed(shown) == []


def watched(shown: Page, bus: Client) -> None:
    """The live picture, and one that is taken away."""
    live = shown.get_by_role("button", name=re.compile("^Live picture"))
    on = live.get_attribute("aria-pressed") == "true"
    assert ordered(bus, "RTSP", live.click) is not on
    expect(live).to_have_attribute("aria-pressed", "false" if on else "true")
    with shown.expect_download() as taken:
        shown.get_by_role("link", name="Snapshot").click()
    assert taken.value.path().read_bytes().startswith(b"\xff\xd8")


def turned(shown: Page, bus: Client) -> None:
    """Zoom, and the pad by the keys; by the pointer in `test_pages.py`."""
    assert ordered(bus, "Zoom", button(shown, "Zoom in").click) == "In"
    expect(shown.locator(".where div", has_text="Zoom")).not_to_have_text("Zoom0")
    assert ordered(bus, "Zoom", button(shown, "Zoom out").click) == "Out"
    pad = shown.get_by_role("application")
    pad.focus()
    shown.keyboard.down("ArrowLeft")
    bus.payload("camera/ip1/position", lambda one: one.moving, SOON_S)
    bus.forget()
    shown.keyboard.up("ArrowLeft")
    bus.until(lambda one: one.topic == "camera/ip1/order/Move" and b'"Stop"' in one.payload, SOON_S)
    bus.payload("camera/ip1/order_result", lambda one: (one.key, one.value, one.state) == ("Move", "Stop", "done"))


def saved(shown: Page, bus: Client) -> None:
    """A place is made, left, come back to, and forgotten."""
    shown.get_by_label("Name of the new place").fill("Corner")
    assert ordered(bus, "SaveAs", button(shown, "Save here").click) == "Corner"
    corner = shown.locator(".places button", has_text="Corner")
    expect(corner).to_have_attribute("aria-current", "true")
    assert ordered(bus, "Goto", shown.locator(".places button", has_text="TV").click) == "TV"
    expect(corner).not_to_have_attribute("aria-current", "true")
    assert ordered(bus, "Goto", corner.click) == "Corner"
    expect(corner).to_have_attribute("aria-current", "true")
    shown.once("dialog", lambda asked: asked.dismiss())
    button(shown, "Forget this place").click()
    shown.once("dialog", lambda asked: asked.accept())
    assert ordered(bus, "Remove", button(shown, "Forget this place").click) == "Corner"
    expect(corner).to_have_count(0)


def scanned(shown: Page, bus: Client) -> None:
    """A scan shows what it looks at; one that goes on is cancelled."""
    bus.order("ip1", "SetRoutine", "Living room", LONG_S)
    pictures, figure = shown.get_by_label("Show what it looks at"), shown.locator(".analysed")
    expect(figure).to_be_hidden()
    assert ordered(bus, "ScanImgPub", pictures.check) is True
    shown.get_by_label("Markers").fill(f"{MARKER}")
    assert ordered(bus, "Scan", button(shown, "Scan").click) == {"targets": [MARKER]}
    said = {one.payload for one in bus.seen if one.topic == "camera/ip1/scan/image"}
    assert all(jpeg.startswith(b"\xff\xd8") for jpeg in said)
    assert said
    expect(figure).to_be_visible()
    expect(figure).to_contain_text("Analysed at")
    # A newer picture that takes its place while it is decoded ends that with an error; then it is the newer one's turn.
    width = "one => one.decode().then(() => one.naturalWidth, () => 0)"
    wait_until(lambda: figure.locator("img").evaluate(width) > 320, "a picture that can be decoded")
    expect(shown.locator(".found")).to_contain_text("Living room")
    bus.order("ip1", "SetRoutine", "Living room,Kitchen,Sofa,TV", LONG_S)
    shown.get_by_label("Markers").fill("999")
    bus.forget()
    button(shown, "Scan").click()
    bus.payload("camera/ip1/scan/state", lambda one: one.state == "running" and one.targets == [999], LONG_S)
    assert ordered(bus, "Scan", button(shown, "Cancel").click) is False
    expect(shown.locator("main")).to_contain_text("Cancelled")
    assert ordered(bus, "ScanImgPub", pictures.uncheck) is False


def heard(shown: Page, bus: Client, flat: Simulated) -> None:
    """A recording is made, offered by its name, and played."""
    shown.get_by_label("Seconds").fill("1")
    assert ordered(bus, "AudioRec", button(shown, "Record").click) == "1"
    recording = bus.payload("camera/ip1/audio", timeout_s=SOON_S).file
    expect(shown.locator("main")).to_contain_text(f"Recorded {recording}")
    expect(shown.locator(f"datalist option[value='{recording}']")).to_have_count(1)
    assert list(flat.folder.rglob(recording))
    shown.get_by_label("File").fill(recording)
    assert ordered(bus, "AudioPlay", button(shown, "Play").click) == recording


def looked(shown: Page, bus: Client) -> None:
    """The options of the picture, which the camera reads back before it says done; at last it restarts."""
    for key in ("Flip", "Mirror", "Privacy"):
        for state in ("on", "off") if key == "Privacy" else ("off", "on"):
            pressed = button(shown, f"{key} {state}")
            assert ordered(bus, key, pressed.click) is (state == "on")
            expect(pressed).to_have_attribute("aria-pressed", "true")
    mode = shown.get_by_label("Video mode")
    for value in ("bw", "scan", "color", "auto"):
        assert ordered(bus, "VideoMode", lambda value=value: mode.select_option(value)) == value
        expect(mode).to_have_value(value)
    shown.once("dialog", lambda asked: asked.accept())
    bus.forget()
    button(shown, "Restart camera").click()
    bus.payload("camera/ip1/status", lambda one: one.state == "rebooting", SOON_S)
    expect(shown.locator(".head .badge")).to_have_text("rebooting")


def test_a_camera_is_chosen_where_there_are_several(
    chromium: Browser, tmp_path_factory: pytest.TempPathFactory
) -> None:
    with running(tmp_path_factory.mktemp("two"), cameras=("ip1", "ip2")) as made, page(chromium, made.url) as shown:
        for camera, pan in (("ip1", 11.0), ("ip2", 22.0)):
            position = {"pan": pan, "tilt": 5.0, "zoom": 0.0}
            made.bus.say(f"camera/{camera}/position", json.dumps(position), retain=True)
        view(shown, "camera")
        expect(shown.locator(".where")).to_contain_text("11.0°")
        shown.get_by_label("Camera", exact=True).select_option("ip2")
        expect(shown.locator(".where")).to_contain_text("22.0°")
        assert "Camera" not in unpressed(shown)


def test_history_goes_over_any_span_of_any_items(shown: Page) -> None:
    view(shown, "history")
    plots, start = shown.locator(".plots"), shown.get_by_label("From")
    for span in ("1 h", "6 h", "7 days", "30 days", "1 year", "24 h"):
        button(shown, span).click()
        expect(button(shown, span)).to_have_attribute("aria-pressed", "true")
        expect(plots).to_have_attribute("aria-busy", "false")
    chosen = shown.locator(".items input:checked")
    for _ in range(chosen.count()):
        chosen.first.uncheck()
    expect(plots).to_have_text("Choose items to see what was.")
    shown.get_by_label("Filter items").fill("kitchen light")
    row = shown.locator(".items li:visible")
    expect(row).to_have_count(1)
    row.get_by_role("checkbox").check()
    expect(plots.get_by_role("img", name="Kitchen light")).to_be_visible()
    with shown.expect_download() as taken:
        row.get_by_role("link").click()
    assert taken.value.path().read_bytes().startswith(b"time,state\r\n")
    before = start.input_value()
    start.fill("2026-01-31T07:05")
    shown.get_by_label("To", exact=True).fill("2026-02-01T07:05")
    expect(plots).to_have_attribute("aria-busy", "false")
    for _ in range(2):
        button(shown, "Zoom out").click()
    expect(start).to_have_value(before)
    assert unpressed(shown) == []


def test_a_mission_is_sent_asked_about_ended_and_still_known_after_a_restart(shown: Page, bus: Client) -> None:
    view(shown, "missions")
    panel, orders = shown.locator("[data-robot=tiago]"), "mission/tiago/order"
    shown.get_by_label("Marker", exact=True).fill("17")
    button(shown, "Find").click()
    sent = bus.payload(orders, lambda one: one.find == 17, SOON_S)
    expect(panel.locator(".timeline li").first).to_be_visible()
    button(shown, "Where was it last?").click()
    asked = bus.payload("mission/tiago/where", lambda one: one.marker == 17, SOON_S)
    bus.payload(f"mission/tiago/where/reply/{asked.id}", timeout_s=SOON_S)
    expect(shown.locator(".panel", has_text="Last seen").locator(".found li").first).to_contain_text("17")
    button(shown, "Cancel").click()
    bus.payload(orders, lambda one: one.cancel, SOON_S)
    ended = bus.payload("mission/tiago/result", lambda one: one.id == sent.id, LONG_S)
    assert ended.state == "cancelled"
    past = shown.locator(f"[data-mission='{sent.id}']")
    expect(past).to_have_attribute("open", "")
    past.locator("summary").click()
    expect(past).not_to_have_attribute("open", "")
    assert unpressed(shown) == []

    started = bus.payload("service/dashboard/info", timeout_s=SOON_S).started
    bus.say("service/dashboard/reload/set", "now")
    again: Callable[[ServiceInfo], bool] = lambda info: info.started != started  # noqa: E731
    bus.payload("service/dashboard/info", again, LONG_S)
    shown.reload()
    expect(past.locator(".timeline li")).to_have_count(len(ended.story))
    expect(past.locator(".badge")).to_have_text("Cancelled")


def test_health_unfolds_by_a_click(shown: Page) -> None:
    view(shown, "health")
    item = shown.locator("[data-path='/service/mission']")
    item.locator(".line").click()
    expect(item.locator(".pair").first).to_be_visible()
    item.locator(".line").click()
    expect(item.locator(".pair")).to_have_count(0)
    assert unpressed(shown) == []


def test_the_bus_is_held_and_let_go(shown: Page, bus: Client) -> None:
    view(shown, "bus")
    shown.get_by_label("Filter topics").fill("home/Home_Location/state")
    topic, hold = shown.locator(".topic .name"), shown.get_by_label("Hold")
    bus.say("home/Home_Location/state", "1.0,1.0", retain=True)
    expect(shown.locator(".topic .text")).to_have_text("1.0,1.0")
    topic.click()
    expect(shown.locator("pre.payload")).to_have_text("1.0,1.0")
    hold.check()
    bus.say("home/Home_Location/state", "2.0,2.0", retain=True)
    shown.get_by_label("Topic", exact=True).fill("home/Kitchen_Light/command")
    shown.get_by_role("textbox", name="Payload").fill("ON")
    button(shown, "Publish").click()
    bus.until(lambda one: one.topic == "home/Kitchen_Light/command" and one.payload == b"ON", SOON_S)
    expect(shown.locator(".toast")).to_contain_text("home/Kitchen_Light/command")
    expect(shown.locator(".topic .text")).to_have_text("1.0,1.0")
    hold.uncheck()
    expect(shown.locator(".topic .text")).to_have_text("2.0,2.0")
    assert unpressed(shown) == []
