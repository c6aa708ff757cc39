"""What is generated passes the checker of every release of its series, whatever the home is, and can be read back."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import get_args

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from services.apartment.home import Home
from services.openhab.check import check, read_site
from services.openhab.generate import MARK, files
from services.openhab.importing import home_of
from services.openhab.lines import Setting
from services.openhab.site import Broker, BusDesign, Camera, Site
from services.openhab.versions import parse
from tests.openhab.homes import CAMERAS, homes, shipped, sized

SERIES = {
    "2.5": ["2.5"],
    "3": ["3.0", "3.2", "3.3", "3.4"],
    "4": ["4.0", "4.1", "4.2", "4.3"],
    "5": ["5.0", "5.1", "5.2"],
}
DESIGNS = get_args(BusDesign)


def faults(written: dict[str, str], release: str) -> list[str]:
    """The errors of generated files; warnings tell of names that Alexa cannot tell apart, which is the home's doing."""
    return [str(one) for one in check(written, parse(release)) if one.severity == "error"]


@pytest.mark.parametrize("series", SERIES)
@pytest.mark.parametrize("count", [12, 500])
def test_files_of_a_home_and_two_cameras_pass_every_release_of_the_series(series: str, count: int) -> None:
    for bus in DESIGNS if count == 12 else ("dsl",):
        written = files(Site(sized(count), parse(series), CAMERAS, bus=bus))
        for release in SERIES[series] if count == 12 else SERIES[series][-1:]:
            assert check(written, parse(release)) == []


@pytest.mark.parametrize("series", SERIES)
def test_the_shipped_home_passes_and_comes_back_the_same(series: str) -> None:
    for bus in DESIGNS:
        written = files(Site(shipped(), parse(series), CAMERAS, bus=bus))
        assert check(written, parse(series)) == []
        again, found = home_of(written, parse(series))
        assert (again, found) == (shipped(), [])
        assert list(again.items) == list(shipped().items)
        assert files(Site(again, parse(series), CAMERAS, bus=bus)) == written


@settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])
@given(home=homes(), series=st.sampled_from(sorted(SERIES)), bus=st.sampled_from(DESIGNS), last=st.booleans())
def test_no_home_breaks_the_files_and_every_home_comes_back(
    home: Home, series: str, bus: BusDesign, last: bool
) -> None:
    assert list(home.faults()) == []
    written = files(Site(home, parse(series), CAMERAS, bus=bus))
    assert faults(written, SERIES[series][-1 if last else 0]) == []
    again, _ = home_of(written, parse(series))
    assert again == home


def test_no_file_has_an_account_but_the_placeholder_of_the_broker() -> None:
    written = files(Site(shipped(), parse("5"), CAMERAS))
    for path, text in written.items():
        assert ("CHANGE_ME" in text) == (path == "things/apartment.things")
        assert not re.search(r"://[^/\s]*@", text)


def test_the_broker_is_told_quickly_and_surely() -> None:
    things = files(Site(shipped(), parse("5")))["things/apartment.things"]
    for wanted in ("qos=1", "reconnectTime=5000", 'birthTopic="service/openhab/status"', 'lwtMessage="offline"',
                   'shutdownTopic="service/openhab/status"', 'separator="#"'):  # fmt: skip
        assert wanted in things
    assert "birthTopic" not in files(Site(shipped(), parse("3")))["things/apartment.things"]


@pytest.mark.parametrize("series", SERIES)
def test_openhab_knows_a_broker_that_it_meets_by_tls_by_its_key(series: str) -> None:
    def bridge(broker: Broker) -> Mapping[str, Setting]:
        written = files(Site(shipped(), parse(series), broker=broker))
        assert faults(written, SERIES[series][0]) == []
        site, _ = read_site(written, parse(series))
        return next(thing.settings for thing in site.things[0][0] if thing.is_bridge)

    known = bridge(Broker("apartment.lan", 8883, True, public_key="SHA-256:0A1B"))
    assert (known["secure"], known["publickeypin"], known["publickey"]) == (True, True, "SHA-256:0A1B")
    learnt = bridge(Broker("apartment.lan", 8883, True))
    assert (learnt["secure"], learnt["publickeypin"], "publickey" in learnt) == (True, True, False)
    assert {"publickeypin", "publickey"} & bridge(Broker()).keys() == set()


def test_every_file_says_in_its_first_line_who_wrote_it() -> None:
    for text in files(Site(shipped(), parse("5"), CAMERAS)).values():
        assert MARK in text.partition("\n")[0]


def test_what_others_files_have_is_left_out() -> None:
    taken = frozenset({"Kitchen_Light", "ROS", "mqtt:broker:apartment"})
    written = files(Site(shipped(), parse("5"), taken=taken))
    assert "Switch Kitchen_Light" not in written["items/apartment.items"]
    assert "Group ROS" not in written["items/apartment.items"]
    assert "Bridge" not in written["things/apartment.things"]


def test_every_member_of_ros_is_in_the_group_and_no_other() -> None:
    home = shipped()
    text = files(Site(home, parse("5")))["items/apartment.items"]
    for name, item in home.items.items():
        line = next(line for line in text.splitlines() if re.match(rf"\S+ {name}\b", line))
        assert ("ROS)" in line) == item.ros, line


def test_a_plain_device_without_a_topic_of_commands_is_only_shown() -> None:
    def written(topics: dict[str, str]) -> dict[str, str]:
        lamp = {"type": "Switch", "label": "Lamp", "thing": "lamp", "mqtt": topics, "alexa": {}}
        thing = {"label": "Lamp", "kind": "mqtt"}
        return files(Site(Home.model_validate({"things": {"lamp": thing}, "items": {"Lamp": lamp}}), parse("5")))

    shown, steered = written({"state": "dev/lamp"}), written({"state": "dev/lamp", "command": "dev/lamp/set"})
    assert "Text item=Lamp\n" in shown["sitemaps/apartment.sitemap"]
    assert "Switch item=Lamp\n" in steered["sitemaps/apartment.sitemap"]
    assert 'readOnly="true"' in shown["items/apartment.items"]
    assert 'readOnly="true"' not in steered["items/apartment.items"]
    assert 'alexa="MotionSensor"' in shown["items/apartment.items"]
    assert 'alexa="Switch"' in steered["items/apartment.items"]


def test_a_camera_shows_its_picture_through_our_proxy_while_the_stream_is_on() -> None:
    camera = Camera("ip1", ("Kitchen",), (582,), "http://192.0.2.1:8081/camera/ip1/stream.mjpg")
    text = files(Site(shipped(), parse("5"), (camera,)))["sitemaps/apartment.sitemap"]
    assert 'url="http://192.0.2.1:8081/camera/ip1/stream.mjpg" encoding="mjpeg" visibility=[Ip1_Stream==ON]' in text


def test_the_main_ui_shows_the_picture_as_an_image_while_the_stream_is_on() -> None:
    widget = yaml.safe_load(files(Site(shipped(), parse("5"), CAMERAS))["widgets/apartment_ip1.yaml"])
    parts = widget["slots"]["default"]
    assert [(one["component"], one["config"]["item"]) for one in parts if "visible" in one["config"]] == [
        ("oh-image", "Ip1_Stream_Url")
    ]
    assert parts[0]["config"]["visible"] == "=items.Ip1_Stream.state === 'ON'"


def test_old_alexa_tags_are_for_the_second_series_only() -> None:
    assert '["Lighting"]' in files(Site(shipped(), parse("2.5")))["items/apartment.items"]
    assert '["Lighting"]' not in files(Site(shipped(), parse("3")))["items/apartment.items"]
