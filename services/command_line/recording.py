"""The form of a recording: a header, then one line of JSON for each message. Pure but for opening the file.

    {"apartment": 1, "version": "0.3.0", "started": "2026-01-31T07:05:00.123Z", "filters": ["camera/#"]}
    {"time": "2026-01-31T07:05:00.130Z", "topic": "home/Lab_Temp/state", "payload": "21.5 °C", "qos": 1, "retain": true}

What is not UTF-8 has `base64` instead of `payload`. Not here: the bus (`record.py`, `replay.py`).
"""

from __future__ import annotations

import base64
import gzip
import json
import zlib
from collections.abc import Iterator
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, Literal, TextIO, cast

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from services.bus import Message
from services.errors import ApartmentError
from services.payloads import seconds, stamp
from services.topics import BLOB_LIMIT, LONGEST_TOPIC

LONGEST_LINE = 2 * BLOB_LIMIT  # a picture in base64 is a third longer, a text with escapes sixfold but limited so


class BrokenRecording(ApartmentError):
    """A file that is no recording, or not a whole one; the message has file and line."""


class Header(BaseModel):
    """The first line: of which form the file is, who wrote it, when it began and what it listened to."""

    model_config = ConfigDict(frozen=True)
    apartment: Literal[1]
    version: str
    started: str
    filters: list[str]


class Line(BaseModel):
    """One message; `time` is when it reached the one who recorded."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)
    time: str
    topic: Annotated[str, Field(min_length=1, max_length=LONGEST_TOPIC)]
    payload: str | None = None
    base64: str | None = None
    qos: Literal[0, 1, 2]
    retain: bool

    @model_validator(mode="after")
    def has_one_payload_and_a_topic(self) -> Line:
        if (self.payload is None) == (self.base64 is None):
            raise ValueError("expected either payload or base64")
        if self.topic[0] in "/$" or any(sign in self.topic for sign in "+#\0"):
            raise ValueError(f"expected a topic that can be published to, got {self.topic!r}")
        self.message()  # whether time and base64 can be read
        return self

    def message(self) -> Message:
        """The message as it came; ValueError when its time or payload cannot be read."""
        payload = base64.b64decode(self.base64, validate=True) if self.base64 is not None else self.text.encode()
        return Message(self.topic, payload, self.retain, self.qos, seconds(self.time))

    @property
    def text(self) -> str:
        """The payload of one that has a text."""
        return self.payload or ""


def header(version: str, now: float, filters: list[str]) -> str:
    """The first line of a recording that begins now."""
    return Header(apartment=1, version=version, started=stamp(now), filters=filters).model_dump_json()


def line(message: Message) -> str:
    """A message as one line of JSON, without its end."""
    try:
        payload = {"payload": message.payload.decode()}
    except UnicodeDecodeError:
        payload = {"base64": base64.b64encode(message.payload).decode("ascii")}
    flags = {"qos": message.qos, "retain": message.retain}
    return json.dumps({"time": stamp(message.received), "topic": message.topic, **payload, **flags}, ensure_ascii=False)


def create(file: Path) -> TextIO:
    """A new recording to write lines into, packed when its name ends in .gz; FileExistsError when it is there."""
    if file.suffix == ".gz":
        return cast(TextIO, gzip.open(file, "xt", encoding="utf-8", newline="\n"))
    return file.open("x", encoding="utf-8", newline="\n")


def read(file: Path) -> Iterator[Message]:
    """Every message of a recording, line by line; BrokenRecording at the first line that is none."""
    number = 0
    try:
        with _opened(file) as lines:
            while text := lines.readline(LONGEST_LINE):
                number += 1
                whole = text.endswith("\n")
                if not whole:
                    raise ValueError("expected a whole line" if len(text) < LONGEST_LINE else "the line is too long")
                if number == 1:
                    Header.model_validate_json(text)
                else:
                    yield Line.model_validate_json(text).message()
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        raise BrokenRecording(f"{file}:{number + 1}: it is cut off or damaged: {error}") from error
    except (ValueError, OSError) as error:
        raise BrokenRecording(f"{file}:{max(1, number)}: {_words(error)}") from error
    if number == 0:
        raise BrokenRecording(f"{file}:1: expected the header of a recording, got nothing")


def _opened(file: Path) -> TextIO:
    if file.suffix == ".gz":
        return TextIOWrapper(gzip.open(file, "rb"), encoding="utf-8", newline="\n")
    return file.open(encoding="utf-8", newline="\n")


def _words(error: ValueError | OSError) -> str:
    if isinstance(error, OSError):
        return error.strerror or str(error)
    if not isinstance(error, ValidationError):
        return str(error)
    fault = error.errors(include_url=False)[0]
    where = ".".join(str(part) for part in fault["loc"])
    return f"{where + ': ' if where else ''}{fault['msg']}"
