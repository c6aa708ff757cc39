"""When a state is stored, as a table; and who gets its last state back."""

from __future__ import annotations

import pytest

from services.persistence import strategies
from services.persistence.strategies import Restore, Value

CHANGE, UPDATE, NONE = ("everyChange",), ("everyUpdate",), ()
ON: Value = (1.0, "ON")
OFF: Value = (0.0, "OFF")
UNDEF: Value = (None, "UNDEF")

WANTED = [
    # strategies, what came, what was last, retained, stored
    (CHANGE, ON, None, False, True),
    (CHANGE, ON, OFF, False, True),
    (CHANGE, ON, ON, False, False),
    (CHANGE, UNDEF, ON, False, True),
    (CHANGE, UNDEF, UNDEF, False, False),
    (CHANGE, (21.5, None), (21.5, None), False, False),
    (CHANGE, (50.0, "120,100,50"), (50.0, "240,100,50"), False, True),
    (UPDATE, ON, ON, False, True),
    (UPDATE, ON, OFF, False, True),
    ((*CHANGE, *UPDATE), ON, OFF, False, True),
    ((*CHANGE, *UPDATE), ON, ON, False, True),
    (NONE, ON, OFF, False, False),
    (("restoreOnStartup",), ON, OFF, False, False),
    # the broker's snapshot at a (re)connect
    (CHANGE, ON, ON, True, False),
    (UPDATE, ON, ON, True, False),
    (UPDATE, ON, OFF, True, True),
    (UPDATE, ON, None, True, True),
    (NONE, ON, None, True, False),
]


@pytest.mark.parametrize(("names", "value", "last", "retained", "stored"), WANTED)
def test_a_state_is_stored_as_its_strategies_say(
    names: tuple[str, ...], value: Value, last: Value | None, retained: bool, stored: bool
) -> None:
    (line,) = strategies.rule(names).lines
    assert line.wants(changed=value != last, retained=retained) is stored


def waiting(*items: str) -> Restore:
    """On its second connection."""
    restore = Restore(items, 2.0)
    restore.begin("m1")
    restore.begin("m2")
    return restore


class TestRestore:
    def test_it_waits_for_its_mark_and_then_a_while(self) -> None:
        restore = waiting("Light")
        assert restore.due is None
        assert restore.missing(1e9) == []
        assert restore.mark == "m2"
        for older in ("m1", "", None):
            restore.heard(older, 50.0)
        assert restore.due is None
        restore.heard("m2", 100.0)
        restore.heard("m2", 101.0)
        assert restore.mark is None
        assert restore.due == 102.0
        assert restore.missing(101.9) == []
        assert restore.missing(102.0) == ["Light"]

    def test_a_connection_that_broke_meanwhile_is_waited_for_anew(self) -> None:
        restore = waiting("Light")
        restore.heard("m2", 100.0)
        restore.begin("m3")
        assert restore.missing(1e9) == []
        restore.heard("m2", 200.0)
        assert restore.missing(1e9) == []
        restore.heard("m3", 200.0)
        assert restore.missing(202.0) == ["Light"]

    def test_it_happens_once(self) -> None:
        restore = waiting("Light")
        restore.heard("m2", 0.0)
        assert restore.missing(2.0) == ["Light"]
        restore.begin("m3")
        assert restore.mark is None
        restore.heard("m3", 3.0)
        assert restore.due is None
        assert restore.missing(9.0) == []

    def test_items_that_the_broker_has_are_left_alone(self) -> None:
        restore = waiting("Light", "Door")
        assert not restore.saw("Light", "ON")
        restore.heard("m2", 0.0)
        assert restore.missing(2.0) == ["Door"]

    def test_what_is_handed_out_again_tells_nothing_of_what_the_broker_has(self) -> None:
        restore = waiting("Light", "Door")
        restore.saw("Light", "ON", again=True)
        restore.saw("Door", "OPEN", again=True)
        restore.saw("Door", "OPEN")
        restore.heard("m2", 0.0)
        assert restore.missing(2.0) == ["Light"]

    def test_the_echo_of_a_restored_state_is_known_once(self) -> None:
        restore = Restore(["Light"], 0.0)
        restore.says("Light", "ON")
        assert restore.saw("Light", "ON")
        assert not restore.saw("Light", "ON")

    def test_another_state_is_no_echo(self) -> None:
        restore = Restore(["Light"], 0.0)
        restore.says("Light", "ON")
        assert not restore.saw("Light", "OFF")
