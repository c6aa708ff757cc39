"""The README cannot go stale: its commands are run, its example is a test, and the paths that it names exist."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from services.__main__ import app
from services.simulated import Simulated

pytest_plugins = ["pytester"]
ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
SHELL = [
    line.partition(" # ")[0].strip()
    for block in re.findall(r"```sh\n(.*?)```", README, re.S)
    for line in block.splitlines()
]
CODE = re.compile(r"```sh\n(.*?)```|`([^`\n]+)`", re.S)
LONG = ("apartment run", "mosquitto_sub", "rostopic echo")  # they go on until somebody ends them


def test_the_make_commands_of_the_readme_exist() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    wanted = {line.split()[1] for line in SHELL if line.startswith("make ")} | set(
        re.findall(r"`make ([a-z]+)", README)
    )
    assert {"demo", "test"} <= wanted <= targets


def test_the_paths_of_the_readme_exist() -> None:
    named = re.findall(r"`((?:services|config|mosquitto)/[\w/.<>-]*)`", README)
    assert named
    for path in named:
        assert list(ROOT.glob(path.replace("<service>", "*"))), path


@pytest.mark.parametrize(
    "line", [line for line in SHELL if line.startswith("apartment ") and not line.startswith(LONG)]
)
def test_a_command_of_the_readme_does_what_it_says(line: str, simulated_apartment: Simulated) -> None:
    environment = {**os.environ, **simulated_apartment.parts.environment}
    words = [sys.executable, "-m", "services", *shlex.split(line)[1:]]
    words = [str(simulated_apartment.config) if word == "config/simulated.yaml" else word for word in words]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=240, cwd=ROOT)
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
    assert done.stdout.strip()


def test_the_example_test_of_the_readme_runs(pytester: pytest.Pytester, simulated_apartment: Simulated) -> None:
    """In a process and a folder of its own, as a lab would; against the apartment that runs already."""
    example = re.search(r"```python\n(.*?)```", README, re.S)
    assert example is not None
    pytester.makepyfile(example[1])
    result = pytester.runpytest_subprocess("-q", "-p", "no:cacheprovider", timeout=300)
    result.assert_outcomes(passed=example[1].count("def test_"))


@pytest.mark.parametrize(
    "command",
    [
        "run",
        "serve",
        "simulate",
        "demo",
        "check",
        "topics",
        "status",
        "order",
        "scan",
        "history",
        "doctor",
        "bench",
        "install",
        "backup",
        "restore",
        "watch",
        "record",
        "replay",
        "completion",
        "log",
        "reload",
        "secrets init",
    ],
)
def test_every_command_has_help_with_an_example(command: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "services", *command.split(), "--help"], capture_output=True, text=True, timeout=60,
        env={**os.environ, "COLUMNS": "200"},
    )  # fmt: skip
    assert done.returncode == 0
    assert f"Example: apartment {command}" in done.stdout


def test_every_command_takes_a_configuration() -> None:
    def lacking(command: Any, *words: str) -> list[str]:
        inner = getattr(command, "commands", None)
        if inner is not None:
            return [one for name, made in inner.items() for one in lacking(made, *words, name)]
        return [] if any("--config" in one.opts for one in command.params) else [" ".join(words)]

    assert lacking(typer.main.get_command(app)) == []


SIMULATED = ["--config", "config/simulated.yaml"]


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["nonsense"], 2),
        (["check", "--config", "nowhere.yaml"], 2),
        (["run", "nobody", *SIMULATED], 2),
        (["history", "Never_Stored", *SIMULATED], 1),
        (["history", "Kitchen_Light", "--since", "9999999w", *SIMULATED], 2),
        (["mission", "find", "12345", *SIMULATED], 2),
        (["order", "ip1", "Goto", "Nowhere", *SIMULATED], 1),
    ],
)
def test_exit_codes_tell_what_went_wrong(words: list[str], code: int, simulated_apartment: Simulated) -> None:
    environment = {**os.environ, **simulated_apartment.parts.environment}
    done = subprocess.run(
        [sys.executable, "-m", "services", *words],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        cwd=ROOT,
    )
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr


def test_the_links_of_the_documentation_lead_somewhere() -> None:
    for page in sorted((ROOT / "docs").glob("*.md")):
        for link in re.findall(r"\]\((?!http)([^)#]+)", page.read_text(encoding="utf-8")):
            assert (page.parent / link).exists(), f"{page.name}: {link}"


def test_the_commands_that_the_documentation_names_exist() -> None:
    """Without their arguments: `apartment secrets renew` has a command of that name."""
    root: Any = typer.main.get_command(app)
    for page in sorted((ROOT / "docs").glob("*.md")):
        for words in re.findall(
            r"(?<!etc/)\bapartment ([a-z][a-z-]*(?: [a-z][a-z-]*)*)",
            " ; ".join(a or b for a, b in CODE.findall(page.read_text("utf-8"))),
        ):
            first, *more = words.split()
            assert first in root.commands, f"{page.name}: apartment {words}"
            inner = getattr(root.commands[first], "commands", None)
            assert inner is None or not more or more[0] in inner, f"{page.name}: apartment {words}"


INSTALLED = ("raspberry-pi.md", "security.md", "troubleshooting.md")  # pages for who has /etc/apartment
OWN = "install"  # it takes the configuration there by itself


def test_commands_for_an_installation_name_its_configuration() -> None:
    """In tables and blocks, from which they are copied: /opt/apartment has a configuration too, the example."""
    root: Any = typer.main.get_command(app)
    seen = 0
    for page in INSTALLED:
        text = (ROOT / "docs" / page).read_text("utf-8")
        rows = "\n".join(line for line in text.splitlines() if line.startswith("|"))
        blocks = "\n".join(re.findall(r"^```sh\n(.*?)^```", text, re.M | re.S))
        for line in [*re.findall(r"`([^`]*)`", rows), *blocks.splitlines()]:
            for words in re.findall(r"(?:^|[/ ])apartment ([a-z][^&;|#]*)", line):
                command, *more = words.split()
                made = getattr(root.commands[command], "commands", {}).get(more[0] if more else "")
                (option,) = [one for one in (made or root.commands[command]).params if "--config" in one.opts]
                if command != OWN and "does not read it" not in option.help:
                    seen += 1
                    assert "--config" in words, f"{page}: apartment {words}"
    assert seen > 10
