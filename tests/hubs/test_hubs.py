"""What other hubs are told of the home: Home Assistant's entities and the device of Homie."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import pytest
from jinja2 import Environment

from services import topics
from services.apartment.home import Home
from services.bus import Message
from services.errors import BadMessage
from services.hubs.homeassistant import entities
from services.hubs.service import Config, Hubs
from services.topics import HOME_STATE, HOMIE_SET
from tests.openhab.homes import shipped

NOW = 1_000_000.0
TEMPLATES = Environment()
COMMON = {"unique_id", "name", "availability_topic", "device", "origin", "state_topic", "value_template"}
ALLOWED: dict[str, set[str]] = {  # by platform of Home Assistant's MQTT integration
    "switch": {"command_topic", "payload_on", "payload_off"},
    "binary_sensor": {"payload_on", "payload_off", "device_class"},
    "sensor": {"unit_of_measurement", "state_class", "device_class"},
    "number": {"command_topic", "min", "max", "step", "mode", "unit_of_measurement"},
    "select": {"command_topic", "options", "command_template"},
    "text": {"command_topic"},
    "cover": {"command_topic", "position_topic", "set_position_topic", "payload_open", "payload_close", "payload_stop",
              "position_open", "position_closed", "position_template"},
    "light": {"command_topic", "payload_on", "payload_off", "state_value_template", "brightness_scale",
              "brightness_value_template", "on_command_type", "brightness_state_topic", "brightness_command_topic",
              "hs_value_template", "hs_command_template", "hs_state_topic", "hs_command_topic"},
}  # fmt: skip


def told() -> dict[tuple[str, str], dict[str, Any]]:
    """The entities of the shipped home, read back."""
    return {key: json.loads(text) for key, text in entities(shipped(), "openhab").items()}


def hubs(home: Home | None = None, **settings: Any) -> Hubs:
    """The service."""
    return Hubs(Config(home=home or shipped(), **settings))


def said(messages: Iterable[Message]) -> dict[str, str]:
    """Topics and texts."""
    return {message.topic: message.payload.decode() for message in messages}


@pytest.mark.parametrize("key", told())
def test_an_entity_has_only_keys_that_its_platform_knows(key: tuple[str, str]) -> None:
    content = told()[key]
    assert set(content) <= COMMON | ALLOWED[key[0]]
    assert content["unique_id"] == f"apartment_home_{key[1]}"


def test_every_member_of_ros_has_one_entity_but_what_none_can_show() -> None:
    assert {item for _, item in told()} == set(shipped().ros_items)
    assert len(told()) == len({item for _, item in told()})


@pytest.mark.parametrize(
    ("item", "state", "shown"),
    [("Lab_Temp", "21.5 °C", "21.5"), ("Lab_Temp", "UNDEF", "None"), ("Bedroom_Mode", "eco", "Cooler"),
     ("Bedroom_Mode", "NULL", "None"), ("Front_Door_LastOpened", "NULL", "unknown"), ("Radio_Volume", "30", "30")],
)  # fmt: skip
def test_a_template_makes_of_a_state_what_is_shown(item: str, state: str, shown: str) -> None:
    content = next(content for (_, name), content in told().items() if name == item)
    assert TEMPLATES.from_string(content["value_template"]).render(value=state) == shown


def test_words_of_an_option_become_its_state_again() -> None:
    content = told()["select", "Bedroom_Mode"]
    back = [TEMPLATES.from_string(content["command_template"]).render(value=words) for words in content["options"]]
    assert back == list(shipped().items["Bedroom_Mode"].options)


def test_entities_are_said_once_and_again_when_home_assistant_starts() -> None:
    service = hubs()
    first = said(service.tick(NOW))
    assert len(first) == len(told())
    assert said(service.tick(NOW)) == {}
    assert list(service.handle(topics.HOMEASSISTANT_STATUS.message("online"), NOW)) == []
    assert said(service.tick(NOW)) == first


def test_an_item_that_went_is_taken_away_and_nothing_of_others() -> None:
    service = hubs()
    gone = topics.HOMEASSISTANT_ITEM.message('{"unique_id": "apartment_home_Old"}', platform="switch", item="Old")
    other = topics.HOMEASSISTANT_ITEM.message('{"unique_id": "zigbee_7"}', platform="switch", item="zigbee")
    for message in (gone, other):
        assert list(service.handle(message, NOW)) == []
    messages = said(service.tick(NOW))
    assert messages["homeassistant/switch/Old/config"] == ""
    assert "homeassistant/switch/zigbee/config" not in messages


def test_switched_off_everything_is_taken_away() -> None:
    service = hubs(homeassistant=False)
    kept = topics.HOMEASSISTANT_ITEM.message(entities(shipped(), "openhab")["light", "Kitchen_Light"], platform="light",
                                             item="Kitchen_Light")  # fmt: skip
    assert list(service.handle(kept, NOW)) == []
    assert said(service.tick(NOW)) == {"homeassistant/light/Kitchen_Light/config": ""}


def test_homie_describes_a_node_per_item_and_is_ready_last() -> None:
    messages = list(hubs(homie=True, homeassistant=False).tick(NOW))
    texts = said(messages)
    assert (messages[0].payload, messages[-1].topic, messages[-1].payload) == (
        b"init",
        "homie/apartment/$state",
        b"ready",
    )
    assert texts["homie/apartment/$homie"] == "4.0.0"
    nodes = texts["homie/apartment/$nodes"].split(",")
    assert len(nodes) == len(set(nodes)) == len(shipped().ros_items)
    assert texts["homie/apartment/kitchen-light/value/$datatype"] == "boolean"
    assert texts["homie/apartment/bedroom-setpoint/value/$format"] == "5:30"
    assert texts["homie/apartment/lab-temp/value/$unit"] == "°C"
    assert texts["homie/apartment/lab-temp/value/$settable"] == "false"
    assert all(message.retain for message in messages)


@pytest.mark.parametrize(
    ("item", "state", "topic", "value"),
    [("Kitchen_Light", "ON", "kitchen-light", "true"), ("Lab_Temp", "21.50 °C", "lab-temp", "21.5"),
     ("Front_Door", "OPEN", "front-door", "OPEN"), ("Lamp_Color", "120,100,50", "lamp-color", "120,100,50")],
)  # fmt: skip
def test_homie_says_states_in_its_own_form(item: str, state: str, topic: str, value: str) -> None:
    service = hubs(homie=True)
    assert said(service.handle(HOME_STATE.message(state, item=item), NOW)) == {f"homie/apartment/{topic}/value": value}


def test_homie_has_no_word_for_an_unknown_state() -> None:
    assert list(hubs(homie=True).handle(HOME_STATE.message("UNDEF", item="Lab_Temp"), NOW)) == []


def test_what_homie_wants_becomes_a_command() -> None:
    service = hubs(homie=True)
    wish = HOMIE_SET.message("true", device="apartment", node="kitchen-light", property="value")._replace(received=NOW)
    assert said(service.handle(wish, NOW)) == {"home/Kitchen_Light/command": "ON"}
    nobody = HOMIE_SET.message("true", device="apartment", node="nobody", property="value")._replace(received=NOW)
    with pytest.raises(BadMessage, match="nobody"):
        list(service.handle(nobody, NOW))


@pytest.mark.parametrize("service", ["openhab/status", "+", "Open HAB"])
def test_the_service_behind_the_home_is_one_name_of_a_topic(service: str) -> None:
    with pytest.raises(ValueError, match="home_service"):
        hubs(home_service=service)
