"""What can be read in an order that makes no sense: enough to answer who gave it."""

from __future__ import annotations

from typing import Any, NamedTuple

from pydantic_core import from_json

from services.payloads import LONGEST_ID, Who


class Gleaned(NamedTuple):
    """`told` are the keys of its object, whatever they are; none where it is no object."""

    told: dict[str, Any]
    id: str | None
    by: Who


def glean(payload: bytes) -> Gleaned:
    """Whose order it is, and its id, as far as they are there."""
    try:
        made = from_json(payload)
    except ValueError:
        made = None
    told = made if isinstance(made, dict) else {}
    by, order_id = told.get("by"), told.get("id")
    own = str(order_id)[:LONGEST_ID] if isinstance(order_id, str | int) else None
    return Gleaned(told, own, by if by in ("mission", "scan") else "human")
