"""Pictures of every view, for people to look at: `python -m tests.dashboard.pictures FOLDER`.

The simulated apartment in a busy moment, on a desktop, on a phone and in the dark.
"""

from __future__ import annotations

import math
import random
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

from playwright.sync_api import Page, expect

from services import persistence
from services.client import Client, connected
from services.config import BusSettings
from services.simulated import Simulated, parts_of, services_of, start_mosquitto
from services.storage import Batch, Sample, open_storage, reading
from tests.dashboard import browser as browsers
from tests.dashboard.browser import DESKTOP, PHONE, VIEWS, WAIT_MS, page, view

FORMS = {"desktop": (DESKTOP, "light"), "phone": (PHONE, "light"), "dark": (DESKTOP, "dark")}
PLACES = ("Sofa", "TV", "Living room", "Kitchen", "Dining")
SOME_S = 0.5  # until the last picture and the fonts are there


def main(folder: Path) -> None:
    """Takes them all."""
    folder.mkdir(parents=True, exist_ok=True)
    expect.set_options(timeout=WAIT_MS)
    with tempfile.TemporaryDirectory(prefix="pictures-") as name, parts_of(Path(name), real=False) as parts:
        parts.broker.close()
        start_mosquitto(parts)
        with services_of(Path(name) / "flat", parts, without=("bridge",)) as flat, browsers.chromium() as chromium:
            with connected(BusSettings(port=parts.broker_port), ["#"]) as bus:
                busy(flat, bus)
            for form, (size, scheme) in FORMS.items():
                with page(chromium, str(flat.ready["dashboard"]["url"]).rstrip("/"), size=size, scheme=scheme) as shown:
                    for one in VIEWS:
                        take(shown, one, folder / f"{one}-{form}.png")


def take(shown: Page, name: str, file: Path) -> None:
    """One picture, when everything is there."""
    view(shown, name)
    if name == "history":
        shown.goto("/#/history/Kitchen_Temp,Bedroom_Temp,Lab_Humidity,Kitchen_Light,Bedroom_Mode")
        shown.reload()
        expect(shown.locator(".u-over").first).to_be_visible()
        expect(shown.locator(".plots")).to_have_attribute("aria-busy", "false")
    if name == "camera":
        expect(shown.locator(".video.seen")).to_be_visible()
    if name == "bus":
        shown.locator(".topic .name").nth(2).click()
    shown.wait_for_timeout(SOME_S * 1000 * (6 if name == "health" else 1))
    shown.screenshot(path=file)


def busy(flat: Simulated, bus: Client) -> None:
    """Lights, places with pictures, a scan, a mission, a day that was stored."""
    for item, command in {"Kitchen_Light": "ON", "Hall_Dimmer": "60", "Lamp_Color": "35,80,90", "Radio_Player": "PLAY",
                          "Radio_Volume": "35", "Bedroom_Shutter": "40"}.items():  # fmt: skip
        bus.say(f"home/{item}/command", command)
    yesterday(flat)
    bus.say("camera/ip1/order/RTSP", "ON")
    for place in PLACES:
        bus.order("ip1", "Goto", place)
        bus.collect(6.0)
    bus.order("ip1", "ScanImgPub", True)
    bus.order("ip1", "Scan", {"targets": [582, 17], "places": ["Living room", "Kitchen"]}, timeout_s=200.0)
    bus.say("mission/tiago/order", '{"find": 582, "id": "pictured"}')
    bus.until(lambda one: one.topic == "mission/tiago/result", 200.0)
    bus.order("ip1", "Goto", "Living room")
    bus.say("mission/tiago/order", '{"find": 17, "id": "second"}')
    bus.payload("mission/tiago/state", lambda one: one.marker == 17, 60.0)


def yesterday(flat: Simulated) -> None:
    """A day of samples, as a home has them."""
    config = flat.apartment.instances["persistence"].config
    assert isinstance(config, persistence.Config)
    draw, now = random.Random(7), int(time.time())
    with closing(open_storage(config.address)) as storage:
        known = reading.items(storage)
        samples = []
        for minute in range(0, 24 * 60, 5):
            at, turn = (now - 86_400 + minute * 60) * 1_000_000, math.tau * minute / 1440
            for item, middle, swing in (("Kitchen_Temp", 20.6, 1.4), ("Bedroom_Temp", 18.9, 1.1)):
                samples.append(Sample(item, at, round(middle - swing * math.cos(turn) + draw.gauss(0, 0.08), 1), None))
            samples.append(Sample("Lab_Humidity", at, round(44 + 4 * math.sin(turn) + draw.gauss(0, 0.3), 1), None))
            if minute % 240 in (0, 95):
                lit = minute % 240 == 0
                samples.append(Sample("Kitchen_Light", at, float(lit), "ON" if lit else "OFF"))
            if minute % 360 == 0:
                samples.append(Sample("Bedroom_Mode", at, None, ("eco", "manual", "auto", "off")[minute // 360 % 4]))
        storage.write(Batch([one for one in samples if one.item in known]))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
