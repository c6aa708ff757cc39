"""Pictures: a camera's stream and snapshot, handed on from the camera service; robots' maps."""

from __future__ import annotations

import json
import time

from starlette.responses import Response, StreamingResponse

from services.dashboard.house import SNAPSHOT, House
from services.dashboard.http.endpoint import Asked, Endpoint, one_of
from services.dashboard.http.thumbnails import Thumbnails
from services.dashboard.http.video import BOUNDARY, Flow, Videos
from services.dashboard.view import Entry
from services.errors import BadMessage, Unavailable
from services.payloads import RTSP_PICTURE

TOPIC = "/dashboard/video/"  # our own: whether a camera's moving picture moves, while somebody looks
MIXED = f"multipart/x-mixed-replace; boundary={BOUNDARY}"


def endpoints(house: House) -> list[Endpoint]:
    """The rows."""
    gallery = Gallery(house)
    house.closing.append(gallery.videos.close)
    house.running.append(gallery.thumbnails.run)
    return [
        Endpoint("GET", "/api/cameras/{camera}/places/{place}/thumbnail.jpg", "viewer", "A place, small.",
                 gallery.thumbnail, answer="image/jpeg"),
        Endpoint("GET", "/api/cameras/{camera}/stream.mjpg", "viewer", "The moving picture.", gallery.stream,
                 answer="multipart/x-mixed-replace"),
        Endpoint("GET", "/api/cameras/{camera}/snapshot.jpg", "viewer", "The picture now.", gallery.snapshot,
                 answer="image/jpeg"),
        Endpoint("GET", "/api/cameras/{camera}/scan.jpg", "viewer", "The newest picture that a scan has analysed, its "
                 "markers drawn; while ScanImgPub is on.", gallery.scanned, answer="image/jpeg"),
        Endpoint("GET", "/api/robots/{robot}/map.png", "viewer", "The floor as the robot's map has it.", gallery.floor,
                 answer="image/png"),
    ]  # fmt: skip


class Gallery:
    """See the module. Unavailable when a picture cannot be had now, BadMessage when there is none of that name."""

    def __init__(self, house: House) -> None:
        self.house = house
        self.videos = Videos(self._flow)
        self.thumbnails = Thumbnails(house, self.videos)

    async def stream(self, asked: Asked) -> Response:
        """The camera's, for as long as the session: its service may end and come back meanwhile, elsewhere."""
        camera = self._camera(asked)
        parts = await self.videos.watch(camera, lambda: self._address(camera, RTSP_PICTURE))
        pictures = self.house.while_logged_in(asked.token, parts)
        return StreamingResponse(pictures, 200, {"cache-control": "no-store"}, MIXED)

    async def snapshot(self, asked: Asked) -> Response:
        """The camera's."""
        still = await self.videos.snapshot(self._address(self._camera(asked), SNAPSHOT))
        return Response(still.jpeg, media_type="image/jpeg")

    async def scanned(self, asked: Asked) -> Response:
        """What came on `camera/<cam>/scan/image`."""
        data = self.house.scanned.get(self._camera(asked))
        if data is None:
            raise BadMessage("no analysed picture has come: the order ScanImgPub asks a scan for them")
        return Response(data, 200, {"cache-control": "no-store"}, "image/jpeg")

    async def floor(self, asked: Asked) -> Response:
        """A robot's map."""
        data = self.house.maps.get(asked.path("robot"))
        if data is None:
            raise BadMessage(f"{asked.path('robot')[:80]!r} has no map")
        return Response(data, 200, {"cache-control": "private, max-age=60"}, "image/png")

    async def thumbnail(self, asked: Asked) -> Response:
        """A place's."""
        data = self.thumbnails.get(asked.path("camera"), asked.path("place"))
        if data is None:
            raise BadMessage("there is no picture of that place yet")
        return Response(data, 200, {"cache-control": "private, max-age=3600"}, "image/jpeg")

    def _camera(self, asked: Asked) -> str:
        return one_of(self.house.config.cameras, asked.path("camera"), "camera")

    def _flow(self, camera: str, flow: Flow | None) -> None:
        told = "" if flow is None else json.dumps({**flow._asdict(), "since": round(flow.since * 1000)})
        self.house.hub.spread([Entry(f"{TOPIC}{camera}", told, round(time.time() * 1000), "s")])

    def _address(self, camera: str, name: str) -> str:
        url = self.house.picture_of(camera, name)
        if not url:
            raise Unavailable(f"the service of {camera} has not said where its picture is")
        return url
