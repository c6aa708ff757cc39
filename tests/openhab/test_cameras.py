"""A camera's items in OpenHAB: what its channels make of all that the camera's service says, by OpenHAB's rules."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from services.bus import Message
from services.camera.alarm.listener import HEARD, Heard
from services.camera.device import Event
from services.openhab import cameras
from services.openhab.lines import ChannelLine
from services.openhab.site import Camera, Site
from services.openhab.versions import parse
from tests.camera.flat import Flat
from tests.openhab.homes import shipped

POSITIONS = "Kitchen: [41.1, 34.5, 0]\nSofa: [350.0, 40.0, 0]\n"
MOTION = Event("VideoMotion", "Start")


class OpenHab:
    """The camera's generic thing: what is null in JSON changes nothing, a switch knows its two words and no other."""

    def __init__(self, flat: Flat) -> None:
        thing = cameras.thing(Site(shipped(), parse("5")), Camera("ip1", ("Kitchen", "Sofa"), (582,)))
        self.flat = flat
        self.channels = {one.id: one for one in thing.channels}
        self.states: dict[str, str] = {}
        self._heard = 0

    def state(self, channel: str) -> str | None:
        """What the item of that channel shows after everything that was said so far."""
        for message in self.flat.said[self._heard :]:
            for one in self.channels.values():
                if one.settings.get("stateTopic") == message.topic and one.type != "image":
                    self._hear(one, message)
        self._heard = len(self.flat.said)
        return self.states.get(channel)

    def command(self, channel: str, word: str) -> None:
        """What the item is told, in the device's words where it is a switch."""
        settings = self.channels[channel].settings
        said = str(settings[word.lower()]) if self.channels[channel].type == "switch" else word
        self.flat.send(str(settings["commandTopic"]), said.encode())

    def _hear(self, channel: ChannelLine, message: Message) -> None:
        value: Any = json.loads(message.payload)
        for key in str(channel.settings["transformationPattern"]).removeprefix("JSONPATH:$.").split("."):
            value = value[key]
        if value is None:
            return
        text = value if isinstance(value, str) else json.dumps(value)
        if channel.type == "switch":
            words = {channel.settings["on"]: "ON", channel.settings["off"]: "OFF"}
            assert text in words, f"a warning in the log: {text!r} is no state of {channel.id}"
            text = words[text]
        self.states[channel.id] = text


@pytest.fixture
def openhab(tmp_path: Path) -> OpenHab:
    (tmp_path / "preset_position.yaml").write_text(POSITIONS)
    (tmp_path / "preset_coords.yaml").write_text("Kitchen: 3\nSofa: 1\n")
    return OpenHab(Flat(tmp_path, places=Path()).online())


def test_the_place_is_empty_as_soon_as_the_camera_has_left_it(openhab: OpenHab) -> None:
    flat = openhab.flat
    openhab.command("place", "Kitchen")
    flat.until(lambda: openhab.state("place") == "Kitchen")
    openhab.command("move", "Left")
    flat.until(lambda: openhab.state("place") == "")
    flat.run(10)
    assert openhab.state("place") == ""


def test_motion_goes_off_while_the_alarm_is_in_trouble(openhab: OpenHab) -> None:
    flat = openhab.flat
    flat.service.motion.on = True  # as with a listener to the camera's events
    flat.inbox.append(Message(HEARD, value=Heard(flat.now, (MOTION,), attached=True)))
    flat.until(lambda: openhab.state("motion") == "ON")
    flat.inbox.append(Message(HEARD, value=Heard(flat.now, lost="the network is cut")))
    flat.until(lambda: openhab.state("motion_value") == "-1")
    assert openhab.state("motion") == "OFF"


def test_the_switch_of_a_scan_shows_it_while_it_runs_and_calls_it_off(openhab: OpenHab) -> None:
    flat = openhab.flat
    assert openhab.state("scan") == "OFF"
    openhab.command("scan", "ON")
    flat.until(lambda: openhab.state("scan") == "ON")
    openhab.command("scan", "OFF")
    flat.until(lambda: openhab.state("scan_state") == "cancelled")
    assert openhab.state("scan") == "OFF"
