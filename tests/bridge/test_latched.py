"""Which first words are old: those of who was there before us, but for one whose name says that it has just begun."""

from __future__ import annotations

from typing import Any

import pytest

from services.bridge.latched import Latched
from services.ros.master import Master

TOPIC = "/iot_command"
T = 1_769_839_200.0


class Known(Master):
    """A master that knows one publisher."""

    def call(self, method: str, *arguments: Any) -> Any:
        assert method == "getSystemState"
        return [[[TOPIC, [self.caller]], ["/other", ["/nobody"]]], [], []]


def header(publisher: str, latching: str = "1") -> dict[str, Any]:
    return {"callerid": publisher, "latching": latching}


def met(publisher: str) -> Latched:
    latched = Latched()
    latched.look(Known("http://localhost:1", publisher))
    latched.registered(50.0)
    return latched


def is_old(latched: Latched, topic: str, of: dict[str, Any], *, after_s: float = 0.1) -> bool:
    return latched.is_old(topic, of, 50.0 + after_s, T)


@pytest.mark.parametrize(
    ("began_s_ago", "old"), [(1.0, False), (-2.0, False), (60.0, True), (-3600.0, True), (None, True)]
)
def test_what_began_before_us_is_old_unless_its_name_says_otherwise(began_s_ago: float | None, old: bool) -> None:
    began = f"{1000 * (T - (began_s_ago or 0)):.0f}"
    publisher = "/robot" if began_s_ago is None else f"/rostopic_4711_{began}"
    assert is_old(met(publisher), TOPIC, header(publisher)) is old


def test_only_the_first_word_of_a_latching_publisher_that_was_there_is_old() -> None:
    latched, known = met("/robot"), header("/robot")
    assert is_old(latched, TOPIC, known)
    assert not is_old(latched, TOPIC, known), "what it says from then on is said now"
    assert not is_old(latched, TOPIC, header("/robot", latching="0"))
    assert not is_old(latched, TOPIC, header("/late"))
    assert not is_old(latched, "/other", header("/robot"))


def test_after_the_first_moments_a_first_word_is_one_that_is_said_now() -> None:
    assert not is_old(met("/robot"), TOPIC, header("/robot"), after_s=6.0)
