"""A camera's service played by a test: it takes the orders that a command gives, and answers them."""

from __future__ import annotations

import json
from typing import Any

from services.client import Client

CAMERAS = "cameras:\n  ip1: {url: 'http://127.0.0.1:9', user: ros, password: only-simulated}\n"
CAME_S = 20.0


def taken(camera: Client, key: str) -> dict[str, Any]:
    """The order that comes."""
    came = camera.until(lambda message: message.topic == f"camera/ip1/order/{key}", CAME_S)
    order: dict[str, Any] = json.loads(came.payload)
    return order


def answer(camera: Client, key: str, order: dict[str, Any], state: str, error: str | None = None) -> None:
    told = {"id": order["id"], "key": key, "value": order["value"], "state": state, "error": error}
    camera.say("camera/ip1/order_result", json.dumps(told))
