"""A camera in OpenHAB: its channels on the bus and its items, one row each. Pure.

Pictures come through our proxy, without an account in any address. Not here: how they are shown, that is `sitemap.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from services import topics
from services.openhab.alexa import modes
from services.openhab.lines import ChannelLine, ItemLine, Metadata, Setting, ThingLine
from services.openhab.lines import label as plain_label
from services.openhab.readback import generated
from services.openhab.site import Camera, Site
from services.openhab.state_description import description


@dataclass(frozen=True)
class Part:
    """One thing that a camera has: a channel, and the item that it is linked to."""

    id: str
    item: str
    channel: str
    type: str
    label: str
    settings: dict[str, Setting]
    icon: str | None = None
    tags: tuple[str, ...] = ("Status",)
    read_only: bool = True
    metadata: tuple[Metadata, ...] = field(default=())


def parts(camera: Camera) -> list[Part]:
    """Everything that a camera has."""
    return [*_orders(camera), *_states(camera), *_markers(camera)]


def _order(camera: Camera, key: str) -> str:
    return topics.CAMERA_ORDER.name(cam=camera.name, key=key)


def _orders(camera: Camera) -> Iterator[Part]:
    """What it can be told."""
    cam, control = camera.name, ("Control",)
    place: dict[str, Setting] = {
        "stateTopic": topics.CAMERA_POSITION.name(cam=cam),
        "transformationPattern": "JSONPATH:$.place_name",  # a null would leave the place that it has left
        "commandTopic": _order(camera, "Goto"),
    }
    options = {name: name for name in camera.places}
    yield Part("place", "Place", "string", "String", "Place", place, "zoom", control, False,
               (*description(options=options), *_voice(camera, options)))  # fmt: skip
    yield _switch(camera, "mjpeg", "Stream", topics.CAMERA_STREAM.name(cam=cam), "$.mjpeg", "MJPEG")
    health = topics.DIAGNOSTICS.name(component=f"camera/{cam}")
    yield _switch(camera, "privacy", "Privacy", health, "$.values.lens_covered", "Privacy", ("on", "off"))
    scan = _switch(camera, "scan", "Scan", topics.CAMERA_SCAN_STATE.name(cam=cam), "$.running", "Scan")
    yield replace(scan, label="Scan for markers")
    move: dict[str, Setting] = {"commandTopic": _order(camera, "Move")}
    yield Part("move", "Move", "string", "String", "Turn", move, None, control, False)
    ask: dict[str, Setting] = {"commandTopic": topics.CAMERA_SNAPSHOT_GET.name(cam=cam), "on": "now", "off": "now"}
    yield Part("take_snapshot", "Take_Snapshot", "switch", "Switch", "Take a snapshot", ask, "camera", ("Switch",),
               False)  # fmt: skip


def _voice(camera: Camera, options: dict[str, str]) -> Iterator[Metadata]:
    """`Alexa, set the camera's place to kitchen`."""
    listed = modes(options)
    if len(listed) > 1:
        settings: dict[str, Setting] = {"name": camera.label, "capabilityNames": "Place"}
        yield Metadata("alexa", "Camera.Mode", {**settings, "supportedModes": ",".join(listed)})


def _switch(
    camera: Camera, id: str, item: str, state: str, path: str, key: str, words: tuple[str, str] = ("true", "false")
) -> Part:
    settings: dict[str, Setting] = {
        "stateTopic": state,
        "transformationPattern": f"JSONPATH:{path}",
        "commandTopic": _order(camera, key),
        "on": words[0],
        "off": words[1],
    }
    return Part(id, item, "switch", "Switch", item, settings, "switch", ("Switch",), False)


def _states(camera: Camera) -> Iterator[Part]:
    """What it says."""
    cam = camera.name
    motion = topics.CAMERA_MOTION.name(cam=cam)
    seen = {**_from(motion, "$.seen"), "on": "true", "off": "false"}  # an alarm in trouble is in the number beside it
    yield Part("motion", "Motion", "switch", "Switch", "Motion", seen, "motion", ("Status", "Presence"))
    yield _shown("motion_value", "Motion_Value", "number", "Number", "Motion alarm", motion, "$.value", "motion")
    yield _shown("status", "Status", "string", "String", "Status", topics.CAMERA_STATUS.name(cam=cam), "$.state")
    scan = topics.CAMERA_SCAN_STATE.name(cam=cam)
    yield _shown("scan_state", "Scan_State", "string", "String", "Scan", scan, "$.state")
    yield _shown("scan_found", "Scan_Found", "string", "String", "Found markers", scan, "$.found")
    stream = topics.CAMERA_STREAM.name(cam=cam)
    yield _shown("stream_url", "Stream_Url", "string", "String", "Address of the stream", stream, "$.url")
    position = topics.CAMERA_POSITION.name(cam=cam)
    for axis in ("pan", "tilt", "zoom"):
        yield _shown(axis, axis.title(), "number", "Number", axis.title(), position, f"$.{axis}", "zoom")
    picture: dict[str, Setting] = {"stateTopic": topics.CAMERA_SNAPSHOT.name(cam=cam)}
    yield Part("snapshot", "Snapshot", "image", "Image", "Snapshot", picture, "camera")


def _markers(camera: Camera) -> Iterator[Part]:
    """Where each marker that it looks for was last."""
    for marker in camera.targets:
        topic = topics.CAMERA_MARKER.name(cam=camera.name, marker=marker)
        label = f"Marker {marker}"
        yield _shown(f"marker_{marker}", f"Marker_{marker}", "string", "String", label, topic, "$.place", "zoom")
        yield _shown(f"marker_{marker}_seen", f"Marker_{marker}_Seen", "datetime", "DateTime", f"{label} seen", topic,
                     "$.stamp", "time")  # fmt: skip


def _from(topic: str, path: str) -> dict[str, Setting]:
    return {"stateTopic": topic, "transformationPattern": f"JSONPATH:{path}"}


def _shown(
    id: str, item: str, channel: str, type: str, label: str, topic: str, path: str, icon: str | None = None
) -> Part:
    return Part(id, item, channel, type, label, _from(topic, path), icon)


def thing_uid(site: Site, camera: Camera) -> str:
    """The camera's thing."""
    return f"mqtt:topic:{site.broker.id}:camera_{camera.name}"


def thing(site: Site, camera: Camera) -> ThingLine:
    """The generic topic thing of a camera."""
    channels = tuple(ChannelLine("Type", one.channel, one.id, one.label, one.settings) for one in parts(camera))
    available: dict[str, Setting] = {
        "availabilityTopic": topics.SERVICE_STATUS.name(service=f"camera-{camera.name}"),
        "payloadAvailable": "online",
        "payloadNotAvailable": "offline",
    }
    uid = thing_uid(site, camera)
    return ThingLine(uid, camera.label, bridge=site.broker.uid, settings=available, channels=channels)


def items(site: Site, camera: Camera) -> Iterator[ItemLine]:
    """The camera's group and items."""
    group = site.names.camera(camera.name)
    semantic = site.version.has_semantics
    yield ItemLine(
        "Group", group, plain_label(camera.label), "camera", (), ("Camera",) if semantic else (), (generated(),)
    )
    for one in parts(camera):
        link = Metadata("channel", f"{thing_uid(site, camera)}:{one.id}")
        shown = description(read_only=True) if one.read_only else ()
        yield ItemLine(
            one.type,
            site.names.camera(camera.name, one.item),
            f"{camera.label} {one.label.lower()}",
            one.icon,
            (group,),
            one.tags if semantic else (),
            (link, *shown, *one.metadata, generated()),
        )
