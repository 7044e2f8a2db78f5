"""Exported laws for tests: the paper's task with a law that takes samples, as a folder."""

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from command_samples import ROOT
from conftest import REQUIRED, example

import podusv
from podusv_cli.components.controllers.base import Controller
from podusv_cli.core import registry
from podusv_cli.export import link
from podusv_cli.workflows import export as workflow
from podusv_cli.workflows.request import Request

KINDS = registry.kinds("podusv_cli.components.controllers", Controller)
SOURCE, OTTER = "podusv:mu_2017/corrected.yaml", "podusv:pod/vessels/otter.yaml"
CC = "cc -std=c99 -Wall -Wextra -pedantic -Werror -O2 -ffp-contract=off"
HARDWARE = ROOT / "examples/hardware_in_the_loop"
needs_cc = pytest.mark.skipif(not shutil.which("cc"), reason="needs a C compiler")


def law(kind: str) -> dict[str, Any]:
    """A law with what it has no defaults for."""
    return {"kind": kind, **REQUIRED.get(kind, {})}


def around(kind: str) -> dict[str, Any]:
    """The path and the actuator that a law of poses needs in the paper's task."""
    if not example(KINDS[kind]).asks_sway():
        return {}
    poses = [[-10.0, -10.0, 0.0], [-8.0, -11.0, 2.4], [-9.0, -9.0, 3.3]]
    limits = {"surge_limit": 40.0, "sway_limit": 8.0, "yaw_limit": 5.0}
    return {
        "path": {"kind": "poses", "poses": poses, "travel": 5.0, "dwell": 1.7},
        "actuator": {"kind": "saturated_full", **limits},
    }


def scenario(kind: str, **changes: Any) -> Any:
    """The paper's task with a law that takes samples."""
    base = {"control.period": 0.1, "simulation.duration": 30.0, "controller": law(kind)}
    return podusv.load(SOURCE, {**base, **around(kind), **changes})


def task(kind: str, seconds: int = 300) -> tuple[str, ...]:
    """What makes of the paper's task one for a law that takes samples."""
    given = {"controller": law(kind), **around(kind)}
    parts = [f"{key}={json.dumps(value)}" for key, value in given.items()]
    return "control.period=0.1", f"simulation.duration={seconds}", *parts


def exported(
    to: Path,
    kind: str = "pid",
    source: str = SOURCE,
    changes: dict[str, Any] | None = None,
    **options: Any,
) -> Path:
    """The folder of a small export for this machine; of other changes in place of the `kind`."""
    given = [f"{key}={json.dumps(value)}" for key, value in (changes or {}).items()]
    return export_law(Path(source), to, given or task(kind, 5), **{"fmu": False} | options)


def export_law(
    source: Path,
    to: Path,
    overrides: Sequence[str] = (),
    *,
    c: bool = True,
    fmu: bool = True,
    platforms: Sequence[str] | None = None,
    **options: Any,
) -> Path:
    """The folder of an export, for this machine where no platforms are given."""
    wanted = [link.this_machine()] if platforms is None else platforms
    products = workflow.Products(c, fmu, wanted)
    return workflow.export(source, Request(overrides, to, **options), products)
