"""The RTSP port: `/cam/realmonitor?channel=1&subtype=0|1`, one encoder for each stream, shared by all who watch."""

from __future__ import annotations

from collections.abc import Callable
from threading import Thread
from types import TracebackType
from typing import Any, Self
from urllib.parse import parse_qs

from services.simulators.camera.http import CameraServer
from services.simulators.camera.rtsp.account import Account, permissions
from services.simulators.camera.rtsp.feed import Feed
from services.simulators.camera.rtsp.gstreamer import GLib, Gst, GstRtspServer
from services.simulators.camera.view.picture import STREAMS, Stream

PATH = "/cam/realmonitor"
HEAVY_KBPS = 2048
SESSIONS_CHECKED_S = 5  # how often those are ended who went without a word
PIPELINE = (
    "( appsrc name=video is-live=true format=time do-timestamp=true max-buffers=3 leaky-type=downstream "
    "caps=video/x-raw,format=I420,width={width},height={height},framerate={fps}/1 "
    "! x264enc tune=zerolatency speed-preset=ultrafast key-int-max={gop} bitrate={bitrate} "
    "! video/x-h264,profile=main ! rtph264pay name=pay0 pt=96 )"
)


class Factory(GstRtspServer.RTSPMediaFactory):  # type: ignore[misc]
    """Makes the encoder that the first one who watches a stream needs; the next ones share it."""

    def __init__(self, camera: CameraServer, feeds: dict[Stream, Feed]) -> None:
        super().__init__()
        self._camera, self._feeds = camera, feeds
        self.set_shared(True)
        self.set_permissions(permissions())
        self.connect("media-configure", self._configured)

    def do_gen_key(self, url: Any) -> str:
        """Streams with the same key share an encoder, whatever else stands in the address."""
        return _stream(url.query)

    def do_create_element(self, url: Any) -> Any:
        """The encoder, as the Encode table has it now."""
        stream = _stream(url.query)
        video, pictures = f"Encode[0].{stream}[0].Video.", self._camera.pictures
        width, height = pictures.size(stream)
        number = self._camera.device.tables.number
        pipeline = Gst.parse_launch(
            PIPELINE.format(
                width=width, height=height, fps=pictures.fps(stream), gop=max(number(video + "GOP"), 1),
                bitrate=max(number(video + "BitRate"), 16),
            )
        )  # fmt: skip
        pipeline.set_name(stream)
        return pipeline

    def _configured(self, factory: Any, media: Any) -> None:
        pipeline = media.get_element()
        stream: Stream = "ExtraFormat" if pipeline.get_name() == "ExtraFormat" else "MainFormat"
        watched = self._feeds[stream].watch(pipeline.get_by_name("video"))
        media.connect("unprepared", lambda _: watched.over.set())


class Server:
    """The port and what stands behind it, between entering and leaving the context."""

    def __init__(self, camera: CameraServer, port: int) -> None:
        self._camera, self._wanted = camera, port
        self._feeds: dict[Stream, Feed] = {stream: Feed(camera, stream) for stream in STREAMS}
        self._context = GLib.MainContext.new()
        self._loop = GLib.MainLoop.new(self._context, False)
        self._thread = Thread(target=self._loop.run, name="RTSP")
        self._sources: list[Any] = []
        self._server = GstRtspServer.RTSPServer()
        self.port = 0

    def __enter__(self) -> Self:
        """Opens the port. OSError: it is taken."""
        self._server.set_address(self._camera.server_name)
        self._server.set_service(str(self._wanted))
        self._server.get_thread_pool().set_max_threads(0)  # all clients on our thread: others race with `cut`
        self._server.set_auth(Account(self._camera))
        self._server.get_mount_points().add_factory(PATH, Factory(self._camera, self._feeds))
        self._server.connect("client-connected", self._connected)
        try:
            listening = self._server.create_source(None)
        except GLib.Error as fault:
            raise OSError(f"RTSP port {self._wanted}: {fault.message}") from fault
        self._sources = [listening, self._cleaning()]
        for source in self._sources:
            source.attach(self._context)
        self.port = self._server.get_bound_port()
        for feed in self._feeds.values():
            feed.start()
        self._thread.start()
        self._camera.cuts.append(self.cut)
        self._camera.device.latency.viewers = self._heavy
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Closes the port, every connection and the threads."""
        self._camera.cuts.remove(self.cut)
        for source in self._sources:
            source.destroy()
        self.cut()
        self._soon(self._loop.quit)
        self._thread.join()
        for feed in self._feeds.values():
            feed.close()
        self._let_go()

    def _let_go(self) -> None:
        """GStreamer's objects hold what they call; in a circle through C that would never be free, pictures and all."""
        self._sources.clear()
        self._server.disconnect_by_func(self._connected)
        self._server.set_auth(None)
        self._server.get_mount_points().remove_factory(PATH)

    def cut(self) -> None:
        """Ends every connection; the encoders end with them."""
        self._soon(self._cut)

    def _cut(self) -> None:
        self._server.client_filter(lambda *_: GstRtspServer.RTSPFilterResult.REMOVE)

    def _heavy(self) -> int:
        """How many streams run that are so large that they slow the camera down."""
        rate = self._camera.device.tables.number
        return sum(
            feed.runs and rate(f"Encode[0].{one}[0].Video.BitRate") > HEAVY_KBPS for one, feed in self._feeds.items()
        )

    def _connected(self, server: Any, client: Any) -> None:
        if self._camera.is_off or self._camera.turns_viewers_away:
            self._soon(client.close)

    def _soon(self, act: Callable[[], None]) -> None:
        """Lets the port's own thread do it before it hears its clients again: who is turned away gets no word in."""

        def once(_: Any) -> bool:
            act()
            return False

        source = GLib.idle_source_new()
        source.set_callback(once)
        source.set_priority(GLib.PRIORITY_HIGH)
        source.attach(self._context)

    def _cleaning(self) -> Any:
        source = GLib.timeout_source_new_seconds(SESSIONS_CHECKED_S)
        source.set_callback(self._clean)
        return source

    def _clean(self, *_: Any) -> bool:
        self._server.get_session_pool().cleanup()
        return True


def _stream(query: str | None) -> Stream:
    subtype = parse_qs(query or "").get("subtype", ["0"])[0]
    return "MainFormat" if subtype.startswith("0") else "ExtraFormat"
