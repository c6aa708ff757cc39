"""The application: the table of endpoints behind the guard."""

from __future__ import annotations

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route as StarletteRoute
from starlette.types import ASGIApp

from services.dashboard.house import House
from services.dashboard.http import bus, door, files, history, live, openapi, pictures
from services.dashboard.http.endpoint import Endpoint, serving
from services.dashboard.http.guard import Guard


def application(house: House) -> ASGIApp:
    """Everything that is served."""
    table = endpoints(house)
    document = openapi.document(table)
    static = files.Files()

    async def described(_: Request) -> Response:
        return openapi.response(document)

    routes = [StarletteRoute(one.path, serving(one, house), methods=[one.method]) for one in table]
    routes.append(StarletteRoute("/api/openapi.json", described, methods=["GET"]))
    routes += [StarletteRoute(path, static.serve, methods=["GET"]) for path in static.paths]
    return Guard(Starlette(routes=routes), house)


def endpoints(house: House) -> list[Endpoint]:
    """The whole API."""
    return [
        *door.endpoints(house), *live.endpoints(house), *bus.endpoints(house), *history.endpoints(house),
        *pictures.endpoints(house),
    ]  # fmt: skip
