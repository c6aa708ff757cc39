"""Home Assistant's MQTT discovery: what a camera's entities are, so that they appear there and in openHAB. Pure.

An entity is a retained JSON text; an empty one takes it away. Nothing new is said here about the camera: the entities
point to the topics that everybody uses. The keys are those of Home Assistant's MQTT integration, one topic per entity,
which openHAB's binding understands too.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from services import __version__, topics
from services.bus import Message
from services.camera.device import Identity

Key = tuple[str, str]  # platform, entity
ENTITY_TOPICS = (topics.HOMEASSISTANT_ENTITY, topics.HOMEASSISTANT_STATUS)
BIRTH = "online"  # what Home Assistant says when it has started: it wants to hear everything again
USABLE = "{{ 'online' if value_json.state in ('online', 'degraded') else 'offline' }}"
MOTION = "{% if value_json.value == 1 %}ON{% elif value_json.value == 0 %}OFF{% else %}None{% endif %}"
ORDER = '{"value": {{ value | tojson }}}'  # a name may begin with {, which would be JSON otherwise


class Discovery:
    """Keeps Home Assistant told; `on` is the configuration's wish."""

    def __init__(self, camera: str, publish: Callable[[Message], None], *, on: bool) -> None:
        self.camera = camera
        self.publish = publish
        self.on = on
        self._wanted: dict[Key, str] = {}
        self._said: dict[Key, str] = {}

    def hear(self, read: topics.Read) -> None:
        """What Home Assistant says, and what is retained of ours, perhaps from when we were configured otherwise."""
        if read.topic is topics.HOMEASSISTANT_STATUS:
            if read.payload == BIRTH:
                self._said.clear()
            return
        key = (read.levels["platform"], read.levels["entity"])
        if read.message.retain and read.payload and key not in self._wanted and key not in self._said:
            self._said[key] = read.payload  # `tick` takes it away

    def tick(self, identity: Identity | None, places: Iterable[str]) -> None:
        """Says what has changed. Before the camera told who it is, nothing is said, and nothing wanted taken away."""
        self._wanted = entities(self.camera, identity or Identity("", "", ""), list(places)) if self.on else {}
        for key in [key for key in self._said if key not in self._wanted]:
            self._say(key, "")
            del self._said[key]
        for key, text in self._wanted.items() if identity is not None else ():
            if self._said.get(key) != text:
                self._said[key] = text
                self._say(key, text)

    def _say(self, key: Key, text: str) -> None:
        platform, entity = key
        self.publish(topics.HOMEASSISTANT_ENTITY.message(text, platform=platform, cam=self.camera, entity=entity))


def entities(camera: str, identity: Identity, places: list[str]) -> dict[Key, str]:
    """Every entity of a camera as Home Assistant is told it."""
    shared = {"device": _device(camera, identity), "origin": _origin(), **_availability(camera)}
    found = {}
    for (platform, entity), own in _entities(camera, places).items():
        content = {"unique_id": f"apartment_{camera}_{entity}", **own, **shared}
        found[platform, entity] = json.dumps(content, ensure_ascii=False)
    return found


def _entities(camera: str, places: list[str]) -> dict[Key, dict[str, Any]]:
    """What is special to each; without places there is no select, which would have nothing to offer."""
    chooser = {("select", "place"): _place(camera, places)} if places else {}
    return {
        ("camera", "snapshot"): {"name": "Snapshot", "topic": topics.CAMERA_SNAPSHOT.name(cam=camera)},
        ("binary_sensor", "motion"): {
            "name": "Motion",
            "state_topic": topics.CAMERA_MOTION.name(cam=camera),
            "value_template": MOTION,
            "device_class": "motion",
        },
        **chooser,
        **_buttons(camera),
        **_switches(camera),
        **_sensors(camera),
    }


def _place(camera: str, places: list[str]) -> dict[str, Any]:
    return {
        "name": "Place",
        "state_topic": topics.CAMERA_POSITION.name(cam=camera),
        "value_template": "{{ value_json.place }}",
        "command_topic": _order(camera, "Goto"),
        "command_template": ORDER,
        "options": places,
        "icon": "mdi:map-marker",
    }


