"""What the video wants from the camera's own connection, as plans: where the stream is, and snapshots.

Snapshots are taken on request, at motion and every so often where that is configured, and for those who look while no
stream flows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress

from services.bus import Message
from services.camera import orders
from services.camera.device import Away, FindStream, Picture, Refused, Reply, Snapshot, StreamAddress
from services.camera.health import Health
from services.camera.plan import Plan, attempt, wait
from services.camera.settings import Config
from services.camera.upkeep import Facts
from services.camera.video import pictures
from services.camera.video.channel import Channel
from services.camera.video.newest import Upright
from services.camera.video.spoilt import Spoilt
from services.errors import BadMessage, DeviceError
from services.topics import CAMERA_SNAPSHOT, CAMERA_SNAPSHOT_GET

START_S = 15.0  # an order to switch on fails when no picture has come until then
STEP_S = 0.1
IDLE_S = 1.0
RETRY_S = 10.0  # after a camera would not tell where its stream is, or gave no picture


class Feed:
    """Makes the plans. `channel` None: no moving pictures here (virtual time)."""

    def __init__(
        self, config: Config, health: Health, facts: Facts, channel: Channel | None, say: Callable[[Message], None]
    ) -> None:
        self.config = config
        self.health = health
        self.spoilt = Spoilt(config.name, facts)
        self.channel = channel
        self.upright = Upright(config.picture.flip, config.picture.mirror, config.kind)
        self.say = say
        self._settled: dict[str, bool] = {}  # as each stream was before the orders that are under way
        self._newest: dict[str, orders.Broadcast] = {}  # of each stream; only that one undoes what it has done
        if channel is not None:
            self._settled = {"rtsp": channel.rtsp, "mjpeg": channel.mjpeg}
            channel.newest.upright = self.upright
            channel.reachable = lambda: health.online
        self._shooting = self._asked = False
        self._motion = 0

    def check(self, order: orders.Broadcast) -> None:
        """Refused when nothing could be switched on; off is possible while the camera is away too."""
        self._channel()
        if (order.rtsp or order.mjpeg) and not self.health.online:
            raise Refused(f"the camera is {self.health.state}: {self.health.reason}")

    def switch(self, order: orders.Broadcast, now: float) -> Plan[None]:
        """RTSP and MJPEG, on or off. On is done when a picture is there; without one it is as it was."""
        channel = self._channel()
        wanted = {key: on for key, on in vars(order).items() if on is not None}
        if any(wanted.values()):
            channel.open()
            if not channel.url:
                raise Refused("the port of the stream is taken: see stream.port in the configuration")
        self._newest |= dict.fromkeys(wanted, order)
        channel.switch(**wanted)
        try:
            if any(wanted.values()):
                yield from self._first_picture(channel, order, now)
        except DeviceError:
            channel.switch(**{key: self._settled[key] for key in wanted if self._newest[key] is order})
            raise
        self._settled |= {key: channel.is_on(key.upper()) for key in wanted}

    def lasting(self, now: float) -> Iterable[Plan[None]]:
        """The plans that go on as long as the service does."""
        return self.run(now), self.every_so_often(now), self.mended(now)

    def run(self, now: float) -> Plan[None]:
        """As long as the service: finds the stream when it is wanted, feeds those who look while none flows."""
        while (channel := self.channel) is not None:
            now = yield from wait(now + (STEP_S if channel.starving else IDLE_S))
            self.health.stream = channel.trouble()
            if not channel.on or not self.health.online:
                continue
            if channel.found is None:
                now = yield from self._find(channel)
                if channel.found is None:
                    now = yield from wait(now + RETRY_S)
            elif channel.starving:
                now = (yield from self._shoot(channel)).received
                now = yield from wait(now + self.config.stream.snapshot_every_s)

    def shown(self) -> Plan[None]:
        """A snapshot for somebody at the proxy."""
        if self.channel is not None and self.health.online and not self._shooting:
            yield from self._shoot(self.channel)

    def published(self) -> Plan[None]:
        """A snapshot for the bus, upright; DeviceError when there is none."""
        data = yield from self._upright()
        self.say(CAMERA_SNAPSHOT.message(data, cam=self.config.name))

    def on_request(self) -> Plan[None]:
        """A snapshot for who asks on the bus; one under way is for him, too. BadMessage while there is none."""
        if not self.health.online:
            topic = CAMERA_SNAPSHOT_GET.name(cam=self.config.name)
            raise BadMessage(f"{topic}: refused, the camera is {self.health.state}: {self.health.reason}")
        return self._requested()

    def at_motion(self, value: int) -> Plan[None]:
        """A snapshot when motion begins (the value becomes 1), where that is configured."""
        began, self._motion = value == 1 and self._motion != 1, value
        if began and self.config.snapshot.at_motion and self.health.online:
            yield from self.published()

    def every_so_often(self, now: float) -> Plan[None]:
        """As long as the service: snapshots at the configured distance, while the camera is there and at rest."""
        while (every := self.config.snapshot.every_s) is not None:
            now = yield from wait(now + every)
            if self._has_time():
                with suppress(DeviceError):
                    yield from self.published()

    def mended(self, now: float) -> Plan[None]:
        """As long as the service: another snapshot now and then after one that was none, until they are good again."""
        while True:
            now = yield from wait(now + RETRY_S)
            if self.spoilt.why and self._has_time():
                with suppress(DeviceError):
                    yield from self._upright()

    def turned(self, picture: Picture) -> None:
        """The camera delivers its pictures in another way from now on."""
        self.upright = Upright(picture.flip, picture.mirror, self.upright.kind)
        if self.channel is not None:
            self.channel.newest.upright = self.upright

    def _requested(self) -> Plan[None]:
        if not self._asked:
            self._asked = True
            try:
                yield from self.published()
            finally:
                self._asked = False

    def _has_time(self) -> bool:
        return self.health.online and not self.health.moving

    def _channel(self) -> Channel:
        if self.channel is None:
            raise Refused("not available: there is no moving picture here")
        return self.channel

    def _first_picture(self, channel: Channel, order: orders.Broadcast, now: float) -> Plan[None]:
        until = now + START_S
        while not channel.flows:
            now = yield from wait(now + STEP_S)
            if (order.rtsp and not channel.rtsp) or (order.mjpeg and not channel.mjpeg):
                raise Refused("it was switched off again")
            if channel.found is None:
                now = yield from self._find(channel)
            elif not channel.hopeful:
                reply = yield from self._shoot(channel)
                if not self.spoilt.why:
                    return
                now = yield from wait(reply.received + IDLE_S)
            if now > until:
                raise Away(channel.complaint() or f"no picture has come within {START_S:.0f} s")

    def _find(self, channel: Channel) -> Plan[float]:
        reply = yield from attempt(FindStream(self.config.stream.source))
        if isinstance(reply.result, StreamAddress):
            channel.begin(reply.result)
        elif reply.error is None or isinstance(reply.error, Refused):
            channel.begin(StreamAddress(None))
        return reply.received

    def _upright(self) -> Plan[bytes]:
        reply = yield from attempt(Snapshot())
        return self.spoilt.judged(reply, self.upright.jpeg)

    def _shoot(self, channel: Channel) -> Plan[Reply]:
        self._shooting = True
        try:
            reply = yield from attempt(Snapshot())
        finally:
            self._shooting = False
        with suppress(DeviceError):
            channel.show(self.spoilt.judged(reply, pictures.whole), reply.sent, reply.received)
        return reply
