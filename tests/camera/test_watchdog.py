"""One watchdog after the other: the next service of a camera begins when the one that was killed has nobody left."""

from __future__ import annotations

import threading
from contextlib import closing
from pathlib import Path

import pytest
from pydantic import SecretStr

from services.camera import watchdog
from services.camera.address import Address
from services.camera.device import Direction
from services.camera.watchdog import Watchdog
from services.peers import free_port
from tests.small_flat import words_of


def nobody() -> Address:
    """A camera that is away: its watchdog tries to stop it for a minute."""
    return Address(f"http://127.0.0.1:{free_port()}", "ros", SecretStr("secret123"))


def orphan(lock: Path) -> Watchdog:
    """One whose service has ended while its camera turned, and that is still at work."""
    left = Watchdog("amcrest", nobody(), lock)
    left.tell(Direction.LEFT)
    left.close()
    assert alive(left)
    return left


def alive(one: Watchdog) -> bool:
    """Whether its process runs."""
    return any(words_of(Path(f"/proc/{one.process.pid}")))


def test_the_next_one_waits_until_the_one_before_has_ended(tmp_path: Path) -> None:
    left = orphan(tmp_path / "cameras" / "ip1.lock")
    ending = threading.Timer(0.5, left.process.kill)
    ending.start()
    with closing(Watchdog("amcrest", nobody(), tmp_path / "cameras" / "ip1.lock")):
        assert not alive(left)
    ending.join()


def test_it_is_not_waited_for_without_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(watchdog, "OTHER_S", 0.3)
    left = orphan(tmp_path / "ip1.lock")
    with closing(Watchdog("amcrest", nobody(), tmp_path / "ip1.lock")):
        assert alive(left)
    assert "of another service of this camera is still at work" in caplog.text
    left.process.kill()


def test_another_camera_s_is_nothing_to_wait_for(tmp_path: Path) -> None:
    left = orphan(tmp_path / "ip1.lock")
    with closing(Watchdog("amcrest", nobody(), tmp_path / "ip2.lock")):
        assert alive(left)
    left.process.kill()


def test_where_no_lock_can_be_kept_it_works_all_the_same(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "cameras").write_text("no folder")
    with closing(Watchdog("amcrest", nobody(), tmp_path / "cameras" / "ip1.lock")) as one:
        assert alive(one)
    assert "who else stops this camera is not known" in caplog.text
