"""What a shell completes."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from services.__main__ import app
from services.errors import ConfigError
from services.simulated import CONFIG
from tests.command_line.terminal import LIMIT_S, ROOT

APARTMENT = f"""#!/bin/sh
exec {sys.executable} -c "import sys; sys.argv[0] = 'apartment'; from services.__main__ import main; main()" "$@"
"""
SIMULATED = f"--config {CONFIG}/simulated.yaml"


LINES = {
    "apartment rec": {"record"},
    f"apartment order {SIMULATED} i": {"ip1"},
    f"apartment scan {SIMULATED} ip1 --target 5": {"582"},
    f"apartment history {SIMULATED} Kitchen_Li": {"Kitchen_Light"},
    "apartment watch robot/+/go": {"robot/+/goto", "robot/+/goto/result"},
    "apartment order ": set(),  # no configuration here: nothing, and no word about it
}


def test_bash_completes_what_the_configuration_has(tmp_path: Path) -> None:
    program = tmp_path / "apartment"
    program.write_text(APARTMENT, encoding="utf-8")
    program.chmod(0o755)
    script = ['eval "$(apartment completion bash)"', "complete -p apartment > /dev/null || exit 1"]
    for line in LINES:
        words = line.split(" ")
        script.append(f"COMP_WORDS=({' '.join(map(shlex.quote, words))}); COMP_CWORD={len(words) - 1}; COMPREPLY=()")
        script.append("_apartment_completion apartment; echo ${COMPREPLY[*]}")
    environment = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        ["bash", "-c", "\n".join(script)],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=4 * LIMIT_S,
    )
    assert (done.returncode, done.stderr) == (0, "")
    offered = [set(one.split()) for one in done.stdout.split("\n")]
    assert dict(zip(LINES, offered, strict=False)) == LINES


@pytest.mark.parametrize(("shell", "words"), [("zsh", "compdef"), ("fish", "complete --command apartment")])
def test_other_shells_have_a_script(shell: str, words: str) -> None:
    done = CliRunner().invoke(app, ["completion", shell])
    assert (done.exit_code, words in done.stdout) == (0, True)
    assert "_APARTMENT_COMPLETE" in done.stdout


def test_an_unknown_shell_is_refused() -> None:
    assert isinstance(CliRunner().invoke(app, ["completion", "csh"]).exception, ConfigError)
