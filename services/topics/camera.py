"""Topics of a camera: orders and their answers, where it looks, what it sees."""

from __future__ import annotations

from services import payloads as p
from services.topic import Kind, Topic
from services.topics.roles import SHOWN, STEERS

CAMERA_STATUS = Topic(
    "camera/<cam>/status",
    Kind.STATE,
    p.CameraStatus,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "whether the camera can be used, and why not",
)
CAMERA_ORDER = Topic(
    "camera/<cam>/order/<key>",
    Kind.COMMAND,
    p.Order,
    (*STEERS, "openhab"),
    ("camera-<cam>",),
    "an order: plain text is the value and a human's, or JSON with `value`, `id`, `by`",
)
CAMERA_ORDER_RESULT = Topic(
    "camera/<cam>/order_result",
    Kind.EVENT,
    p.OrderResult,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "what became of an order; also to the MQTT 5 response topic",
    stored=True,
)
CAMERA_POSITION = Topic(
    "camera/<cam>/position",
    Kind.STATE,
    p.Position,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "where the camera looks, degrees as it reads them",
)
CAMERA_POSITION_SET = Topic(
    "camera/<cam>/position/set",
    Kind.COMMAND,
    p.PositionSet,
    (*STEERS, "openhab"),
    ("camera-<cam>",),
    "look there; answered like an order, key `Position`",
)
CAMERA_PLACES = Topic(
    "camera/<cam>/places", Kind.STATE, p.Places, ("camera-<cam>",), (*SHOWN, "openhab"), "the named places"
)
CAMERA_MOTION = Topic(
    "camera/<cam>/motion",
    Kind.STATE,
    p.Motion,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "1 for 15 s after motion, -1 when the alarm is in trouble",
)
CAMERA_SCAN_STATE = Topic(
    "camera/<cam>/scan/state",
    Kind.STATE,
    p.ScanState,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "how far a scan is",
    stored=True,
)
CAMERA_SCAN_RESULT = Topic(
    "camera/<cam>/scan/result",
    Kind.EVENT,
    p.ScanResult,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "a marker and where it is",
    stored=True,
)
CAMERA_MARKER = Topic(
    "camera/<cam>/marker/<marker>",
    Kind.STATE,
    p.ScanResult,
    ("camera-<cam>",),
    (*SHOWN, "openhab", "camera-<cam>"),
    "the newest scan result of that marker",
)
CAMERA_SCAN_IMAGE = Topic(
    "camera/<cam>/scan/image",
    Kind.BLOB,
    bytes,
    ("camera-<cam>",),
    SHOWN,
    "an analysed frame as JPEG with the markers drawn, while ScanImgPub is on",
)
CAMERA_SNAPSHOT_GET = Topic(
    "camera/<cam>/snapshot/get", Kind.COMMAND, str, (*STEERS, "openhab"), ("camera-<cam>",), "asks for a snapshot"
)
CAMERA_SNAPSHOT = Topic("camera/<cam>/snapshot", Kind.BLOB, bytes, ("camera-<cam>",), (*SHOWN, "openhab"), "a JPEG")
CAMERA_AUDIO = Topic(
    "camera/<cam>/audio", Kind.EVENT, p.Audio, ("camera-<cam>",), (*SHOWN, "openhab"), "a recording is done"
)
CAMERA_CALIBRATION = Topic(
    "camera/<cam>/calibration",
    Kind.EVENT,
    p.Calibration,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "how far a calibration is, what to show the camera next, and what came out",
)
CAMERA_STREAM = Topic(
    "camera/<cam>/stream",
    Kind.STATE,
    p.Stream,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "which streams are on, and the address of ours",
)
