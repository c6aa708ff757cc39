"""A mission in virtual time, and the row that the database has of it."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path

from services.payloads.robot import MissionResult
from services.storage import open_storage, reading
from services.topics import MISSION_RESULT, read
from tests.trials import virtual_flat

LATEST = 2**31 * 1_000_000


def test_a_mission_is_a_row_with_its_end_and_its_story(tmp_path: Path) -> None:
    def one_frame_a_place(config: Path) -> None:
        config.write_text(config.read_text().replace("targets: [582]", "targets: [582]\n    frames: 1"))

    with virtual_flat(tmp_path, one_frame_a_place) as flat:
        flat.client.say("mission/tiago/order", json.dumps({"find": 582, "id": "stored"}))
        ends: list[MissionResult] = []

        def over() -> bool:
            said = (one for one in flat.client.pump() if one.topic == MISSION_RESULT.name(robot="tiago"))
            ends.extend(read(one, flat.now).payload for one in said)
            return bool(ends)

        assert flat.until(over, 600.0)
        flat.until(lambda: False, 1.0)
    with closing(open_storage(f"sqlite:///{tmp_path}/bus.db")) as storage:
        (row,) = reading.missions(storage, 0, LATEST, 10)
    (end,) = ends
    assert (row.mission, row.robot, row.marker, row.state) == ("stored", "tiago", 582, "found")
    assert (row.place, row.reason, row.seen_by) == (end.place, end.reason, "tiago")
    assert end.position is not None
    assert (row.x, row.y, row.z) == (end.position.x, end.position.y, end.position.z)
    assert row.ended is not None
    assert abs((row.ended - row.started) / 1e6 - end.elapsed_s) < 0.2
    assert json.loads(row.story or "") == [[one.at_s, one.state, one.text] for one in end.story]
