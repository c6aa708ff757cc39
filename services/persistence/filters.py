"""Which of the states that a strategy wants are worth a row: openHAB's filters. Pure.

Those of a line are ANDed, and their memory moves only when a state is stored through that line.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

from pydantic import field_validator, model_validator

from services.section import Section

COUNTED = ("Number", "Dimmer", "Rollershutter", "Color")  # kinds whose number has a size; 1 and 0 of a switch have none
UNITS_S = {"s": 1, "m": 60, "h": 3600, "d": 86_400, "w": 604_800}


@dataclass(frozen=True, slots=True)
class Kept:
    """A state as filters see it: `time` in microseconds."""

    kind: str
    num: float | None
    text: str
    time: int


def length_s(text: Any) -> Any:
    """Seconds of `30 s`, `5m`, `1h`, `90d`; anything else stays for pydantic to judge."""
    if isinstance(text, str) and text[-1:] in UNITS_S:
        try:
            return float(text[:-1]) * UNITS_S[text[-1]]
        except ValueError as error:
            raise ValueError(f"expected a length such as 30 s or 5m, got {text!r}") from error
    return text


class Filter(Section):
    """One filter of `persistence.yaml`: exactly one of its keys, `unit` beside a bound."""

    threshold: float | None = None  # differs by more than that from the last one stored
    relative: float | None = None  # the same in percent of the last one stored
    time: float | None = None  # seconds since the last one stored, or more
    equals: tuple[str, ...] | None = None
    not_equals: tuple[str, ...] | None = None
    include: tuple[float, float] | None = None  # within, the bounds too
    exclude: tuple[float, float] | None = None  # outside, the bounds too
    unit: str | None = None  # of the bounds: that of the items

    @field_validator("time", mode="before")
    @classmethod
    def is_a_length(cls, value: Any) -> Any:
        return length_s(value)

    @field_validator("threshold", "relative", "time")
    @classmethod
    def is_not_negative(cls, value: float | None) -> float | None:
        if value is not None and value < 0:
            raise ValueError(f"expected 0 or more, got {value}")
        return value

    @field_validator("include", "exclude")
    @classmethod
    def is_a_range(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        if value is not None and value[0] > value[1]:
            raise ValueError(f"expected the lower bound first, got {value[0]:g} and {value[1]:g}")
        return value

    @model_validator(mode="after")
    def says_one_thing(self) -> Self:
        names = [name for name in type(self).model_fields if name != "unit"]
        if len([name for name in names if getattr(self, name) is not None]) != 1:
            raise ValueError(f"expected exactly one of {', '.join(names)}")
        return self

    def passes(self, new: Kept, last: Kept | None) -> bool:
        """Whether a state may be stored; `last` is what was stored before through the same line."""
        if self.time is not None:
            return last is None or new.time - last.time >= self.time * 1e6
        if self.equals is not None:
            return new.text in self.equals
        if self.not_equals is not None:
            return new.text not in self.not_equals
        if new.kind not in COUNTED or new.num is None:
            return True
        if self.include is not None:
            return self.include[0] <= new.num <= self.include[1]
        if self.exclude is not None:
            return new.num <= self.exclude[0] or new.num >= self.exclude[1]
        if last is None or last.num is None:
            return True
        return self._moved(new.num, last.num)

    def _moved(self, new: float, last: float) -> bool:
        if self.threshold is not None:
            return abs(new - last) > self.threshold
        assert self.relative is not None
        return last == 0 or round(abs(new - last) * 100 / abs(last), 2) > self.relative
