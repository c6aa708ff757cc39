"""The simulated home, driven by hand in its own time: no bus, no sleeping."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
import yaml

from services.apartment.home import Home
from services.bus import Message
from services.errors import BadMessage
from services.simulators.home import Config, SimulatedHome, start
from services.states import check_state, moment, number

NOON = 1_769_857_200.0  # 2026-01-31 12:00 in Madrid
EXAMPLE = Home.model_validate(yaml.safe_load((Path(__file__).parents[2] / "config" / "home.yaml").read_text("utf-8")))
Said = list[tuple[float, str, str]]  # when, item, state


class Flat:
    """A simulated home and what it has said so far."""

    def __init__(self, home: Home = EXAMPLE, now: float = NOON, **settings: Any) -> None:
        self.now = now
        self.said: Said = []
        self.states: dict[str, str] = {}
        with start(Config(home=home, **settings), lambda message: None) as service:
            self.service: SimulatedHome = service
        self.hear(self.service.tick(now))

    def hear(self, messages: Any) -> None:
        for message in messages:
            assert message.retain
            item = message.topic.removeprefix("home/").removesuffix("/state")
            text = message.payload.decode()
            assert self.states.get(item) != text, f"{item} said {text} twice"
            self.states[item] = text
            self.said.append((self.now, item, text))

    def send(self, item: str, text: str, kind: str = "command") -> None:
        self.hear(self.service.handle(Message(f"home/{item}/{kind}", text.encode(), received=self.now), self.now))

    def live(self, seconds: float) -> None:
        """Ticks whenever it is due, as the runner does."""
        end = self.now + seconds
        while self.service.due is not None and self.service.due <= end:
            self.now = max(self.now, self.service.due)
            self.hear(self.service.tick(self.now))
        self.now = end

    def history(self, item: str) -> list[str]:
        return [text for _, name, text in self.said if name == item]


def lamp(**fields: Any) -> Home:
    """A home of one lamp in one room, or of another item under that name."""
    fields = {"type": "Switch", "label": "Lamp", "thing": "lamp", **fields}
    return Home.model_validate(
        {
            "rooms": {"hall": {"label": "Hall"}},
            "things": {"lamp": {"label": "Lamp", "room": "hall"}},
            "items": {"Lamp": fields},
        }
    )


def test_at_the_start_every_item_says_its_state_once() -> None:
    flat = Flat()
    assert sorted(item for _, item, _ in flat.said) == sorted(EXAMPLE.items)
    assert flat.states["Kitchen_Light"] == "OFF"
    assert flat.states["Bedroom_Setpoint"] == "21 °C"
    assert flat.states["ROS_Status"] == "NULL"


def test_a_switch_answers_a_command_with_its_state() -> None:
    flat = Flat()
    flat.send("Kitchen_Light", "ON")
    assert flat.states["Kitchen_Light"] == "ON"
    flat.send("Kitchen_Light", "ON")
    flat.live(2)
    assert flat.history("Kitchen_Light") == ["OFF", "ON"]


def test_without_autoupdate_only_the_device_confirms_and_it_takes_its_time() -> None:
    flat = Flat()
    flat.send("Kitchen_Plug", "ON")
    assert flat.states["Kitchen_Plug"] == "OFF"
    flat.live(2)
    confirmed = [when for when, item, text in flat.said if (item, text) == ("Kitchen_Plug", "ON")]
    assert [0.2 <= when - NOON <= 0.8 for when in confirmed] == [True]


def test_power_follows_the_plug() -> None:
    flat = Flat()
    assert flat.states["Kitchen_Plug_Power"] == "0.4 W"
    flat.send("Kitchen_Plug", "ON")
    flat.live(1)
    assert (number("Number:Power", flat.states["Kitchen_Plug_Power"]) or 0) > 100
    flat.send("Kitchen_Plug", "OFF")
    flat.live(1)
    assert flat.states["Kitchen_Plug_Power"] == "0.4 W"


def test_two_quick_commands_end_with_the_second_and_without_flicker() -> None:
    flat = Flat()
    flat.send("Kitchen_Light", "ON")
    flat.now += 0.1
    flat.send("Kitchen_Light", "OFF")
    flat.live(2)
    assert flat.history("Kitchen_Light") == ["OFF", "ON", "OFF"]


@pytest.mark.parametrize(
    ("item", "commands", "state"),
    [
        ("Hall_Dimmer", ["ON"], "100"),
        ("Hall_Dimmer", ["ON", "OFF"], "0"),
        ("Hall_Dimmer", ["35"], "35"),
        ("Hall_Dimmer", ["35", "INCREASE", "INCREASE"], "55"),
        ("Hall_Dimmer", ["5", "DECREASE"], "0"),
        ("Hall_Dimmer", ["95", "INCREASE"], "100"),
        ("Radio_Volume", ["INCREASE"], "5"),
        ("Lamp_Color", ["120,100,50"], "120,100,50"),
        ("Lamp_Color", ["120,100,50", "OFF"], "120,100,0"),
        ("Lamp_Color", ["120,100,50", "ON"], "120,100,100"),
        ("Lamp_Color", ["120,100,50", "30"], "120,100,30"),
        ("Lamp_Color", ["120,100,50", "DECREASE"], "120,100,40"),
        ("Radio_Player", ["PLAY"], "PLAY"),
        ("Radio_Player", ["NEXT"], "PLAY"),
        ("Radio_Player", ["PLAY", "FASTFORWARD"], "FASTFORWARD"),
        ("Bedroom_Setpoint", ["23.5"], "23.5 °C"),
        ("Bedroom_Setpoint", ["23.3 °C"], "23.5 °C"),
        ("Bedroom_Setpoint", ["68 °F"], "20 °C"),
        ("Bedroom_Setpoint", ["2.05e1"], "20.5 °C"),
        ("Bedroom_Mode", ["eco"], "eco"),
        ("Home_Location", ["41.38,2.11,0"], "41.38,2.11"),
        ("ROS_Status", ["updates: 5"], "updates: 5"),
        ("Bedroom_Shutter", ["DOWN"], "100"),
        ("Bedroom_Shutter", ["MOVE"], "100"),
        ("Bedroom_Shutter", ["30"], "30"),
        ("Kitchen_Light", ["ON", "REFRESH"], "ON"),
    ],
)
def test_a_command_leads_to_the_state(item: str, commands: list[str], state: str) -> None:
    flat = Flat()
    for command in commands:
        flat.send(item, command)
        flat.live(20)
    assert flat.states[item] == state
    assert flat.service.counters["commands"] == len(commands)


@pytest.mark.parametrize(
    ("item", "command", "why"),
    [
        ("Front_Door", "OPEN", "use `set`"),
        ("Hall_Motion", "ON", "read only"),
        ("Lab_Temp", "21.0 °C", "read only"),
        ("Front_Door_LastOpened", "2026-01-31T07:05:00.000+0100", "read only"),
        ("Nothing", "ON", "no such item"),
        ("Kitchen_Light", "TOGGLE", "expected one of ON, OFF"),
        ("Kitchen_Light", "UNDEF", "never a command"),
        ("Hall_Dimmer", "101", "expected 0 to 100"),
        ("Bedroom_Setpoint", "4.5", "expected 5 to 30"),
        ("Bedroom_Setpoint", "100 °C", "expected 5 to 30"),
        ("Bedroom_Setpoint", "20 W", "expected a value in °C"),
        ("Bedroom_Mode", "sauna", "expected one of manual"),
    ],
)
def test_what_the_device_cannot_do_is_refused_counted_and_changes_nothing(item: str, command: str, why: str) -> None:
    flat = Flat()
    before = dict(flat.states)
    with pytest.raises(BadMessage, match=why) as caught:
        flat.send(item, command)
    assert str(caught.value).startswith(f"home/{item}/command: ")
    flat.live(1)
    assert flat.states == before
    assert flat.service.counters == {"commands": 0, "updates": 0, "refused": 1}


@pytest.mark.parametrize(("age", "retain"), [(6.0, False), (0.0, True)])
def test_a_late_or_retained_command_is_refused(age: float, retain: bool) -> None:
    flat = Flat()
    late = Message("home/Kitchen_Light/command", b"ON", retain=retain, received=flat.now - age)
    with pytest.raises(BadMessage):
        flat.service.handle(late, flat.now)


def test_a_shutter_tells_where_it_is_on_its_way() -> None:
    flat = Flat()
    flat.send("Bedroom_Shutter", "DOWN")
    assert flat.history("Bedroom_Shutter") == ["0"]
    flat.live(20)
    way = [int(text) for text in flat.history("Bedroom_Shutter")]
    assert way == sorted(way)
    assert way[-1] == 100
    assert len(way) > 12


def test_stop_holds_a_shutter_half_way_and_up_brings_it_back() -> None:
    flat = Flat()
    flat.send("Bedroom_Shutter", "DOWN")
    flat.live(7.5)
    flat.send("Bedroom_Shutter", "STOP")
    flat.live(60)
    assert flat.states["Bedroom_Shutter"] == "50"
    flat.send("Bedroom_Shutter", "UP")
    flat.live(8.6)
    assert flat.states["Bedroom_Shutter"] == "0"


def test_a_new_goal_turns_a_moving_shutter_round() -> None:
    flat = Flat()
    flat.send("Bedroom_Shutter", "DOWN")
    flat.live(9)
    flat.send("Bedroom_Shutter", "20")
    flat.live(20)
    assert flat.states["Bedroom_Shutter"] == "20"


@pytest.mark.parametrize(
    ("item", "text", "state"),
    [
        ("Front_Door", "OPEN", "OPEN"),
        ("Lab_Temp", "30", "30 °C"),
        ("Lab_Temp", "UNDEF", "UNDEF"),
        ("Hall_Dimmer", "ON", "100"),
        ("Bedroom_Shutter", "DOWN", "100"),
        ("Front_Door_LastOpened", "2026-01-31 07:05", "2026-01-31T07:05:00.000+0100"),
        ("Front_Door_LastOpened", "1769839500", "2026-01-31T07:05:00.000+0100"),
        ("ROS_Status", "NULL", "NULL"),
        ("ROS_Status", "ok", "ok"),
    ],
)
def test_an_update_is_believed_at_once(item: str, text: str, state: str) -> None:
    flat = Flat()
    flat.send(item, text, "set")
    assert flat.states[item] == state
    assert flat.service.counters["updates"] == 1


@pytest.mark.parametrize(("item", "text"), [("Front_Door", "AJAR"), ("Lab_Temp", "20 W"), ("Nothing", "ON")])
def test_an_update_that_is_no_state_is_refused(item: str, text: str) -> None:
    flat = Flat()
    with pytest.raises(BadMessage):
        flat.send(item, text, "set")
    assert flat.service.counters["refused"] == 1


def test_an_update_does_not_reach_the_device() -> None:
    flat = Flat()
    flat.send("Kitchen_Light", "ON", "set")
    flat.send("Kitchen_Light", "REFRESH")
    flat.live(1)
    assert flat.history("Kitchen_Light") == ["OFF", "ON", "OFF"]


def test_every_state_is_legal_and_said_only_when_it_changes() -> None:
    flat = Flat()
    flat.send("Kitchen_Plug", "ON")
    flat.live(6 * 3600)
    assert len(flat.said) > 1000
    for _, item, text in flat.said:
        check_state(EXAMPLE.items[item].type, text)


def test_a_day_of_temperatures_is_physical() -> None:
    flat = Flat()
    flat.live(86400)
    outside = [number("Number", text) or 0 for text in flat.history("Outdoor_Temp")]
    assert -15 < min(outside) < max(outside) < 20  # a day in January
    assert max(outside) - min(outside) > 4  # day and night
    rooms = ("Kitchen_Temp", "Lab_Temp", "Bedroom_Temp", "Bathroom_Temp")
    for room in rooms:
        curve = [number("Number", text) or 0 for text in flat.history(room)]
        assert 16 < min(curve) < max(curve) < 24
        assert max(abs(later - earlier) for earlier, later in itertools.pairwise(curve)) < 0.15
    for room in ("Lab_Humidity", "Bathroom_Humidity"):
        assert all(15 < (number("Number", text) or 0) < 80 for text in flat.history(room))


def test_a_higher_setpoint_warms_the_room_and_no_heating_cools_it() -> None:
    flat = Flat()
    flat.send("Bedroom_Setpoint", "24")
    flat.live(4 * 3600)
    warm = number("Number", flat.states["Bedroom_Temp"]) or 0
    assert 23 < warm < 25
    flat.send("Bedroom_Mode", "off")
    flat.live(4 * 3600)
    assert (number("Number", flat.states["Bedroom_Temp"]) or 0) < warm - 2


def test_a_day_has_visitors_and_the_door_says_when_it_opened() -> None:
    flat = Flat()
    flat.live(86400)
    assert 10 < flat.history("Hall_Motion").count("ON") < 300
    opened = [when for when, item, text in flat.said if (item, text) == ("Front_Door", "OPEN")]
    assert 2 < len(opened) < 100
    told = [moment(text).timestamp() for text in flat.history("Front_Door_LastOpened")[1:]]
    assert told == [pytest.approx(when, abs=0.002) for when in opened]
    assert flat.history("Front_Door")[1:3] == ["OPEN", "CLOSED"]


def test_motion_and_door_go_off_again() -> None:
    flat = Flat()
    flat.live(86400)
    for item, on, longest in (("Hall_Motion", "ON", 600.0), ("Front_Door", "OPEN", 120.0)):
        story = [(when, text) for when, name, text in flat.said if name == item]
        spans = [later - when for (when, text), (later, _) in itertools.pairwise(story) if text == on]
        assert spans
        assert max(spans) < longest


def test_nights_are_quiet() -> None:
    flat = Flat()
    flat.live(2 * 86400)
    hours = [datetime.fromtimestamp(when, EXAMPLE.zone).hour for when, item, text in flat.said if text == "ON"]
    assert sum(hour < 6 for hour in hours) < sum(6 <= hour < 12 for hour in hours) / 3


def by_due(flat: Flat) -> None:
    flat.live(3600)


def by_the_second(flat: Flat) -> None:
    for _ in range(3600):
        flat.now += 1
        flat.hear(flat.service.tick(flat.now))


def at_once(flat: Flat) -> None:
    flat.now += 3600
    flat.hear(flat.service.tick(flat.now))


@pytest.mark.parametrize("way", [by_the_second, at_once])
def test_the_same_seed_says_the_same_however_often_it_is_asked(way: Callable[[Flat], None]) -> None:
    one, other = Flat(seed=7), Flat(seed=7)
    by_due(one)
    way(other)
    assert [said[1:] for said in one.said] == [said[1:] for said in other.said]


def test_another_seed_is_another_day() -> None:
    one, other = Flat(seed=1), Flat(seed=2)
    by_due(one)
    by_due(other)
    assert [said[1:] for said in one.said] != [said[1:] for said in other.said]


def test_with_speed_an_hour_takes_a_minute_and_shutters_hurry() -> None:
    slow, fast = Flat(), Flat(speed=60)
    slow.live(3600)
    fast.live(60)
    assert [said[1:] for said in slow.said] == [said[1:] for said in fast.said]
    fast.send("Bedroom_Shutter", "DOWN")
    fast.live(0.3)
    assert fast.states["Bedroom_Shutter"] == "100"


@pytest.mark.parametrize("jump", [-86400.0 * 365, 86400.0 * 365 * 50])
def test_a_clock_that_is_set_does_not_stop_the_home_or_keep_it_busy(jump: float) -> None:
    flat = Flat()
    flat.live(60)
    flat.now += jump
    flat.hear(flat.service.tick(flat.now))
    before = len(flat.said)
    flat.live(1800)
    assert 10 < len(flat.said) - before < 1000
    flat.send("Kitchen_Plug", "ON")
    flat.live(1)
    assert flat.states["Kitchen_Plug"] == "ON"


def test_a_command_in_the_first_turn_comes_after_the_snapshot() -> None:
    with start(Config(home=EXAMPLE), lambda message: None) as service:
        said = list(service.handle(Message("home/Kitchen_Light/command", b"ON", received=NOON), NOON))
    assert [message.payload for message in said if message.topic == "home/Kitchen_Light/state"] == [b"OFF", b"ON"]
    assert service.due is not None


@pytest.mark.parametrize(
    ("fields", "first"),
    [
        ({"type": "Contact"}, "CLOSED"),
        ({"type": "Number"}, "0"),
        ({"type": "Number", "range": {"min": 3, "max": 9}}, "3"),
        ({"type": "Number:Temperature", "unit": "°F", "range": {"min": 40, "max": 90}}, "69.8 °F"),
        ({"type": "Number:Temperature"}, "21 °C"),
        ({"type": "Location"}, "NULL"),
        ({"type": "Image"}, "NULL"),
        ({"type": "Call"}, "NULL"),
        ({"type": "DateTime"}, "NULL"),
        ({"type": "Switch", "thing": None}, "NULL"),
    ],
)
def test_any_home_will_do(fields: dict[str, Any], first: str) -> None:
    flat = Flat(lamp(**fields))
    assert flat.states == {"Lamp": first}
    flat.live(3600)


@pytest.mark.parametrize("unit", ["hPa", "lx", "ppm", None])
def test_an_unknown_sensor_wanders_within_its_range(unit: str | None) -> None:
    flat = Flat(lamp(type="Number:Pressure", unit=unit, read_only=True, range={"min": 950, "max": 1050}))
    flat.live(3600)
    values = [number("Number", text) or 0 for text in flat.history("Lamp")]
    assert 950 <= min(values) < max(values) <= 1050


def test_an_item_without_a_device_holds_what_it_is_given() -> None:
    flat = Flat(lamp(type="Dimmer", thing=None))
    flat.send("Lamp", "40")
    flat.send("Lamp", "INCREASE")  # nobody there to do it
    assert flat.history("Lamp") == ["NULL", "40"]


def test_a_home_without_items_is_quiet() -> None:
    flat = Flat(Home(items={}))
    flat.live(3600)
    assert flat.said == []
