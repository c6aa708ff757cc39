"""What is remembered of markers, whatever comes: from clocks that are ahead, from nowhere, without an end."""

from __future__ import annotations

import pytest

from services.errors import BadMessage
from services.mission.memory import MOST, Memory, Sighting, by_camera
from services.payloads import LARGEST, ScanResult, stamp

T = 1_769_839_200.0


def test_who_believes_that_it_is_later_does_not_hide_what_is_seen_afterwards() -> None:
    memory = Memory()
    assert memory.note(Sighting("ip1", 582, "Sofa", T + 3600.0), T)
    assert memory.note(Sighting("ip1", 582, "Kitchen", T + 1.0), T + 2.0)
    assert [one.place for one in memory.told(582, T + 5.0)] == ["Kitchen"]


def test_a_place_that_no_payload_can_say_is_left_out() -> None:
    memory = Memory()
    memory.note(Sighting("tiago", 582, "Sofa", T, (1.2 * LARGEST, 0.0, 0.0)), T)
    (told,) = memory.told(582, T)
    assert (told.place, told.position) == ("Sofa", None)


def test_the_oldest_goes_when_there_are_too_many() -> None:
    memory = Memory()
    for number in range(MOST + 1):
        memory.note(Sighting(f"cam{number}", 582, "", T), T)
    assert len(memory.of(582)) == MOST
    assert "cam0" not in {one.by for one in memory.of(582)}


def test_a_camera_speaks_for_itself() -> None:
    seen = ScanResult(
        camera="ip2",
        marker=582,
        dictionary="d",
        place="",
        position=None,
        orientation=None,
        frame="apartment",
        frames=1,
        mode="bw",
        first_seen=stamp(T),
        stamp=stamp(T),
        scan="s",
    )
    assert by_camera(seen, "ip2").by == "ip2"
    with pytest.raises(BadMessage, match="camera: expected ip1"):
        by_camera(seen, "ip1")
