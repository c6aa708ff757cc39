"""A small RTSP camera for the tests: GStreamer's server in a process of its own, told what to do on standard input.

Each picture carries the time at which it was "exposed", as 32 black or white blocks (milliseconds, modulo 2^32, the
highest bit at the left) in its first rows. Commands, a line each: `freeze`, `go`, `late SECONDS` (pictures are sent so
long after they were exposed).
"""

from __future__ import annotations

import sys
import threading
import time
from collections import deque
from typing import Any

import gi
import numpy as np

gi.require_version("Gst", "1.0")
gi.require_version("GstRtspServer", "1.0")
from gi.repository import GLib, Gst, GstRtspServer  # noqa: E402

WIDTH, HEIGHT, BLOCK, ROWS = 704, 480, 22, 64
FPS = 15
PIPELINE = (
    "( appsrc name=light is-live=true format=time block=false "
    f"caps=video/x-raw,format=I420,width={WIDTH},height={HEIGHT},framerate={FPS}/1 "
    "! x264enc tune=zerolatency speed-preset=ultrafast bitrate=1500 key-int-max=30 "
    "! rtph264pay name=pay0 pt=96 config-interval=0 )"
)


def picture(at: float, number: int) -> bytes:
    """One picture, I420: the time above, a bar that walks below."""
    luma = np.full((HEIGHT, WIDTH), 90, np.uint8)
    bits = int(at * 1000) & 0xFFFFFFFF
    for index in range(32):
        luma[:ROWS, index * BLOCK : (index + 1) * BLOCK] = 235 if bits >> (31 - index) & 1 else 16
    left = number * 8 % (WIDTH - 40)
    luma[200:400, left : left + 40] = 200
    return luma.tobytes() + bytes([128]) * (WIDTH * HEIGHT // 2)


class Light:
    """Feeds every client's pipeline (they share one)."""

    def __init__(self) -> None:
        self.going, self.late = True, 0.0
        self.waiting: deque[tuple[float, bytes]] = deque()
        self.source: Any = None
        self.began = 0.0  # when the pipeline's own time began, seconds since 1970
        self.number = 0

    def configure(self, factory: Any, media: Any) -> None:
        """A new pipeline."""
        self.source, self.began = media.get_element().get_child_by_name("light"), 0.0
        self.waiting.clear()

    def tick(self) -> bool:
        """Exposes a picture, and sends those whose time has come."""
        now = time.time()
        if self.going and self.source is not None and self.runs(now):
            self.number += 1
            self.waiting.append((now, picture(now, self.number)))
            while self.waiting and self.waiting[0][0] + self.late <= now:
                self.send(*self.waiting.popleft())
        return True

    def runs(self, now: float) -> bool:
        """Whether the pipeline does. It holds a picture until its own time: one of before would delay all others."""
        running = self.source.get_current_running_time()
        if not self.began and running != Gst.CLOCK_TIME_NONE:
            self.began = now - running / Gst.SECOND
        return bool(self.began)

    def send(self, at: float, data: bytes) -> None:
        buffer = Gst.Buffer.new_wrapped(data)
        buffer.pts = int((at - self.began) * Gst.SECOND)
        buffer.duration = Gst.SECOND // FPS
        self.source.emit("push-buffer", buffer)


def listen(light: Light) -> None:
    for line in sys.stdin:
        words = line.split()
        if words[0] == "late":
            light.late = float(words[1])
        else:
            light.going = words[0] == "go"


def allow(factory: Any, server: Any, user: str, password: str) -> None:
    """Digest, as the camera wants it."""
    token = GstRtspServer.RTSPToken()
    token.set_string("media.factory.role", "viewer")
    auth = GstRtspServer.RTSPAuth()
    auth.set_supported_methods(2)
    auth.add_digest(user, password, token)
    server.set_auth(auth)
    permissions = GstRtspServer.RTSPPermissions()
    for right in ("media.factory.access", "media.factory.construct"):
        permissions.add_permission_for_role("viewer", right, True)
    factory.set_permissions(permissions)


def main(port: str, user: str, password: str) -> None:
    Gst.init(None)
    light = Light()
    server = GstRtspServer.RTSPServer()
    server.set_address("127.0.0.1")
    server.set_service(port)
    factory = GstRtspServer.RTSPMediaFactory()
    factory.set_shared(True)
    factory.set_launch(PIPELINE)
    factory.connect("media-configure", light.configure)
    allow(factory, server, user, password)
    server.get_mount_points().add_factory("/cam/realmonitor", factory)
    server.attach(None)
    GLib.timeout_add(1000 // FPS, light.tick)
    threading.Thread(target=listen, args=(light,), daemon=True).start()
    sys.stdout.write(f"{server.get_bound_port()}\n")
    sys.stdout.flush()
    GLib.MainLoop().run()


if __name__ == "__main__":
    main(*sys.argv[1:])
