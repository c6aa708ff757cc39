"""A camera's moving picture as its service uses it: switched on and off, handed on, and what there is to tell of it.

Used by the main thread, which never waits here. The parts: `reader.py` gets the picture, `newest.py` holds it,
`proxy.py` hands it on. What the video wants from the camera's control connection are plans, in `feed.py`.
"""

from __future__ import annotations

import logging
import socket
import time
from collections.abc import Callable
from urllib.parse import urlsplit

from services.bus import Message
from services.camera.address import Address
from services.camera.device import StreamAddress
from services.camera.video import pictures
from services.camera.video.newest import Newest, Upright
from services.camera.video.proxy import Proxy
from services.camera.video.reader import Opener, Reader
from services.camera.video.session import Session
from services.camera.video.settings import StreamSettings
from services.camera.video.timing import ADVICE, Exposure
from services.camera.web.gate import Gate
from services.camera.web.motion_jpeg import MotionJpeg
from services.payloads import Stream
from services.runner import Post
from services.vision.frames import Kind

ASKED = "/camera/snapshot_wanted"  # somebody at the proxy waits for a picture that no stream brings
STILL_S = 6.0  # a stream without a picture for so long stands still

log = logging.getLogger(__name__)


class Channel:
    """One camera's. `rtsp` and `mjpeg`: what was ordered; either keeps the one connection to the camera."""

    def __init__(
        self,
        camera: str,
        settings: StreamSettings,
        address: Address,
        kind: Kind,
        post: Post,
        gate: Gate,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self.camera = camera
        self.settings = settings
        self.address = address
        self.post = post
        self.gate = gate
        self.clock = clock
        self.rtsp, self.mjpeg = settings.rtsp, settings.mjpeg
        self.reachable: Callable[[], bool] = lambda: False  # the camera, as far as the service knows
        self.found: StreamAddress | None = None  # where the camera's moving picture is, when it has told
        self.newest = Newest(Upright(kind=kind), clock)
        self.reader = Reader(camera, self.newest, settings.latency, gate.book.retry_s, clock)
        self._proxy: Proxy | None = None
        self._base = ""
        self.open()

    @property
    def on(self) -> bool:
        """Whether anybody is to see moving pictures."""
        return self.rtsp or self.mjpeg

    def is_on(self, key: str) -> bool:
        """Whether that order has switched its stream on."""
        return {"RTSP": self.rtsp, "MJPEG": self.mjpeg}[key]

    @property
    def flows(self) -> bool:
        """Whether pictures come by themselves now."""
        return self.on and bool(self.reader.flow.name) and not self._still(self.clock())

    @property
    def timed(self) -> bool:
        """Whether it is known of each picture that flows when it was exposed."""
        return self.flows and self.reader.flow.name == "rtsp"

    @property
    def hopeful(self) -> bool:
        """Whether moving pictures may still come by themselves."""
        return self.reader.on and self.reader.flow.failures == 0 and not self._still(self.clock())

    @property
    def starving(self) -> bool:
        """Whether somebody looks, and only snapshots could show him something."""
        return self.on and self.newest.wanted and not self.flows and not self.hopeful

    @property
    def url(self) -> str:
        """Where the stream is for others; empty while it is nowhere."""
        if self._proxy is None:
            return ""
        return f"{self._base}{self._proxy.stream_path}"

    @property
    def state(self) -> Stream:
        """What is published."""
        return Stream(rtsp=self.rtsp, mjpeg=self.mjpeg, url=self.url)

    def switch(self, *, rtsp: bool | None = None, mjpeg: bool | None = None) -> None:
        """On or off; None leaves as it is."""
        self.rtsp = self.rtsp if rtsp is None else rtsp
        self.mjpeg = self.mjpeg if mjpeg is None else mjpeg
        self.begin(self.found)

    def begin(self, found: StreamAddress | None) -> None:
        """Reads from there from now on, while it is on."""
        ways = self.ways(found) if found is not None and self.on else ()
        if bool(ways) != self.reader.on or found != self.found:
            self.found = found
            self.reader.switch(ways)

    def show(self, jpeg: bytes, taken: float, arrived: float) -> None:
        """A snapshot for all who look; `taken`: when it was asked for, it is not older than that."""
        exposure = Exposure((taken + arrived) / 2, (arrived - taken) / 2)
        self.newest.put(lambda: pictures.decode(jpeg), exposure, arrived, jpeg)

    def values(self) -> dict[str, str]:
        """For the diagnostics."""
        flow, now = self.reader.flow, self.clock()
        way = flow.name if self.flows else "snapshots" if self.on else "off"
        told = {"stream": way, "stream_viewers": str(self.newest.watchers)}
        if not self.on:
            return told
        fps, kbps = flow.rates(now)
        return {
            **told,
            "stream_fps": f"{fps:.1f}",
            "stream_kbps": f"{kbps:.0f}",
            "stream_latency_ms": f"{1000 * flow.latency:.0f}",
            "stream_dropped": str(self.newest.dropped),
            "stream_broken": str(flow.broken + self.newest.broken),
            "stream_connections": str(flow.connections),
        }

    def trouble(self) -> str:
        """Why no moving picture comes although it should; empty when all is well or it is off."""
        if not self.on:
            return ""
        if self.reader.flow.trouble:
            return f"stream: {self.reader.flow.trouble}"
        return "stream: no picture comes" if self._still(self.clock()) else ""

    def complaint(self) -> str:
        """What is wrong with the stream, or advice."""
        return self.trouble() or (ADVICE if self.on and self.reader.flow.queueing else "")

    def ask(self) -> bool:
        """Any thread: somebody waits for a picture; one that flows comes without a snapshot. False: none will come."""
        if not self.flows and self.reachable():
            self.post(Message(ASKED))
        return self.flows or self.reachable()

    def open(self) -> None:
        """Listens, if it does not yet; a port that is taken is told, and tried again when the stream is ordered."""
        if self._proxy is not None:
            return
        try:
            self._proxy = Proxy(self.camera, self.settings, self.newest, self.is_on, self.ask)
            self._base = (self.settings.url or self._own_url(self._proxy)).rstrip("/")
        except OSError as error:
            log.error("%s: no stream at %s:%d: %s", self.camera, self.settings.host, self.settings.port, error)

    def close(self) -> None:
        """Ends viewers and threads."""
        self.rtsp = self.mjpeg = False
        self.newest.close()
        self.reader.close()
        if self._proxy is not None:
            self._proxy.close()

    def _still(self, now: float) -> bool:
        return self.reader.flow.last > 0 and now - self.reader.flow.last > STILL_S

    def ways(self, found: StreamAddress) -> tuple[Opener, ...]:
        """How to open a stream of the camera that is there, the best way first."""
        ways: list[Opener] = []
        rtsp, mjpeg = found.rtsp, found.mjpeg
        if rtsp is not None:
            ways.append(lambda: self._rtsp(rtsp))
        if mjpeg is not None and self.settings.camera_mjpeg:
            ways.append(lambda: MotionJpeg(mjpeg, self.address, self.gate, self.clock))
        return tuple(ways)

    def _rtsp(self, url: str) -> Session:
        from services.camera.video import rtsp  # FFmpeg takes 30 MB: not while the stream is off

        return rtsp.opened(url, self.address, self.gate, self.clock)

    def _own_url(self, proxy: Proxy) -> str:
        host = str(proxy.server_address[0])
        if host in ("0.0.0.0", "::"):
            host = _address_towards(urlsplit(self.address.url).hostname or "")
        return f"http://{f'[{host}]' if ':' in host else host}:{proxy.server_port}"


def _address_towards(host: str) -> str:
    """Our address on the way to the camera: others are there too. Nothing is sent."""
    try:
        family, kind, _, _, where = socket.getaddrinfo(host, 9, type=socket.SOCK_DGRAM)[0]
        with socket.socket(family, kind) as probe:
            probe.connect(where)
            return str(probe.getsockname()[0])
    except OSError:
        return "127.0.0.1"
