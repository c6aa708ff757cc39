"""What travels between those who want a marker found, the mission, and a robot. The others: the package itself.

Poses of robots are in the map frame (metres, `yaw_deg` counter-clockwise from its x); where a marker is, is said in
the apartment frame, as everywhere on the bus.
"""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from services.payloads import Payload, Point, Real, Who

Id = Field(default=None, max_length=64)


class RobotGoto(Payload):
    """`robot/<robot>/goto`: to a pose, or to a point that the robot's map names."""

    x: Real | None = None
    y: Real | None = None
    yaw_deg: Real = 0.0
    point: str | None = Field(default=None, max_length=200)
    id: str | None = Id

    @model_validator(mode="after")
    def is_one_goal(self) -> Self:
        pose = self.x is not None and self.y is not None
        if pose == (self.point is not None):
            raise ValueError("expected either x and y or a point")
        return self


class RobotCancel(Payload):
    """`robot/<robot>/cancel`: stop; with an id only where that goal is the one under way."""

    id: str | None = Id


class RobotPose(Payload):
    """`robot/<robot>/pose`: where it stands, in the map frame."""

    x: Real
    y: Real
    yaw_deg: Real
    stamp: str


class GotoResult(Payload):
    """`robot/<robot>/goto/result`: one of the last three ends a goal."""

    id: str | None = Id
    state: Literal["accepted", "arrived", "failed", "cancelled"]
    reason: str = ""


class SeenMarker(Payload):
    """A marker in the robot's picture; `position` in the map frame where the robot knows it."""

    marker: int
    position: Point | None = None
    distance: Real | None = None


class RobotSeen(Payload):
    """`robot/<robot>/seen`: what its camera sees; an empty list says that it looked and saw none."""

    markers: list[SeenMarker]
    stamp: str


class MissionOrder(Payload):
    """`mission/<robot>/order`: find a marker, or `cancel` what is under way and what waits (with `id`: that one)."""

    find: int | None = Field(default=None, ge=0, le=9999)
    cancel: bool = False
    id: str | None = Id
    by: Who = "human"

    @model_validator(mode="after")
    def is_one_order(self) -> Self:
        if (self.find is not None) == self.cancel:
            raise ValueError('expected either "find" with a marker or "cancel": true')
        return self


MissionStep = Literal["idle", "go", "look", "scan", "found", "not_found", "failed", "cancelled"]


class MissionState(Payload):
    """`mission/<robot>/state`: what it does now, and why."""

    state: MissionStep
    id: str | None = None
    marker: int | None = None
    place: str | None = None  # where it goes or looks
    reason: str = ""
    since: str
    elapsed_s: Real = 0.0
    waiting: list[str] = []  # ids of orders that come next


class MissionEvent(Payload):
    """One step of a mission as it is told afterwards."""

    at_s: Real
    state: MissionStep
    text: str


class MissionResult(Payload):
    """`mission/<robot>/result`: how a mission ended; `position` in the apartment frame, by whom it is known."""

    id: str
    marker: int
    state: Literal["found", "not_found", "failed", "cancelled", "refused"]
    reason: str = ""
    place: str | None = None
    position: Point | None = None
    by: str | None = None
    elapsed_s: Real = 0.0
    story: list[MissionEvent] = []
    stamp: str


class Where(Payload):
    """`mission/<robot>/where`: where was this marker last? `refresh`: let the house look again if that is long ago."""

    marker: int = Field(ge=0, le=9999)
    id: str = Field(max_length=64, pattern=r"^[A-Za-z0-9_-]+$")
    refresh: bool = True


class Whereabouts(Payload):
    """One sighting: by whom, where, how sure (standard deviation of the position, metres) and how old."""

    by: str
    place: str | None
    position: Point | None
    sigma_m: Real | None
    age_s: Real
    stamp: str


class WhereReply(Payload):
    """`mission/<robot>/where/reply/<id>`: newest first; none when nobody has seen it.

    `refreshing`: the house looks again, and the same is answered once more when it has.
    """

    id: str
    marker: int
    sightings: list[Whereabouts]
    refreshing: bool = False
