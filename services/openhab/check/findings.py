"""What is wrong with a file, and where. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

Severity = Literal["error", "warning"]


class Placed(Protocol):
    """Whatever knows where it stands."""

    @property
    def line(self) -> int:
        """From 1."""
        ...

    @property
    def column(self) -> int:
        """From 1."""
        ...


@dataclass(frozen=True, order=True)
class Finding:
    """One fault. An error costs the line or the file, or does something else than it says; a warning works."""

    file: str
    line: int
    column: int
    text: str
    severity: Severity = "error"

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}: {self.severity}: {self.text}"


@dataclass(frozen=True)
class Place:
    """A place of its own."""

    line: int
    column: int


class Findings:
    """Gathers the faults of one file."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.found: list[Finding] = []

    def error(self, where: Placed, text: str) -> None:
        """A fault."""
        self.found.append(Finding(self.file, where.line, where.column, text))

    def warning(self, where: Placed, text: str) -> None:
        """Something that works, though hardly as it was meant."""
        self.found.append(Finding(self.file, where.line, where.column, text, "warning"))
