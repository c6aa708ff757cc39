"""Files that are written whole."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from services.whole_file import PRIVATE, whole_file, write_private, write_whole


def mode(file: Path) -> int:
    """Who may do what with it."""
    return file.stat().st_mode & 0o777


def test_a_file_and_its_folder_appear(tmp_path: Path) -> None:
    write_whole(tmp_path / "new" / "file", "für alle")
    assert (tmp_path / "new" / "file").read_text(encoding="utf-8") == "für alle"
    assert [file.name for file in (tmp_path / "new").iterdir()] == ["file"]


def test_what_was_there_stays_until_the_end_and_after_a_fault(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("old")

    def fail() -> None:
        with whole_file(file) as output:
            output.write(b"half")
            output.flush()
            assert file.read_text() == "old"
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert file.read_text() == "old"
    assert [one.name for one in tmp_path.iterdir()] == ["file"]


def test_who_may_read_it(tmp_path: Path) -> None:
    file, secret = tmp_path / "file", tmp_path / "secret"
    write_private(secret, "x")
    assert mode(secret) == PRIVATE
    write_whole(secret, "y")
    assert mode(secret) == PRIVATE, "as it was"
    write_whole(file, "z", like=secret)
    assert mode(file) == PRIVATE


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to("real")
    write_whole(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_text() == "new"


@pytest.mark.skipif(os.geteuid() != 0, reason="nobody else may give files away")
def test_what_root_writes_belongs_to_whom_it_belonged_or_to_whom_the_folder_does(tmp_path: Path) -> None:
    somebody, other = 12345, 12346
    folder, file = tmp_path / "camera-ip1", tmp_path / "camera-ip1" / "learnt.json"
    folder.mkdir()
    os.chown(folder, somebody, somebody)
    write_whole(file, "new")
    assert (file.stat().st_uid, file.stat().st_gid) == (somebody, somebody)
    os.chown(file, other, somebody)
    write_private(file, "newer")
    assert (file.stat().st_uid, file.stat().st_gid, mode(file)) == (other, somebody, PRIVATE)
    write_whole(folder / "one" / "more" / "file", "deep")
    assert {
        path.stat().st_uid for path in (folder / "one", folder / "one" / "more", folder / "one" / "more" / "file")
    } == {somebody}


@pytest.mark.skipif(os.geteuid() != 0, reason="nobody else may give files away")
def test_what_root_makes_is_for_those_who_write_in_the_folder_and_for_nobody_else(tmp_path: Path) -> None:
    tmp_path.chmod(0o2770)
    write_whole(tmp_path / "one" / "more" / "file", "x")
    for path in (tmp_path / "one", tmp_path / "one" / "more"):
        assert path.stat().st_mode & 0o7777 == 0o2770
    assert mode(tmp_path / "one" / "more" / "file") == 0o660
    tmp_path.chmod(0o1777)
    write_whole(tmp_path / "two" / "file", "x")
    assert (mode(tmp_path / "two"), mode(tmp_path / "two" / "file")) == (0o775, 0o664)
