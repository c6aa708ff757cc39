"""A camera service in a process of its own, for the test that kills it: `python -m tests.camera.child FOLDER URL`."""

from __future__ import annotations

import queue
import sys
import time
from pathlib import Path

from services import camera as real
from services.bus import Message
from tests.camera.bench import PASSWORD


def main(folder: str, url: str) -> None:
    """Turns left for 20 s as soon as the camera is there."""
    inbox: queue.Queue[Message] = queue.Queue()
    config = real.Config(folder=Path(folder), url=url, user="ros", password=PASSWORD)  # type: ignore[arg-type]
    with real.start(config, inbox.put) as service:
        ordered = False
        while True:
            list(service.tick(time.time()))
            if service.health.online and not ordered:
                ordered = True
                inbox.put(Message("camera/ip1/order/Move", b"Left 4 20", received=time.time()))
            try:
                message = inbox.get(timeout=0.05)
            except queue.Empty:
                continue
            list(service.handle(message, time.time()))


if __name__ == "__main__":
    main(*sys.argv[1:])
