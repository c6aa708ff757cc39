"""The base of every part of a configuration file. How files are read is in `config.py`."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Section(BaseModel):
    """Frozen; an unknown key is a fault, and so is a number that is not finite.

    A Config may name these fields, which do not stand in its section but are given to it by `config.py`:
    `name` (of the service or camera), `home` (the home's model), `cameras` (their names, the default one first),
    `camera_sections` (their sections as they stand there, for who needs to know how a camera hangs), `folder` (of the
    configuration file: what its relative paths start from), `state` (the folder for what is kept).
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
