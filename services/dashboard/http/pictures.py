"""Pictures: a camera's stream and snapshot, handed on from the camera service; robots' maps."""

from __future__ import annotations

import json

from starlette.responses import Response, StreamingResponse

from services import topics
from services.dashboard.house import House
from services.dashboard.http.endpoint import Asked, Endpoint
from services.dashboard.http.thumbnails import Thumbnails
from services.dashboard.http.video import BOUNDARY, Videos
from services.errors import BadMessage, Unavailable

MIXED = f"multipart/x-mixed-replace; boundary={BOUNDARY}"
SNAPSHOT = "snapshot.jpg"


def endpoints(house: House) -> list[Endpoint]:
    """The rows."""
    videos = Videos()
    thumbnails = Thumbnails(house, videos)
    house.closing.append(videos.close)
    house.running.append(thumbnails.run)

    def address(asked: Asked) -> str:
        camera = asked.path("camera")
        if camera not in house.config.cameras:
            raise BadMessage(f"camera: expected one of {', '.join(house.config.cameras)}, got {camera[:80]!r}")
        text = house.latest(topics.CAMERA_STREAM.name(cam=camera))
        if text is None:
            raise Unavailable(f"the service of {camera} has not said where its picture is")
        return str(json.loads(text)["url"])

    async def stream(asked: Asked) -> Response:
        pictures = house.while_logged_in(asked.token, await videos.watch(address(asked)))
        return StreamingResponse(pictures, 200, {"cache-control": "no-store"}, MIXED)

    async def snapshot(asked: Asked) -> Response:
        url = address(asked)
        data = await videos.snapshot(url.rpartition("/")[0] + f"/{SNAPSHOT}")
        return Response(data, media_type="image/jpeg")

    async def floor(asked: Asked) -> Response:
        data = house.maps.get(asked.path("robot"))
        if data is None:
            raise BadMessage(f"{asked.path('robot')[:80]!r} has no map")
        return Response(data, 200, {"cache-control": "private, max-age=60"}, "image/png")

    async def thumbnail(asked: Asked) -> Response:
        data = thumbnails.get(asked.path("camera"), asked.path("place"))
        if data is None:
            raise BadMessage("there is no picture of that place yet")
        return Response(data, 200, {"cache-control": "private, max-age=3600"}, "image/jpeg")

    return [
        Endpoint("GET", "/api/cameras/{camera}/places/{place}/thumbnail.jpg", "viewer", "A place, small.", thumbnail,
                 answer="image/jpeg"),
        Endpoint("GET", "/api/cameras/{camera}/stream.mjpg", "viewer", "The moving picture.", stream,
                 answer="multipart/x-mixed-replace"),
        Endpoint("GET", "/api/cameras/{camera}/snapshot.jpg", "viewer", "The picture now.", snapshot,
                 answer="image/jpeg"),
        Endpoint("GET", "/api/robots/{robot}/map.png", "viewer", "The floor as the robot's map has it.", floor,
                 answer="image/png"),
    ]  # fmt: skip
