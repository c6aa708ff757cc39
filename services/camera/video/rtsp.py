"""The moving picture over RTSP: packets with their times, decoded only when somebody looks. One thread uses it.

PyAV and not OpenCV's reader, which hides the packets' times and cannot be told how long to wait. FFmpeg writes whole
addresses into its log and its errors, with the password: its log is off, and its errors are told in our words.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING
from urllib.parse import quote, urlsplit, urlunsplit

import av
import av.logging
import numpy as np

from services.camera.address import Address
from services.camera.device import Away, BadLogin, Refused
from services.camera.video.pictures import Image
from services.camera.video.session import Arrival
from services.camera.video.timing import Held
from services.camera.web.gate import Gate
from services.errors import DeviceError

if TYPE_CHECKING:
    Packet = av.Packet[av.VideoStream]

OPEN_S, READ_S = 5.0, 4.0  # a stream that stands still is given up after READ_S
LONGEST_BACKLOG = 32  # pictures that are decoded at once for a first look; with more the next keyframe is waited for
LONGEST_GOP = 8 * 1024 * 1024  # bytes kept to begin with, when somebody starts to look between two keyframes
OPTIONS = {
    "rtsp_transport": "tcp",  # over UDP lost packets are broken pictures
    "allowed_media_types": "video",
    "probesize": "32",  # what kind of picture it is stands in the session description
    "analyzeduration": "0",
}


def opened(url: str, address: Address, gate: Gate, clock: Callable[[], float] = time.time) -> Rtsp:
    """A session, with the login that the camera's gate allows. BadLogin, Refused or Away."""
    with gate.login() as login:
        try:
            session = Rtsp(url, address, clock)
        except BadLogin:
            login.failed()
            raise
        login.passed()
        return session


class Rtsp:
    """A Session. BadLogin, Refused or Away when it cannot be opened."""

    name = "rtsp"

    def __init__(self, url: str, address: Address, clock: Callable[[], float] = time.time) -> None:
        self.clock = clock
        self._container = _open(with_password(url, address))
        self._stream = self._container.streams.video[0]
        context = self._stream.codec_context
        context.thread_type = "SLICE"  # decoding several frames at once delays each by as many
        context.flags |= av.codec.context.Flags.low_delay
        self._packets = self._container.demux(self._stream)
        self._gop: list[Packet] = []  # since the last keyframe
        self._held = Held()
        self._kept = 0  # bytes of these
        self._decoded = 0  # so many of these are decoded

    def read(self, *, decode: bool) -> Arrival:
        """The next picture. `stream_s` is None for the first ones of some cameras."""
        packet = self._next()
        stream_s = None if packet.pts is None else float(packet.pts * packet.time_base)
        arrived = self.clock() - self._held.take(stream_s)
        self._keep(packet)
        frame, broken = self._decode() if decode else (None, False)
        develop = None if frame is None else _developer(frame)
        return Arrival(arrived, packet.size, stream_s, develop, broken=broken)

    @property
    def codec(self) -> str:
        """How its pictures are coded."""
        return self._stream.codec_context.name

    def close(self) -> None:
        """Ends the connection."""
        self._gop.clear()
        self._container.close()

    def _next(self) -> Packet:
        try:
            packet = next(self._packets)
        except StopIteration:
            raise Away("the camera has ended the stream") from None
        except av.FFmpegError as error:
            raise _translated(error, "broke off") from None
        if packet.size == 0:  # PyAV's sign of the end
            raise Away("the camera has ended the stream")
        return packet

    def _keep(self, packet: Packet) -> None:
        if packet.is_keyframe or self._kept > LONGEST_GOP:
            self._gop.clear()
            self._decoded = self._kept = 0
        if packet.is_keyframe or self._gop:
            self._gop.append(packet)
            self._kept += packet.size

    def _decode(self) -> tuple[av.VideoFrame | None, bool]:
        """The picture of the newest packet, from the last keyframe on where those before are not decoded yet."""
        frame, broken = None, False
        if len(self._gop) - self._decoded > LONGEST_BACKLOG:
            return None, False
        for packet in self._gop[self._decoded :]:
            frame = None
            try:
                for frame in self._stream.codec_context.decode(packet):
                    broken = frame.is_corrupt
            except av.FFmpegError:
                broken = True
        self._decoded = len(self._gop)
        return (None if broken else frame), broken


def with_password(url: str, address: Address) -> str:
    """The address that FFmpeg needs; it must not be shown to anybody."""
    if not address.user:
        return url
    parts = urlsplit(url)
    login = f"{quote(address.user, safe='')}:{quote(address.password.get_secret_value(), safe='')}"
    return urlunsplit(parts._replace(netloc=f"{login}@{parts.netloc}"))


def _open(url: str) -> av.container.InputContainer:
    av.logging.set_level(None)
    try:
        container = av.open(
            url, options=OPTIONS, timeout=(OPEN_S, READ_S), metadata_errors="replace"
        )  # in any encoding
    except av.FFmpegError as error:
        raise _translated(error, "cannot be opened") from None
    if not container.streams.video or container.streams.video[0].codec_context is None:
        container.close()
        raise Refused("the camera's stream has no picture, or none that can be decoded here")
    return container


def _translated(error: av.FFmpegError, otherwise: str) -> DeviceError:
    """Never the error's own text: the address stands in it."""
    if isinstance(error, av.HTTPUnauthorizedError):
        return BadLogin("the camera's stream does not know this user and password", 0.0)  # the reader knows how long
    if isinstance(error, av.HTTPNotFoundError | av.HTTPForbiddenError | av.HTTPBadRequestError):
        return Refused(f"the camera refuses the stream: {error.strerror}")
    if isinstance(error, av.ExitError):
        return Away(f"no picture within {READ_S:.0f} s")
    return Away(f"the stream {otherwise}: {error.strerror}")


def _developer(frame: av.VideoFrame) -> Callable[[], Image]:
    return lambda: frame.to_ndarray(format="bgr24").astype(np.uint8, copy=False)
