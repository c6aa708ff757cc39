"""Who is meant by "all", by those who show and those who steer. A role is a service or an account at the broker."""

from __future__ import annotations

ALL = (
    "bridge",
    "persistence",
    "history",
    "mission",
    "dashboard",
    "openhab",
    "operator",
    "robot",
    "camera-<cam>",
)
SHOWN = ("bridge", "persistence", "history", "mission", "dashboard", "operator")
STEERS = ("bridge", "dashboard", "operator", "mission")
