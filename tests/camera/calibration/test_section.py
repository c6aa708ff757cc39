"""The mount gets into the configuration's text, and nothing else in it changes."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from services.camera.calibration.section import settings, with_mount
from services.vision.frames import Mount

CONFIG = Path(__file__).parents[3] / "config"
FOUND = settings(Mount((1.23456, 2.0, 2.5), "ceiling", 12.3456, (0.5, -0.25), (0.006, 0.078), tilt_zero_deg=0.3))
BESIDE = {"cameras": {"ip1": {"url": "http://192.0.2.9", "mount": {"position": [1, 2, 3], "kind": "ceiling"}}}}


@pytest.mark.parametrize("name", ["simulated.yaml", "apartment.yaml"])
def test_the_mount_of_a_shipped_configuration_is_replaced_and_every_other_line_stays(name: str) -> None:
    text = (CONFIG / name).read_text(encoding="utf-8")
    fresh = with_mount(text, "ip1", FOUND)
    old, new = yaml.safe_load(text), yaml.safe_load(fresh)
    assert new["cameras"]["ip1"].pop("mount") == FOUND
    old["cameras"]["ip1"].pop("mount", None)
    assert new == old
    lost = set(text.splitlines()) - set(fresh.splitlines())
    assert all(line.split(":")[0].strip() in FOUND for line in lost)


def test_comments_beside_values_stay() -> None:
    section = "    mount:\n      # measured in May\n      yaw_deg: 3.0   # about north\n    frames: 4\n"
    text = f"cameras:\n  ip1:\n{section}home: x\n"
    fresh = with_mount(text, "ip1", FOUND)
    assert "      # measured in May\n" in fresh
    assert "      yaw_deg: 12.346   # about north\n" in fresh
    assert yaml.safe_load(fresh)["cameras"]["ip1"] == {"mount": FOUND, "frames": 4}


@pytest.mark.parametrize("flow", [False, None])
def test_lists_may_be_written_either_way(flow: bool | None) -> None:
    fresh = with_mount(yaml.safe_dump(BESIDE, default_flow_style=flow), "ip1", FOUND)
    assert yaml.safe_load(fresh)["cameras"]["ip1"] == {"url": "http://192.0.2.9", "mount": FOUND}


def test_a_camera_without_a_mount_gets_one_and_the_next_camera_stays_as_it_is() -> None:
    text = "cameras:\n  ip1:\n    url: http://192.0.2.9\n\n  ip2:\n    url: http://192.0.2.10\n# the end\n"
    fresh = with_mount(text, "ip1", FOUND)
    assert yaml.safe_load(fresh)["cameras"] == {
        "ip1": {"url": "http://192.0.2.9", "mount": FOUND},
        "ip2": {"url": "http://192.0.2.10"},
    }
    assert fresh.endswith("# the end\n")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("home: x\n", "cameras"),
        ("cameras:\n  ip2:\n    url: x\n", "ip1"),
        ("cameras: {ip1: {url: x}}\n", "lines of its own"),
        ("cameras:\n  ip1:\n    mount: {position: [1, 2, 3]}\n", "lines of its own"),
    ],
)
def test_a_text_that_does_not_lend_itself_is_refused(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        with_mount(text, "ip1", FOUND)
