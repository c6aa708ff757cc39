"""What a camera says unasked: status, position, places, stream and health, each when it has changed."""

from __future__ import annotations

import logging
from collections.abc import Callable

from pydantic import BaseModel

from services import topics
from services.bus import Message
from services.camera.device import Identity, Reading, Refused
from services.camera.health import Health
from services.camera.lanes import OVERRULES, same
from services.camera.places import Places
from services.camera.upkeep import Facts
from services.camera.video.channel import Channel
from services.errors import ConfigError
from services.payloads import Diagnostic, Position, Stream

EVERY_S = 1.0  # the diagnostics
MOVING_S = 0.5  # the position while it changes
FRESH_S = 3.0  # a camera at rest is asked every two seconds, and answers take their time
LAST_BIT_DEG = 0.5  # a move is done where a reading is as near as that to its goal
LEVELS = {"online": 0, "degraded": 1, "rebooting": 1}  # of diagnostic_msgs/DiagnosticStatus; all others 2

log = logging.getLogger(__name__)


class Bulletin:
    """Remembers what was said last, so that nothing is said twice."""

    def __init__(self, camera: str, health: Health, places: Places, publish: Callable[[Message], None]) -> None:
        self.camera = camera
        self.health = health
        self.places = places
        self.publish = publish
        self.diagnostics = True  # whether the health is said
        self.facts = Facts()
        self.due = 0.0
        self.reading: Reading | None = None
        self.turning = False
        self.identity: Identity | None = None
        self.video: Channel | None = None
        self._read_at = self._turned_at = 0.0
        self._alike = 0  # readings in a row that were as the one before
        self._arrived = False  # the newest reading is that of an arrival
        self._said: dict[topics.Topic, BaseModel] = {}
        self._position_at = 0.0

    def take(self, reading: Reading, at: float) -> None:
        """A new reading from the camera. The first one after an arrival may differ by the last bit of that way."""
        changed = self.reading is not None and not same(self.reading, reading, LAST_BIT_DEG if self._arrived else 0.0)
        self._alike = 0 if changed or self.reading is None else self._alike + 1
        self.turning = changed or (reading.moving is True and self._alike < OVERRULES)
        if self.turning or self.reading is None:
            self._turned_at = at
        self.reading, self._read_at, self._arrived = reading, at, False

    def rests(self, reading: Reading | None) -> None:
        """It was seen to come to rest after an order, which its newest reading does not tell; `reading`: where."""
        self.reading = reading or self.reading
        self.turning, self._turned_at = False, 0.0
        self._alike, self._arrived = OVERRULES, True

    def known(self) -> Reading:
        """The newest reading; Refused when there is none."""
        if self.reading is None:
            raise Refused("the camera has not told its position yet")
        return self.reading

    def at_rest(self, now: float) -> Reading | None:
        """The newest reading when it is of a camera at rest and still tells where it looks."""
        return self.reading if not self.turning and now - self._read_at <= FRESH_S else None

    def still_for(self, now: float) -> float:
        """How many seconds the camera has stood still, as far as its readings tell."""
        return now - self._turned_at

    def position(self) -> Position | None:
        """The newest reading as it is published."""
        if self.reading is None:
            return None
        pan, tilt, zoom = self.reading.pan, self.reading.tilt, self.reading.zoom
        place = None if self.turning else self.places.at(self.reading)
        return Position(pan=pan, tilt=tilt, zoom=zoom, moving=self.turning, place=place, place_name=place or "")

    def say(self, topic: topics.Topic, payload: BaseModel) -> None:
        """Publishes a state unless it is what was said last."""
        if self._said.get(topic) != payload:
            self._said[topic] = payload
            self.publish(topic.message(payload, cam=self.camera))

    def tick(self, now: float, counters: dict[str, int]) -> None:
        """Publishes what has changed, and the health once a second."""
        self.say(topics.CAMERA_STATUS, self.health.status)
        self._say_position(now)
        self._say_stream()
        if now >= self.due:
            self.due = now + EVERY_S
            self._reload()
            self.say_changed()
            if self.diagnostics:
                component = f"camera/{self.camera}"
                self.publish(topics.DIAGNOSTICS.message(self._diagnostic(counters), component=component))

    def say_changed(self) -> None:
        """What orders change, before they are done."""
        self._say_stream()
        self.say(topics.CAMERA_PLACES, self.places.payload)

    def _say_stream(self) -> None:
        self.say(topics.CAMERA_STREAM, self.video.state if self.video else Stream(rtsp=False, mjpeg=False, url=""))

    def _reload(self) -> None:
        """Somebody may have edited the files; a fault is told once, and the old places stay."""
        try:
            self.places.reload()
        except ConfigError as error:
            log.warning("%s: the places stay as they were: %s", self.camera, error)

    def _say_position(self, now: float) -> None:
        position = self.position()
        if position is None or (position.moving and now - self._position_at < MOVING_S):
            return
        if self._said.get(topics.CAMERA_POSITION) != position:
            self._position_at = now
            self.say(topics.CAMERA_POSITION, position)

    def _diagnostic(self, counters: dict[str, int]) -> Diagnostic:
        identity = self.identity or Identity("", "", "")
        values = {
            "http_latency_ms": f"{1000 * self.health.latency:.0f}",
            "model": identity.model,
            "firmware": identity.version,
            "lens_covered": "on" if self.facts.values.get("privacy") == "on" else "off",  # privacy may be none
            **(self.video.values() if self.video else {}),
            **{name: str(count) for name, count in counters.items()},
            **self.facts.values,
        }
        seen = self.video.complaint() if self.video else ""
        complaints = [*filter(None, [seen]), *self.facts.complaints.values()]
        return Diagnostic(
            level=max(LEVELS.get(self.health.state, 2), 1 if complaints else 0),
            message="; ".join([": ".join(filter(None, (self.health.state, self.health.reason))), *complaints]),
            values=values,
            hardware_id=identity.serial or self.camera,
        )
