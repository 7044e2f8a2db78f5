"""Completion of commands and options in a shell."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from test_cli_words import HEAVY, LOADED, ROOT

from podusv_cli import cli

PODUSV = f"'{sys.executable}' -m podusv_cli"
needs_bash = pytest.mark.skipif(not shutil.which("bash"), reason="there is no bash here")


def said(*words: str, home: Path, **more: str) -> str:
    """What a process prints, which has to end well."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "HOME": str(home), **more}
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout


@needs_bash
def test_completion_is_installed_once_for_the_shell_that_asks(tmp_path: Path) -> None:
    for _ in range(2):
        # Something after it keeps bash from giving its process away.
        out = said("bash", "-c", f"{PODUSV} --install-completion; true", home=tmp_path)
        assert "bash completion installed" in out
    (line,) = filter(None, (tmp_path / ".bashrc").read_text().splitlines())
    script = Path(line.removeprefix("source ").strip("'"))
    assert script.is_relative_to(tmp_path)
    assert "complete -o default" in script.read_text()


def offered_for(typed: str, home: Path, script: str) -> list[str]:
    """The lines that a shell gets from a script for what is typed."""
    count = str(typed.count(" "))
    asked = {"_PODUSV_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": count}
    script = script.replace("import sys", "import sys\nsys.argv = ['podusv']", 1)
    return said(sys.executable, "-c", script, home=home, **asked).splitlines()


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("podusv ", {*cli.COMMANDS, "sweep"}),
        ("podusv sweep ", {"run", "status", "report", "merge", "draw", "export"}),
        ("podusv sweep run --un", {"--until"}),
        ("podusv ver", {"verify"}),
        ("podusv run --al", {"--allow-large"}),
        ("podusv run --s", {"--set"}),
    ],
)
def test_commands_and_options_are_offered_and_nothing_heavy_is_imported(
    tmp_path: Path, typed: str, offered: set[str]
) -> None:
    *found, modules = offered_for(typed, tmp_path, LOADED)
    assert set(found) == offered
    # Typer itself takes pydantic to understand what has been typed.
    assert HEAVY & set(ast.literal_eval(modules)) <= {"pydantic"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("podusv run a.yaml --set control.p", {"control.period="}),
        ("podusv run a.yaml --set actuator.kind=s", {"actuator.kind=saturated"}),
        ("podusv verify a.yaml --set vessel.preset=ot", {"vessel.preset=otter"}),
        ("podusv compare a.yaml --set log.mon", {"log.monitor=true", "log.monitor=false"}),
        ("podusv plot x --figure sta", {"stability"}),
        ("podusv explain ia", {"iae", "iae_e", "iae_of_optimum"}),
        ("podusv explain near-t", {"near-target"}),
        ("podusv explain controller.pid.K_P", {"controller.pid.K_Pu", "controller.pid.K_Pr"}),
        ("podusv init pod/k", {"pod/kept"}),
        ("podusv list me", {"measurements", "metrics"}),
        ("podusv sweep export x --format p", {"parquet"}),
        ("podusv sweep run a.yaml --set control.p", {"control.period="}),
    ],
)  # fmt: skip
def test_keys_kinds_figures_and_names_are_offered(
    tmp_path: Path, typed: str, offered: set[str]
) -> None:
    script = "import sys\nfrom podusv_cli import cli\ncli.main()"
    assert set(offered_for(typed, tmp_path, script)) == offered
