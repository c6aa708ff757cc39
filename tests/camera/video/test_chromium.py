"""The stream in a real browser: an `<img>` of another page shows it, and goes on showing what comes."""

from __future__ import annotations

import socket
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

from services import peers
from services.camera.video.newest import Newest, Upright
from services.camera.video.pictures import Image
from services.camera.video.proxy import Proxy
from services.camera.video.settings import StreamSettings
from services.camera.video.timing import Exposure

GREEN, BLUE = (0, 200, 0), (220, 0, 0)  # BGR


@pytest.fixture
def chromium() -> str:
    try:
        return peers.program("chromium", "chromium")
    except peers.Missing as missing:
        pytest.skip(str(missing))


def screenshot(chromium: str, folder: Path, address: str) -> Image:
    """What the browser shows of an address after four seconds, 800x600."""
    subprocess.run(
        [
            chromium, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-sync",
            "--disable-background-networking", "--disable-component-update", "--hide-scrollbars",
            f"--user-data-dir={folder / 'profile'}", "--window-size=800,600", "--timeout=4000",
            f"--screenshot={folder / 'shot.png'}", address,
        ],
        check=True, capture_output=True, timeout=120,
    )  # fmt: skip
    shot = cv2.imread(str(folder / "shot.png"))
    assert shot is not None
    return shot.astype(np.uint8, copy=False)


def snail(ended: threading.Event) -> socket.socket:
    """A port that answers nothing for three seconds: a page that loads something from there is not done before."""
    listener = socket.create_server(("127.0.0.1", 0))

    def crawl() -> None:
        with suppress(OSError), listener, listener.accept()[0]:
            ended.wait(3)

    threading.Thread(target=crawl, daemon=True).start()
    return listener


@contextmanager
def showing(folder: Path) -> Iterator[tuple[Proxy, str]]:
    """A proxy whose pictures are green for half a second from the first look on, then blue; and a page with it."""
    newest, ended = Newest(Upright()), threading.Event()

    def expose() -> None:
        seen = 0
        while not ended.wait(0.1):
            seen += newest.wanted
            image = np.full((300, 400, 3), GREEN if seen < 5 else BLUE, np.uint8)
            newest.put(lambda image=image: image, Exposure(0, 0), newest.clock())

    proxy = Proxy("ip1", StreamSettings(), newest, lambda _: True, lambda: None)
    source = threading.Thread(target=expose)
    source.start()
    slow = snail(ended)
    page = folder / "page.html"
    address = f"http://127.0.0.1:{proxy.server_port}{proxy.stream_path}"
    page.write_text(
        f'<body style="margin:0;background:white"><img src="{address}">'
        f'<img hidden src="http://127.0.0.1:{slow.getsockname()[1]}/"></body>'
    )
    try:
        yield proxy, address
    finally:
        ended.set()
        source.join()
        slow.close()
        proxy.close()


@pytest.mark.chromium
@pytest.mark.parametrize("opened", ["in a page", "alone"])
def test_a_browser_shows_the_newest_picture_of_the_stream(chromium: str, tmp_path: Path, opened: str) -> None:
    with showing(tmp_path) as (_, address):
        shot = screenshot(chromium, tmp_path, f"file://{tmp_path}/page.html" if opened == "in a page" else address)
    blue = np.abs(shot.astype(int) - BLUE).max(axis=2) < 30
    green = np.abs(shot.astype(int) - GREEN).max(axis=2) < 30
    assert blue.sum() > 0.95 * 300 * 400
    assert green.sum() == 0
