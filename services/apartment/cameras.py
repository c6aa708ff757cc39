"""What others read of a camera's section: how it hangs, what it looks for. Its own check tells the faults there."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, ValidationError

from services.section import Section
from services.vision.frames import Mount


class Hung(Section):
    """A camera's section without the rest, which is nobody else's: the password above all."""

    model_config = {"extra": "ignore"}

    mount: Mount | None = None
    camera_info: Path | None = None
    targets: tuple[int, ...] = ()


def _understood(sections: Any) -> dict[str, Hung]:
    found = {}
    for cam, section in sections.items() if isinstance(sections, dict) else ():
        with suppress(ValidationError):
            found[str(cam)] = Hung.model_validate(section)
    return found


CameraSections = Annotated[dict[str, Hung], BeforeValidator(_understood)]
