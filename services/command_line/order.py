"""`apartment order`, and what every command shares that orders something of a camera.

Not here: waiting for the end of an order (`services/client.py`).
"""

from __future__ import annotations

from typing import Annotated

import typer
from pydantic_core import from_json

from services import client
from services.command_line import completion
from services.command_line.options import CONFIG, Camera, Config, Json, out
from services.config import Apartment, load
from services.errors import ConfigError
from services.payloads import Order, OrderResult


def order(
    camera: Camera,
    key: Annotated[str, typer.Argument(autocompletion=completion.order_keys)],
    value: Annotated[str, typer.Argument(help="A text, or a JSON object: '{\"targets\": [582, 17]}'.")] = "",
    config: Config = CONFIG,
    json: Json = False,
) -> None:
    """Give a camera an order and wait until it is done, as long as that takes; exit 1 when it was not.

    It tells each answer: accepted, running, then done; or failed, refused or cancelled, and why.
    """
    with client.connected(with_camera(load(config), camera).bus) as bus:
        result = bus.order(camera, key, value_of(value), tell=None if json else tell)
    if json:
        out.print_json(result.model_dump_json())
    if result.state != "done":
        raise typer.Exit(1)


def with_camera(apartment: Apartment, camera: str) -> Apartment:
    """The same; ConfigError, naming the cameras that it has, when it has none of that name."""
    if camera not in apartment.cameras:
        known = ", ".join(apartment.cameras) or "none there"
        raise ConfigError([f"{apartment.file}:1: cameras: expected one of {known}, got {camera!r}"])
    return apartment


def tell(result: OrderResult) -> None:
    """One answer, as a line."""
    out.print(f"{result.key}: {result.state}{f' ({result.error})' if result.error else ''}", markup=False)


def value_of(text: str) -> object:
    """The value of an order: the JSON object that is written there, or else the text as it is."""
    if not text.lstrip().startswith("{"):
        return text
    try:
        return Order(value=from_json(text)).value
    except ValueError:
        return text
