"""What pages are shown: the apartment as it is described, states as they are now, and what changes."""

from __future__ import annotations

import re
from typing import Any

from pydantic import BaseModel, RootModel
from starlette.responses import Response, StreamingResponse

from services import topics
from services.bus import topic_matches
from services.dashboard.house import House
from services.dashboard.http.endpoint import Asked, Endpoint
from services.dashboard.hub import MOST_PAGES
from services.errors import BadMessage, Unavailable
from services.payloads import Place

FILTER = re.compile(r"(\+|#|[A-Za-z0-9_$-]+)(/(\+|[A-Za-z0-9_-]+))*(/#)?")
MOST_FILTERS = 32
STREAM = {"cache-control": "no-store, no-transform", "x-accel-buffering": "no"}
WHICH = ("topics", "MQTT filters, separated by commas; none: everything that the dashboard may read.")


class States(RootModel[dict[str, str]]):
    """Topic and newest payload."""


class PlacesOf(RootModel[dict[str, Place]]):
    """The places of a camera."""


class Link(BaseModel):
    """Whether the broker is there."""

    online: bool


class Anything(RootModel[dict[str, Any]]):
    """An object whose keys `services/dashboard/plan.py` describes."""


def endpoints(house: House) -> list[Endpoint]:
    """The rows."""

    async def apartment(_: Asked) -> dict[str, Any]:
        return house.apartment

    async def broker(_: Asked) -> BaseModel:
        return Link(online=house.connected)

    async def states(asked: Asked) -> BaseModel:
        filters = _filters(asked)
        found = {t: e.text for t, e in house.hub.latest.items() if any(topic_matches(one, t) for one in filters)}
        return States(found)

    async def live(asked: Asked) -> Response:
        if house.hub.pages >= MOST_PAGES:
            raise Unavailable("too many pages are open")
        batches = house.while_logged_in(asked.token, house.hub.batches(_filters(asked)))
        return StreamingResponse(batches, 200, STREAM, "text/event-stream")

    async def places(asked: Asked) -> BaseModel:
        text = house.latest(topics.CAMERA_PLACES.name(cam=asked.path("camera")))
        if text is None:
            raise BadMessage(f"the camera {asked.path('camera')} has told no places")
        return PlacesOf.model_validate_json(text)

    return [
        Endpoint("GET", "/api/apartment", "viewer", "Rooms, items, cameras and robots.", apartment, answer=Anything),
        Endpoint("GET", "/api/broker", "anybody", "Whether the dashboard has its broker.", broker, answer=Link),
        Endpoint("GET", "/api/states", "viewer", "The newest payloads.", states, answer=States, query=(WHICH,)),
        Endpoint("GET", "/api/live", "viewer", "Everything as it is, then changes: server-sent events, each an array "
                 "of [topic, payload, ms since 1970, kind]; the first is of type `snapshot`, and after 10 s without "
                 "news comes a `beat`: the `id` of both is the server's time.", live,
                 answer="text/event-stream", query=(WHICH,)),
        Endpoint("GET", "/api/cameras/{camera}/places", "viewer", "The places of a camera.", places, answer=PlacesOf),
    ]  # fmt: skip


def _filters(asked: Asked) -> tuple[str, ...]:
    wanted = tuple(sorted({one for one in asked.query("topics").split(",") if one}))
    if len(wanted) > MOST_FILTERS:
        raise BadMessage(f"topics: expected at most {MOST_FILTERS} filters, got {len(wanted)}")
    for one in wanted:
        if len(one) > 200 or not FILTER.fullmatch(one.removeprefix("/")):
            raise BadMessage(f"topics: expected MQTT filters, got {one[:80]!r}")
    return wanted or ("#",)
