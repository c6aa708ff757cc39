"""Which OpenHAB a file is for, and what the releases differ in. Pure.

Not here: how a kind of file is written or read; those modules ask `Version` by these names.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from services.errors import ConfigError

NEWEST = {2: 5, 3: 4, 4: 3, 5: 2}  # the last release of each series: what a check without a minor release means
OLDEST = {2: 5, 3: 0, 4: 0, 5: 0}  # what files for a whole series have to be readable by


@dataclass(frozen=True, order=True)
class Version:
    """A release of OpenHAB, without its patches."""

    major: int
    minor: int

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}"

    @property
    def oldest(self) -> Version:
        """The first release of the same series."""
        return Version(self.major, OLDEST[self.major])

    @property
    def free_item_types(self) -> bool:
        """Whether the items' grammar takes any word for a type, and leaves the rest to its validator."""
        return self >= Version(5, 1)

    @property
    def free_sitemap(self) -> bool:
        """Whether a widget's keys are free in number and order, and their lists begin with a token of their own."""
        return self >= Version(5, 2)

    @property
    def has_unit_metadata(self) -> bool:
        """Whether an item's unit is metadata; before, its pattern decided."""
        return self.major >= 4

    @property
    def has_semantics(self) -> bool:
        """Whether tags are classes of the semantic model; in 2.x they were Alexa's."""
        return self.major >= 3

    @property
    def has_birth(self) -> bool:
        """Whether every release of this series lets the broker's thing say when it is there; 3.4 was the first."""
        return self.major >= 4

    @property
    def has_start_level(self) -> bool:
        """Whether every release of this series since this one knows the trigger of a start level."""
        return self >= Version(3, 3)


def parse(text: str) -> Version:
    """`5`, `4.2` or `2.5`; without a minor release the newest of its series. ConfigError when there is none such."""
    match = re.fullmatch(r"([2-5])(?:\.([0-9]))?", text)
    if match:
        major = int(match[1])
        version = Version(major, int(match[2]) if match[2] else NEWEST[major])
        if OLDEST[major] <= version.minor <= NEWEST[major]:
            return version
    raise ConfigError([f"--openhab: expected 2.5, 3, 4, 5 or a release of them such as 4.2, got {text!r}"])
