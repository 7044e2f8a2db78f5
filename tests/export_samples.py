"""Exported laws for tests: the paper's task with a law that takes samples, as a folder."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from command_samples import ROOT
from conftest import REQUIRED

import podusv
from podusv_cli.export import link
from podusv_cli.workflows import export as workflow

SOURCE, OTTER = "podusv:mu_2017/corrected.yaml", "podusv:pod/vessels/otter.yaml"
CC = "cc -std=c99 -Wall -Wextra -pedantic -Werror -O2 -ffp-contract=off"
HARDWARE = ROOT / "examples/hardware_in_the_loop"
needs_cc = pytest.mark.skipif(not shutil.which("cc"), reason="needs a C compiler")


def law(kind: str) -> dict[str, Any]:
    """A law with what it has no defaults for."""
    return {"kind": kind, **REQUIRED.get(kind, {})}


def scenario(kind: str, **changes: Any) -> Any:
    """The paper's task with a law that takes samples."""
    base = {"control.period": 0.1, "simulation.duration": 30.0, "controller": law(kind)}
    return podusv.load(SOURCE, {**base, **changes})


def task(kind: str, seconds: int = 300) -> tuple[str, str, str]:
    """What makes of the paper's task one for a law that takes samples."""
    given = f"controller={json.dumps(law(kind))}"
    return "control.period=0.1", f"simulation.duration={seconds}", given


def exported(
    to: Path, kind: str = "pid", source: str = SOURCE, changes: dict[str, Any] | None = None,
    **options: Any,
) -> Path:  # fmt: skip
    """The folder of a small export for this machine; of other changes in place of the `kind`."""
    options = {"fmu": False, "platforms": [link.this_machine()]} | options
    given = [f"{key}={json.dumps(value)}" for key, value in (changes or {}).items()]
    return workflow.export(Path(source), workflow.Request(to, given or task(kind, 5), **options))
