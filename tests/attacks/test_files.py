"""Configuration files that are made to fill the memory or to go round for ever."""

from __future__ import annotations

from pathlib import Path

import pytest

from services import document
from services.camera.brands.dahua.events import read_event
from services.config import load
from services.errors import ConfigError

LAUGHS = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 10)}]\n" for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        pytest.param(LAUGHS, "values at most", id="aliases of aliases: 10^9 values in nine lines"),
        pytest.param("a: &a [*a]\n", "deep at most", id="a list that contains itself"),
        pytest.param("a: &a {b: *a}\n", "deep at most", id="a mapping that contains itself"),
        pytest.param("a: " + "[" * 20_000, "got", id="twenty thousand brackets"),
        pytest.param("a: " + "[" * 60 + "]" * 60, "deep at most", id="sixty lists"),
        pytest.param("a: !!python/object/apply:os.system ['touch /tmp/x']\n", "", id="a command as a tag"),
        pytest.param("? [a, b]\n: c\n", "expected a plain key", id="a list as a key"),
        pytest.param("# " + "x" * document.LARGEST, "bytes", id="a long file"),
    ],
)
def test_a_file_that_means_harm_is_a_fault_with_its_line(tmp_path: Path, text: str, told: str) -> None:
    file = tmp_path / "apartment.yaml"
    file.write_text(text)
    read = document.read(file)
    if told:
        assert read.faults
        assert told in read.faults[0]
        assert read.faults[0].startswith(f"{file}:")
    with pytest.raises(ConfigError):
        load(file)


def test_an_event_of_a_camera_with_json_without_a_bottom_is_no_event() -> None:
    text = b"Code=VideoMotion;action=Start;index=0;data={" + b'"a":[' * 100_000 + b"}"
    assert read_event(text, whole=True) is None
