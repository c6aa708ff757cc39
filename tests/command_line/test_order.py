"""`apartment order`: what is sent, how long it waits, and what its exit code tells; a camera played by the test."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import Any

import pytest

from services.client import Client
from services.command_line.order import value_of
from tests.command_line.playing import CAMERAS, answer, taken
from tests.command_line.terminal import apartment, done


def played(
    config: Path, camera: Client, words: list[str], *states: str, error: str | None = None
) -> tuple[dict[str, Any], int, list[str]]:
    """The order that such a command gives, its exit code and what it prints, answered with these states."""
    with apartment(config, *words) as terminal:
        order = taken(camera, words[2])
        for state in states:
            answer(camera, words[2], order, state, error if state == states[-1] else None)
        camera.pump()
        return order, terminal.ended(), terminal.rest()


def test_each_answer_is_told_and_the_last_one_is_the_exit_code(config: Path, camera: Client) -> None:
    words = ["order", "ip1", "Goto", "Kitchen"]
    order, code, lines = played(config, camera, words, "accepted", "running", "done")
    assert (order["value"], order["by"]) == ("Kitchen", "human")
    assert (code, lines) == (0, ["Goto: accepted", "Goto: running", "Goto: done"])
    camera.forget()
    _, code, lines = played(config, camera, words, "refused", error="expected [Kitchen]")
    assert (code, lines) == (1, ["Goto: refused (expected [Kitchen])"])


def test_as_data_it_is_the_last_answer_alone(config: Path, camera: Client) -> None:
    _, code, lines = played(config, camera, ["order", "ip1", "Flip", "ON", "--json"], "accepted", "running", "done")
    told = json.loads("\n".join(lines))
    assert (code, told["key"], told["value"], told["state"]) == (0, "Flip", "ON", "done")


def test_a_json_object_is_sent_as_one(config: Path, camera: Client) -> None:
    order, _, _ = played(config, camera, ["order", "ip1", "Scan", '{"targets": [582]}'], "done")
    assert order["value"] == {"targets": [582]}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (' {"targets": [582], "places": ["Sofa"]}', {"targets": [582], "places": ["Sofa"]}),
        ("{}", {}),
        ("", ""),
        ("582", "582"),
        ("true", "true"),
        ("[582, 17]", "[582, 17]"),
        ('"Kitchen"', '"Kitchen"'),
        ("{Kitchen}", "{Kitchen}"),
        ('{"targets": [582]', '{"targets": [582]'),
        ('{"seconds": NaN}', '{"seconds": NaN}'),
        ('{"seconds": 1e999}', '{"seconds": 1e999}'),
        ('{"a":' * 5000, '{"a":' * 5000),
    ],
)
def test_only_what_is_a_json_object_is_no_text(text: str, value: object) -> None:
    assert value_of(text) == value


@pytest.mark.parametrize(
    "words",
    [
        ["order", "attic", "Goto", "Kitchen"],
        ["scan", "attic", "--target", "582"],
        ["calibrate", "zoom", "attic", "--yes-move"],
        ["calibrate", "ptz", "attic", "--yes-move"],
    ],
)
def test_a_camera_that_there_is_none_of_is_wrong_usage_and_those_that_there_are_are_named(
    words: list[str], tmp_path: Path
) -> None:
    config = tmp_path / "apartment.yaml"
    home = Path(__file__).parents[2] / "config" / "home.yaml"
    config.write_text(f"bus: {{port: 9}}\nhome: {home}\n{CAMERAS}", encoding="utf-8")
    code, text = done(config, *words)
    assert (code, text) == (2, f"{config}:1: cameras: expected one of ip1, got 'attic'\n")


def test_it_can_be_left_with_ctrl_c_while_the_order_goes_on(config: Path, camera: Client) -> None:
    with apartment(config, "order", "ip1", "Reboot", "True") as terminal:
        answer(camera, "Reboot", taken(camera, "Reboot"), "running")
        camera.pump()
        assert terminal.line() == "Reboot: running"
        assert terminal.ended(signal.SIGINT) == 130
