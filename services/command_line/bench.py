"""`apartment bench`: the benchmarks, as `make bench` runs them.

Not here: the benchmarks (`tests/bench.py`). They start the parts that the tests do, so they come with the project's
sources and not with an installed package.
"""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from services.command_line.options import CONFIG, Json, Unread, out, writable
from services.errors import Unavailable

SOURCES = Path(__file__).parents[2]
NEEDED = ("pytest", "playwright", "axe_playwright_python")  # of what the tests' packages are, the first that misses


def bench(
    part: Annotated[str, typer.Option(help="One part, such as bus, persistence, scan, dashboard.")] = "all",
    runs: Annotated[int, typer.Option(help="Runs of each figure; the median counts.", min=1)] = 5,
    kept: Annotated[Path, typer.Option("--out", help="Where the figures are written as JSON.")] = Path("bench.json"),
    _config: Unread = CONFIG,
    json: Json = False,
) -> None:
    """Measure this machine: each figure beside its floor in the same run, on private brokers and databases.

    A running apartment is not touched, but slowed down; all parts together take a while.
    """
    if not (SOURCES / "tests" / "bench.py").exists():
        raise Unavailable("the benchmarks come with the project's sources: run it there, or `make bench`")
    if any(find_spec(one) is None for one in NEEDED):
        raise Unavailable("the benchmarks need the tests' packages: `make bench` installs them, then runs it")
    writable(kept, "--out")
    file = kept.resolve()
    arguments = ["--part", part, "--runs", str(runs), "--json", str(file)]
    screen = subprocess.DEVNULL if json else None
    done = subprocess.run([sys.executable, "-m", "tests.bench", *arguments], cwd=SOURCES, stdout=screen, check=False)
    if done.returncode != 0:
        raise typer.Exit(2 if done.returncode == 2 else 1)  # 2: argparse knows no such part, and has listed them
    if json:
        out.print_json(file.read_text(encoding="utf-8"))