def _buttons(camera: str) -> dict[Key, dict[str, Any]]:
    scan = {"name": "Scan", "command_topic": _order(camera, "Scan"), "payload_press": "True", "icon": "mdi:qrcode-scan"}
    stop = {"name": "Stop", "command_topic": _order(camera, "Move"), "payload_press": "Stop", "icon": "mdi:stop"}
    reboot = {"name": "Reboot", "command_topic": _order(camera, "Reboot"), "payload_press": "True",
              "device_class": "restart", "entity_category": "config"}  # fmt: skip
    snapshot = {"name": "Take a snapshot", "command_topic": topics.CAMERA_SNAPSHOT_GET.name(cam=camera),
                "payload_press": "now", "icon": "mdi:camera"}  # fmt: skip
    buttons = {"scan": scan, "stop": stop, "reboot": reboot, "take_snapshot": snapshot}
    return {("button", name): content for name, content in buttons.items()}


def _switches(camera: str) -> dict[Key, dict[str, Any]]:
    """They show what the camera says, not what was wished."""
    stream = topics.CAMERA_STREAM.name(cam=camera)
    mjpeg = {"name": "MJPEG stream", "command_topic": _order(camera, "MJPEG"), "state_topic": stream,
             "value_template": "{{ 'ON' if value_json.mjpeg else 'OFF' }}"}  # fmt: skip
    privacy = {"name": "Privacy", "command_topic": _order(camera, "Privacy"), "icon": "mdi:eye-off",
               "state_topic": topics.DIAGNOSTICS.name(component=f"camera/{camera}"),
               "value_template": "{{ 'ON' if value_json['values']['privacy'] == 'on' else 'OFF' }}"}  # fmt: skip
    return {
        ("switch", "mjpeg"): {**mjpeg, "payload_on": "ON", "payload_off": "OFF"},
        ("switch", "privacy"): {**privacy, "payload_on": "ON", "payload_off": "OFF"},
    }


def _sensors(camera: str) -> dict[Key, dict[str, Any]]:
    position, scan = topics.CAMERA_POSITION.name(cam=camera), topics.CAMERA_SCAN_STATE.name(cam=camera)
    health = topics.DIAGNOSTICS.name(component=f"camera/{camera}")
    return {
        ("sensor", "pan"): {**_angle("Pan", position), "value_template": "{{ value_json.pan }}"},
        ("sensor", "tilt"): {**_angle("Tilt", position), "value_template": "{{ value_json.tilt }}"},
        ("sensor", "zoom"): {"name": "Zoom", "state_topic": position, "value_template": "{{ value_json.zoom }}"},
        ("sensor", "scan_state"): {
            "name": "Scan state",
            "state_topic": scan,
            "value_template": "{{ value_json.state }}",
        },
        ("sensor", "latency"): {
            "name": "Latency",
            "state_topic": health,
            # not .values, which is a method of every mapping in a template
            "value_template": "{{ value_json['values']['http_latency_ms'] }}",
            "unit_of_measurement": "ms",
            "state_class": "measurement",
            "entity_category": "diagnostic",
        },
    }


def _angle(name: str, topic: str) -> dict[str, Any]:
    return {"name": name, "state_topic": topic, "unit_of_measurement": "°", "state_class": "measurement"}


def _order(camera: str, key: str) -> str:
    return topics.CAMERA_ORDER.name(cam=camera, key=key)


def _device(camera: str, identity: Identity) -> Mapping[str, Any]:
    """The same device after a restart and after an update: its name decides, not its firmware."""
    known = {"model": identity.model, "serial_number": identity.serial, "sw_version": identity.version}
    return {
        "identifiers": [f"apartment_{camera}"],
        "name": f"Camera {camera}",
        **{key: text for key, text in known.items() if text},
    }


def _origin() -> Mapping[str, str]:
    return {"name": "smart-apartment", "sw_version": __version__}


def _availability(camera: str) -> Mapping[str, Any]:
    """Both must be well: the service, by its last will, and the camera, by what the service says of it."""
    service = topics.SERVICE_STATUS.name(service=f"camera-{camera}")
    return {
        "availability": [
            {"topic": service},
            {"topic": topics.CAMERA_STATUS.name(cam=camera), "value_template": USABLE},
        ],
        "availability_mode": "all",
    }
