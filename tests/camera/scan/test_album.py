"""Pictures of what was seen: one of each marker at each visit, and the oldest go when there are too many."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.camera.scan.album import Album
from services.camera.video import pictures
from tests.camera.scan.virtual_scan import virtual_scan


def test_one_picture_of_each_marker_at_each_visit_is_kept(tmp_path: Path) -> None:
    album = Album(tmp_path / "seen", 10)
    for frame in range(5):
        album.keep("Living room", 0, [17, 582], 1000.0 + frame, b"jpeg")
    album.keep("Living room", 1, [582], 1010.0, b"jpeg")
    names = sorted(file.name for file in (tmp_path / "seen").iterdir())
    assert names == ["19700101T001640.000000Z_Living-room_17+582.jpg", "19700101T001650.000000Z_Living-room_582.jpg"]


def test_the_oldest_go_first(tmp_path: Path) -> None:
    album = Album(tmp_path, 3)
    for visit in range(6):
        album.keep("Sofa", visit, [582], 1000.0 + visit, b"%d" % visit)
    assert [file.read_bytes() for file in sorted(tmp_path.iterdir())] == [b"3", b"4", b"5"]


@pytest.mark.parametrize(("folder", "limit"), [(True, 0), (False, 10)])
def test_without_a_folder_or_a_limit_nothing_is_kept(tmp_path: Path, folder: bool, limit: int) -> None:
    Album(tmp_path if folder else None, limit).keep("Sofa", 0, [582], 1000.0, b"jpeg")
    assert list(tmp_path.iterdir()) == []


def test_a_scan_keeps_a_picture_with_the_marker_drawn(tmp_path: Path) -> None:
    with virtual_scan(tmp_path) as trial:
        trial.run('{"places": ["Living room"], "frames": 2}')
        folder = trial.service.scanner.album.folder
        assert folder is not None
        (file,) = folder.iterdir()
    assert file.name.endswith("_Living-room_582.jpg")
    image = pictures.decode(file.read_bytes()).astype(int)
    green = (image[..., 1] > 180) & (image[..., 0] < 90) & (image[..., 2] < 90)
    assert green.sum() > 50
