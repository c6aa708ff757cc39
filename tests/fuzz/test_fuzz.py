"""Three thousand messages of rubbish and three hundred requests, at the whole apartment on real parts.

`make soak PART=fuzz` sends a hundred thousand.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from services.config import load
from services.errors import BadMessage
from services.peers import Missing
from services.simulated import CONFIG
from services.topic import Kind
from services.topics import TABLE, find
from tests.fuzz import messages, requests, trials

pytestmark = [pytest.mark.mosquitto, pytest.mark.mariadb, pytest.mark.ros]
SEED, MESSAGES = 1, 3000


def test_three_thousand_messages_and_requests_stop_nobody_and_are_counted(tmp_path: Path) -> None:
    try:
        with trials.apartment(tmp_path / "apartment") as running:
            found = trials.fuzz(running, SEED, MESSAGES)
    except Missing as missing:
        pytest.skip(str(missing))
    assert found.faults == {}
    assert (found.messages, found.requests) == (MESSAGES, MESSAGES // 10)


def test_a_seed_repeats_the_rubbish() -> None:
    home = load(CONFIG / "simulated.yaml", environment={}).instances["persistence"].config.home  # type: ignore[attr-defined]
    one, same, other = (messages.Source(seed, home, ["bridge"]) for seed in (1, 1, 2))
    drawn = [one.draw() for _ in range(800)]
    assert drawn == [same.draw() for _ in range(800)] != [other.draw() for _ in range(800)]
    met = {row.pattern for message, _ in drawn for row in TABLE if row.regex.fullmatch(message.topic)}
    assert met >= {row.pattern for row in TABLE if row.pattern != "service/<service>/reload/set"}
    assert {message.qos for message, _ in drawn} == {0, 1, 2}
    commands = [message for message, _ in drawn if _is_command(message.topic)]
    assert any(message.retain for message in commands)
    asked = [requests.Source(seed, 80, ["/api/live", "/api/history/{item}"], {}) for seed in (1, 1)]
    assert [asked[0].draw() for _ in range(500)] == [asked[1].draw() for _ in range(500)]


def _is_command(topic: str) -> bool:
    try:
        return find(topic)[0].kind is Kind.COMMAND
    except BadMessage:
        return False
