"""An endpoint of the API: one row from which the route, the check of who may, and the OpenAPI document are made."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response

from services.dashboard.house import House
from services.dashboard.sessions import Session
from services.errors import BadMessage, Unavailable

LARGEST_BODY = 64 * 1024
Who = Literal["anybody", "viewer", "operator"]


class Body(BaseModel):
    """The base of what requests carry; an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Fault(BaseModel):
    """Why something was not done."""

    error: str


class Done(BaseModel):
    """It is on the bus; what comes of it is told there."""

    id: str | None = Field(default=None, description="The id that answers carry, where there are answers.")


@dataclass(frozen=True)
class Asked:
    """A request, checked: the session, the parameters, and the body as its model."""

    request: Request
    session: Session
    body: Any

    @property
    def token(self) -> str | None:
        """The session's secret, as the cookie has it."""
        token = self.request.scope.get("token")
        return token if isinstance(token, str) else None

    def path(self, name: str) -> str:
        """A parameter of the path."""
        return str(self.request.path_params[name])

    def query(self, name: str, default: str = "") -> str:
        """A parameter of the query."""
        return self.request.query_params.get(name, default)


Handler = Callable[[Asked], Awaitable[Response | BaseModel | dict[str, Any]]]


@dataclass(frozen=True)
class Endpoint:
    """One row. `query` maps parameters to what they mean; `answer` is a model or a media type."""

    method: Literal["GET", "POST"]
    path: str
    who: Who
    summary: str
    handler: Handler
    body: type[Body] | None = None
    answer: type[BaseModel] | str | None = None
    query: tuple[tuple[str, str], ...] = ()


class TooLarge(BadMessage):
    """A body that nobody needs."""


def serving(endpoint: Endpoint, house: House) -> Callable[[Request], Awaitable[Response]]:
    """The endpoint as Starlette calls it: our errors become answers."""

    async def serve(request: Request) -> Response:
        if request.method == "HEAD":
            return fault(405, "ask by GET", {"allow": "GET"})  # a stream without a body would go on unseen
        session = request.scope["session"]
        if (refused := _refused(endpoint.who, session)) is not None:
            return refused
        try:
            return await _answer(endpoint, Asked(request, session, await _body(endpoint, request)))
        except TooLarge as error:
            return fault(413, str(error))
        except BadMessage as error:
            return fault(422, str(error))
        except Unavailable as error:
            return fault(503, str(error))
        except ClientDisconnect:
            return Response(status_code=400)

    return serve


def fault(status: int, why: str, headers: dict[str, str] | None = None) -> Response:
    """An answer that says what was wrong."""
    return JSONResponse({"error": why}, status, headers)


def one_of(known: tuple[str, ...], name: str, what: str) -> str:
    """That name; BadMessage when it is none of those that we have."""
    if name not in known:
        raise BadMessage(f"{what}: expected one of {', '.join(known) or 'none'}, got {name[:80]!r}")
    return name


def _refused(who: Who, session: Session | None) -> Response | None:
    if who == "anybody":
        return None
    if session is None:
        return fault(401, "log in first")
    if who == "operator" and session.role != "operator":
        return fault(403, f"{session.user} may look, not change anything")
    return None


async def _answer(endpoint: Endpoint, asked: Asked) -> Response:
    answer = await endpoint.handler(asked)
    if isinstance(answer, Response):
        return answer
    if isinstance(answer, BaseModel):
        return Response(answer.model_dump_json(), 202 if isinstance(answer, Done) else 200, {}, "application/json")
    return JSONResponse(answer)


async def _body(endpoint: Endpoint, request: Request) -> Any:
    if endpoint.body is None:
        return None
    if request.headers.get("content-type", "").partition(";")[0].strip() != "application/json":
        raise BadMessage("expected application/json")
    data = bytearray()
    async for part in request.stream():
        data += part
        if len(data) > LARGEST_BODY:
            raise TooLarge(f"expected at most {LARGEST_BODY} bytes")
    try:
        return endpoint.body.model_validate_json(bytes(data))
    except ValidationError as error:
        found = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(map(str, found["loc"])) or "body"
        raise BadMessage(f"{where}: {found['msg']}") from error
