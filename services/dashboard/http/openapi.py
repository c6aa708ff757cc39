"""The API's description, OpenAPI 3.1, made of the table of endpoints (spec.openapis.org/oas/v3.1.0)."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema
from starlette.responses import Response

from services import __version__
from services.dashboard.http.endpoint import Endpoint, Fault

ABOUT = (
    "Orders are messages on the bus, said with the rights of the dashboard's account; what comes of them is told there "
    "(`/api/live`). Every POST carries the session's token in `X-CSRF-Token`."
)
FAULTS = {"401": "log in first", "403": "not allowed", "422": "not understood", "503": "something is away"}


def document(table: Sequence[Endpoint]) -> dict[str, Any]:
    """The whole document."""
    models = {model for one in table for model in (one.body, one.answer) if isinstance(model, type)} | {Fault}
    ordered = sorted(models, key=lambda model: model.__name__)
    refs, schemas = models_json_schema(
        [(model, "validation") for model in ordered], ref_template="#/components/schemas/{model}"
    )
    names = {model: refs[model, "validation"] for model in ordered}
    paths: dict[str, Any] = {}
    for one in table:
        paths.setdefault(one.path, {})[one.method.lower()] = _operation(one, names)
    security = {"session": {"type": "apiKey", "in": "cookie", "name": "apartment"}}
    return {
        "openapi": "3.1.0",
        "info": {"title": "Smart apartment", "version": __version__, "description": ABOUT},
        "paths": paths,
        "components": {"schemas": schemas.get("$defs", {}), "securitySchemes": security},
    }


def response(made: dict[str, Any]) -> Response:
    """As it is served."""
    return Response(json.dumps(made, ensure_ascii=False), media_type="application/json")


def _operation(one: Endpoint, names: dict[type[BaseModel], Any]) -> dict[str, Any]:
    parameters = [
        {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
        for name in re.findall(r"{(\w+)}", one.path)
    ] + [{"name": name, "in": "query", "description": what, "schema": {"type": "string"}} for name, what in one.query]
    told: dict[str, Any] = {
        "summary": one.summary,
        "operationId": _name(one),
        "description": f"For: {one.who}.",
        "responses": _responses(one, names),
    }
    if parameters:
        told["parameters"] = parameters
    if one.body is not None:
        told["requestBody"] = {"required": True, "content": {"application/json": {"schema": names[one.body]}}}
    if one.who != "anybody":
        told["security"] = [{"session": []}]
    return told


def _name(one: Endpoint) -> str:
    words = re.findall(r"\w+", one.path.removeprefix("/api"))
    return "_".join([one.method.lower(), *words])


def _responses(one: Endpoint, names: dict[type[BaseModel], Any]) -> dict[str, Any]:
    status = "202" if isinstance(one.answer, type) and one.answer.__name__ == "Done" else "200"
    content = {}
    if isinstance(one.answer, str):
        content = {one.answer: {"schema": {"type": "string"}}}
    elif one.answer is not None:
        content = {"application/json": {"schema": names[one.answer]}}
    faults = {
        code: {"description": what, "content": {"application/json": {"schema": names[Fault]}}}
        for code, what in FAULTS.items()
    }
    return {status: {"description": one.summary, "content": content}, **faults}
