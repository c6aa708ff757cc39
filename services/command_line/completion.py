"""What a shell completes: `apartment completion bash|zsh|fish`, and the names that the configuration has.

Whatever is wrong with the configuration, completing says nothing: that is for `apartment check`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated

import typer

from services.config import Apartment, load
from services.errors import ApartmentError, ConfigError
from services.topics import TABLE

VARIABLE = "_APARTMENT_COMPLETE"  # set by the script in the shell; typer's name for it
SHELLS = ("bash", "zsh", "fish")
Unread = Annotated[Path, typer.Option("--config", help="As every command has it; this one does not read it.")]
Complete = Callable[[typer.Context, str], list[str]]


def completion(
    shell: Annotated[str, typer.Argument(help="bash, zsh or fish.", autocompletion=lambda: SHELLS)],
    _config: Unread = Path("config/apartment.yaml"),
) -> None:
    """Print the script that makes a shell complete commands, services, cameras, items and markers.

    bash: eval "$(apartment completion bash)" in ~/.bashrc; zsh: the same in ~/.zshrc, after compinit;
    fish: apartment completion fish > ~/.config/fish/completions/apartment.fish
    """
    from typer._completion_shared import get_completion_script

    if shell not in SHELLS:
        raise ConfigError([f"completion: expected of {', '.join(SHELLS)}, got {shell!r}"])
    typer.echo(get_completion_script(prog_name="apartment", complete_var=VARIABLE, shell=shell))


def prepare() -> None:
    """Makes typer answer the script, where it is the script that calls; for everybody else it costs nothing."""
    if VARIABLE in os.environ:
        from typer._completion_classes import completion_init

        completion_init()


def _names_of(found: Callable[[Apartment], Iterable[object]]) -> Complete:
    """Completes a word by what is found in the configuration that the words before it name."""

    def complete(ctx: typer.Context, incomplete: str) -> list[str]:
        try:
            apartment = load(Path(ctx.params.get("config") or "config/apartment.yaml"), ())
        except (ApartmentError, OSError):
            return []
        return starting(map(str, found(apartment)), incomplete)

    return complete


def starting(words: Iterable[str], incomplete: str) -> list[str]:
    """Those that begin so, each once."""
    return [one for one in dict.fromkeys(words) if one.startswith(incomplete)]


def _markers(apartment: Apartment) -> list[int]:
    from services.camera import Config  # for this alone

    cameras = [one.config for one in apartment.instances.values() if isinstance(one.config, Config)]
    return sorted({marker for one in cameras for marker in (*one.targets, *one.markers.sizes)})


def _keys(_ctx: typer.Context, incomplete: str) -> list[str]:
    from services.camera.orders import READERS  # for this alone

    return starting(READERS, incomplete)


def _filters(_ctx: typer.Context, incomplete: str) -> list[str]:
    tops = (f"{row.pattern.partition('/')[0]}/#" for row in TABLE)
    return starting((*tops, *(row.filter for row in TABLE)), incomplete)


services: Complete = _names_of(lambda apartment: apartment.instances)
on_bus: Complete = _names_of(lambda apartment: [name for name, one in apartment.instances.items() if one.row.on_bus])
cameras: Complete = _names_of(lambda apartment: apartment.cameras)
items: Complete = _names_of(lambda apartment: apartment.home.items)
markers: Complete = _names_of(_markers)
order_keys: Complete = _keys
filters: Complete = _filters
