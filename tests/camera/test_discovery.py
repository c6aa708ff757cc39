"""What Home Assistant is told: it would take it, the templates say what our topics say, and it goes away again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from jinja2 import Environment
from pydantic import BaseModel

from services import topics
from services.bus import Message
from services.camera import orders
from services.camera.device import Identity
from services.camera.discovery import Discovery, entities
from services.payloads import CameraStatus, Diagnostic, Motion, Position, ScanState, Stream
from tests.camera.flat import Flat

WHO = Identity("IP3M-941W", "AMC0000000000001", "2.420.AC00.15.R")
PLACES = ["Kitchen", "Living room", '{"odd": "}', "Käfig: yes"]
TEMPLATES = Environment()

# What each platform of Home Assistant's MQTT integration takes: keys it needs, and those it knows besides.
COMMON = {
    "availability",
    "availability_mode",
    "device",
    "origin",
    "entity_category",
    "icon",
    "name",
    "unique_id",
    "qos",
}
NEEDED: dict[str, tuple[set[str], set[str]]] = {
    "camera": ({"topic"}, {"image_encoding"}),
    "binary_sensor": ({"state_topic"}, {"value_template", "device_class", "payload_on", "payload_off"}),
    "select": ({"command_topic", "options"}, {"command_template", "state_topic", "value_template"}),
    "button": ({"command_topic"}, {"payload_press", "command_template", "device_class"}),
    "switch": ({"command_topic"}, {"state_topic", "value_template", "payload_on", "payload_off", "optimistic"}),
    "sensor": ({"state_topic"}, {"value_template", "unit_of_measurement", "device_class", "state_class"}),
}
DEVICE = {"identifiers", "name", "model", "serial_number", "sw_version", "manufacturer"}
CLASSES = {"motion", "restart", None}
CATEGORIES = {"config", "diagnostic", None}


def told(places: list[str] = PLACES) -> dict[tuple[str, str], dict[str, Any]]:
    return {key: json.loads(text) for key, text in entities("ip1", WHO, places).items()}


def rendered(template: str, payload: BaseModel | str) -> str:
    """As Home Assistant renders it: the payload as text, and as JSON."""
    text = payload if isinstance(payload, str) else payload.model_dump_json()
    values: dict[str, Any] = {"value": text}
    if isinstance(payload, BaseModel):
        values["value_json"] = json.loads(text)
    return TEMPLATES.from_string(template).render(values)


@pytest.mark.parametrize("key", told())
def test_every_entity_is_one_that_home_assistant_takes(key: tuple[str, str]) -> None:
    platform, entity = key
    content = told()[key]
    needed, known = NEEDED[platform]
    assert needed <= set(content), f"{entity} lacks {needed - set(content)}"
    assert set(content) <= needed | known | COMMON
    assert None not in content.values()
    assert content["availability_mode"] in ("all", "any", "latest")
    assert all("topic" in one for one in content["availability"])
    assert content["device"]["identifiers"] == ["apartment_ip1"]
    assert set(content["device"]) <= DEVICE
    assert content["origin"]["name"]
    assert content.get("device_class") in CLASSES
    assert content.get("entity_category") in CATEGORIES


def test_the_entities_are_told_apart_and_belong_to_one_device() -> None:
    contents = told().values()
    assert len({content["unique_id"] for content in contents}) == len(contents)
    assert {json.dumps(content["device"]) for content in contents} == {json.dumps(next(iter(contents))["device"])}
    assert next(iter(contents))["device"]["serial_number"] == WHO.serial


def test_everything_that_was_asked_for_is_there() -> None:
    assert {
        ("camera", "snapshot"), ("binary_sensor", "motion"), ("select", "place"), ("button", "scan"),
        ("button", "stop"), ("button", "reboot"), ("switch", "privacy"), ("switch", "mjpeg"), ("sensor", "latency"),
    } <= set(told())  # fmt: skip


@pytest.mark.parametrize("key", [key for key, content in told().items() if "command_topic" in content])
def test_what_a_command_sends_is_an_order_that_we_take(key: tuple[str, str]) -> None:
    content = told()[key]
    words = [content.get("payload_press"), content.get("payload_on"), content.get("payload_off")]
    wanted = content.get("options") or [word for word in words if word is not None]
    assert wanted
    for word in wanted:
        payload = rendered(content.get("command_template", "{{ value }}"), word)
        read = topics.read(Message(content["command_topic"], payload.encode(), received=1.0), 1.0)
        if read.topic is topics.CAMERA_ORDER:
            assert str(read.payload.value) == word
            assert read.levels["key"] in dict(orders.KEYS.values())


@pytest.mark.parametrize(
    ("key", "payload", "said"),
    [
        (("binary_sensor", "motion"), Motion(value=1, since="x"), "ON"),
        (("binary_sensor", "motion"), Motion(value=0, since="x"), "OFF"),
        (("binary_sensor", "motion"), Motion(value=-1, since="x"), "None"),
        (("select", "place"), Position(pan=1, tilt=2, zoom=0, place="Käfig: yes"), "Käfig: yes"),
        (("select", "place"), Position(pan=1, tilt=2, zoom=0), "None"),
        (("switch", "mjpeg"), Stream(rtsp=False, mjpeg=True, url=""), "ON"),
        (("switch", "mjpeg"), Stream(rtsp=True, mjpeg=False, url=""), "OFF"),
        (("switch", "privacy"), Diagnostic(level=0, message="", values={"privacy": "on"}), "ON"),
        (("switch", "privacy"), Diagnostic(level=0, message="", values={"privacy": "off"}), "OFF"),
        (("switch", "privacy"), Diagnostic(level=0, message=""), "OFF"),
        (("sensor", "pan"), Position(pan=12.5, tilt=2, zoom=0), "12.5"),
        (("sensor", "zoom"), Position(pan=12.5, tilt=2, zoom=4), "4.0"),
        (("sensor", "scan_state"), ScanState(state="running"), "running"),
        (("sensor", "latency"), Diagnostic(level=0, message="", values={"http_latency_ms": "304"}), "304"),
    ],
)
def test_a_template_says_what_the_topic_says(key: tuple[str, str], payload: BaseModel, said: str) -> None:
    content = told()[key]
    topic, _ = topics.find(content["state_topic"])
    assert topic.payload is type(payload)
    assert rendered(content["value_template"], payload) == said


@pytest.mark.parametrize(
    ("state", "said"),
    [("online", "online"), ("degraded", "online"), ("offline", "offline"), ("locked", "offline")],
)
def test_the_camera_is_available_while_it_can_be_used(state: Any, said: str) -> None:
    service, camera = told()["camera", "snapshot"]["availability"]
    assert topics.find(service["topic"])[0] is topics.SERVICE_STATUS
    assert rendered(camera["value_template"], CameraStatus(state=state)) == said


class Told:
    """A discovery and what it said."""

    def __init__(self, *, on: bool) -> None:
        self.said: list[Message] = []
        self.discovery = Discovery("ip1", self.said.append, on=on)

    def tick(self, identity: Identity | None = WHO, places: tuple[str, ...] = ("Kitchen",)) -> list[str]:
        self.said.clear()
        self.discovery.tick(identity, places)
        assert all(message.retain for message in self.said)
        return [f"{'' if message.payload else '-'}{'/'.join(message.topic.split('/')[1:4:2])}" for message in self.said]

    def hear(self, topic: str, payload: str, *, retain: bool = True) -> None:
        self.discovery.hear(topics.read(Message(topic, payload.encode(), retain=retain, received=1.0), 1.0))


def test_it_is_told_once_and_again_when_home_assistant_starts() -> None:
    told = Told(on=True)
    first = told.tick()
    assert "select/place" in first
    assert told.tick() == []
    told.hear("homeassistant/status", "offline", retain=False)
    assert told.tick() == []
    told.hear("homeassistant/status", "online", retain=False)
    assert told.tick() == first


def test_nothing_is_told_before_the_camera_said_who_it_is() -> None:
    told = Told(on=True)
    assert told.tick(identity=None) == []
    assert told.tick() != []


def test_a_new_place_becomes_an_option_and_the_last_one_takes_the_select_away() -> None:
    told = Told(on=True)
    told.tick()
    assert told.tick(places=("Kitchen", "Sofa")) == ["select/place"]
    assert json.loads(told.said[0].payload)["options"] == ["Kitchen", "Sofa"]
    assert told.tick(places=()) == ["-select/place"]
    assert told.tick(places=()) == []


def test_what_is_retained_from_before_is_taken_away_when_it_is_switched_off() -> None:
    told = Told(on=False)
    assert told.tick() == []
    told.hear("homeassistant/sensor/ip1/pan/config", '{"name": "Pan"}')
    assert told.tick() == ["-sensor/pan"]
    told.hear("homeassistant/sensor/ip1/pan/config", "", retain=False)  # our own word comes back
    assert told.tick() == []


def test_an_entity_of_an_older_version_is_taken_away_and_those_of_today_stay() -> None:
    told = Told(on=True)
    told.tick(identity=None)
    told.hear("homeassistant/sensor/ip1/colour/config", '{"name": "Colour"}')
    told.hear("homeassistant/sensor/ip1/pan/config", '{"name": "Pan"}')
    assert told.tick(identity=None) == ["-sensor/colour"]


def test_the_service_tells_its_places_when_it_is_configured_and_nothing_otherwise(tmp_path: Path) -> None:
    for name, on in (("off", False), ("on", True)):
        flat = Flat(tmp_path / name, discovery=on).online()
        flat.order("SaveAs", "Näst: yes")
        flat.until(flat.ended)
        flat.run(2)
        selects = [message for message in flat.said if message.topic == "homeassistant/select/ip1/place/config"]
        assert [json.loads(message.payload)["options"] for message in selects] == [["Näst: yes"]] * on
