"""`podusv margins`: loop margins of a scenario's laws, printed and kept in a folder."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from podusv_cli.core.errors import LawError, NotConvergedError, UsageError
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.findings.finding import unknown_codes
from podusv_cli.metrics.margins import OF_LOOP
from podusv_cli.process.interrupts import interrupts_deferred
from podusv_cli.scenario.limits import limits
from podusv_cli.storage import csv_files
from podusv_cli.storage.run_folder import RunWriter
from podusv_cli.theory.loop_margins import LoopMargins, loop_margins
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import open_scenario, single


@dataclass(frozen=True)
class MarginsOfLaws:
    """Margins of each law by its label, and why there are none for the others."""

    laws: Mapping[str, LoopMargins]
    failed: Mapping[str, str]
    folder: Path | None = None

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints, and margins.json holds."""
        return {
            "format": 1,
            "folder": None if self.folder is None else str(self.folder),
            "laws": {label: _as_json(law) for label, law in self.laws.items()},
            "failed": dict(self.failed),
        }


def _as_json(law: LoopMargins) -> dict[str, Any]:
    """A law's margins as the JSON of `podusv margins`, all in SI units."""
    linear = law.linear
    return {
        "at": linear.course.time,
        "speed": linear.course.speed,
        "turn": linear.course.turn,
        "z_e": linear.distance,
        "motion": linear.motion,
        "load": linear.load,
        "left_out": law.left_out,
        "open": law.open,
        "stable": law.stable,
        "poles": [[pole.real, pole.imag] for pole in law.poles],
        "crossovers": {axis: loop.crossovers for axis, loop in law.loops.items()},
        "margins": law.numbers(),
    }


def margins(config: Path, request: Request, at: float | None = None) -> MarginsOfLaws:
    """The margins of all laws of a scenario, or of `request.controller`, written to `request.out`.

    Nothing is written without `request.out`. `at` [s] is when the steady motion begins. Raises
    ScenarioError, StorageError, UsageError for a run folder, a time after the run, an unknown law
    or format. Where no law has margins it raises what is wrong with the first: LawError for a law
    that takes samples, NotConvergedError where there is no steady motion.
    """
    if (config / "resolved.yaml").is_file():
        raise UsageError(f"{config} is a run folder; give its resolved.yaml")
    checks = (unknown_codes, limits(insist=""))
    loaded = open_scenario(config, request, checks)
    duration, label = loaded.scenario.simulation.duration, request.controller
    if at is not None and at > duration:
        raise UsageError(f"--at {at:g}: the run ends at {duration:g} s; give an earlier time")
    plans = {label: loaded.plan(single(loaded, label))} if label else loaded.plans
    find = partial(_of_laws, plans, at, compiled=loaded.scenario.simulation.compiled)
    if request.out is None:
        return find()
    _check_formats(request.formats)
    with RunWriter(request.out, force=request.force, argv=request.argv) as writer:
        result = find()
        with interrupts_deferred():
            _write(writer, result, request.formats)
            writer.add_origin(loaded.scenario.plugged)
            return replace(result, folder=writer.finish())


def _of_laws(plans: Mapping[str, Plan], at: float | None, *, compiled: bool) -> MarginsOfLaws:
    """Margins of each law at the time `at` [s]; raises the first error if none has any."""
    laws: dict[str, LoopMargins] = {}
    failed: dict[str, LawError | NotConvergedError] = {}
    for label, plan in plans.items():
        try:
            laws[label] = loop_margins(plan.loop, plan.grid, at, compiled=compiled)
        except (LawError, NotConvergedError) as error:
            failed[label] = error
    if not laws:
        raise next(iter(failed.values()))
    return MarginsOfLaws(laws, {label: str(error) for label, error in failed.items()})


def _check_formats(formats: Sequence[str]) -> None:
    """Raises UsageError for a format of images that there is not."""
    from podusv_cli.figures.drawing import check_names  # matplotlib is slow to import

    check_names((), formats)


def _write(writer: RunWriter, result: MarginsOfLaws, formats: Sequence[str]) -> None:
    """Margins as JSON and CSV, the curves, and the figure in each format."""
    from podusv_cli.figures.margins import sensitivities  # matplotlib is slow to import
    from podusv_cli.figures.style import house_style, image

    writer.add_json("margins.json", result.as_json())
    columns = [law.numbers() for law in result.laws.values()]
    rows = [
        [name, OF_LOOP[name].unit, *(numbers.get(name, math.nan) for numbers in columns)]
        for name in OF_LOOP
        if any(name in numbers for numbers in columns)
    ]
    writer.add("margins.csv", csv_files.lines([["margin", "unit", *result.laws], *rows]).encode())
    with house_style():
        figure = sensitivities(result.laws)
        for form in formats:
            writer.add(f"figures/sensitivities.{form}", image(figure, form))
