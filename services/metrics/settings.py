"""The section `metrics`. What is done with it is in `service.py`."""

from __future__ import annotations

from pydantic import Field

from services.section import Section


class Config(Section):
    """Where Prometheus asks: `http://host:port/metrics`. The page has no login; it tells no states and no secrets."""

    host: str = "127.0.0.1"
    port: int = Field(default=9464, ge=0, le=65535)
