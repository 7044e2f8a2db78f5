"""`podusv capability`: the loads that a scenario's vessel holds at rest, kept in a folder."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from podusv_cli.core.errors import UsageError
from podusv_cli.findings.finding import unknown_codes
from podusv_cli.process.interrupts import interrupts_deferred
from podusv_cli.storage import csv_files
from podusv_cli.storage.run_folder import RunWriter, free_folder
from podusv_cli.theory.capability import ACCURACY, LOADS, Capability
from podusv_cli.theory.capability import capability as capability_of
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import RESULTS, open_scenario

TURN = 360.0  # deg
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class CapabilityOfScenario:
    """What is held, with directions in degrees, whether by a sway force, too, and where it lies."""

    found: Capability
    takes_sway: bool
    folder: Path

    @property
    def degrees(self) -> list[float]:
        """Where the load comes from [deg]."""
        return [round(angle, 9) for angle in np.degrees(self.found.angles).tolist()]

    def table(self) -> list[list[Any]]:
        """Headings with units, then a row for each direction."""
        unit = self.found.unit
        columns = [sizes.tolist() for sizes in self.found.held.values()]
        head = ["from [deg]", *(f"{name} [{unit}]" for name in self.found.held)]
        return [head, *map(list, zip(self.degrees, *columns, strict=True))]

    def least(self) -> dict[str, tuple[float, float]]:
        """The load that is held from every direction, and the direction [deg] that limits it.

        They are listed by thrusters. Of several directions, the first that is as low within the
        solver's accuracy.
        """
        least = {name: float(sizes.min()) for name, sizes in self.found.held.items()}
        first = {
            name: int(np.argmax(sizes <= least[name] * (1.0 + 2.0 * ACCURACY)))
            for name, sizes in self.found.held.items()
        }
        return {name: (size, self.degrees[first[name]]) for name, size in least.items()}

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints, and capability.json holds."""
        return {
            "format": 1,
            "folder": str(self.folder),
            "load": self.found.load,
            "unit": self.found.unit,
            "from_deg": self.degrees,
            "held": {name: sizes.tolist() for name, sizes in self.found.held.items()},
        }


def capability(
    config: Path, request: Request, load: str, every: float, progress: Progress | None = None
) -> CapabilityOfScenario:
    """The largest `load` that is held from directions `every` degrees, written to a folder.

    `load` is one of LOADS by name. Raises ScenarioError, StorageError, and UsageError for a run
    folder, for degrees that do not divide a turn, and as `theory.capability`.
    """
    if (config / "resolved.yaml").is_file():
        raise UsageError(f"{config} is a run folder; give its resolved.yaml")
    count = round(TURN / every)
    if not math.isclose(count * every, TURN):
        # Divisors of a turn in hundredths of a degree, from 0.1 to 180 deg, for the hint.
        whole = [hundredths for hundredths in range(10, 18001) if 36000 % hundredths == 0]
        near = min(whole, key=lambda hundredths: abs(hundredths - 100.0 * every)) / 100.0
        raise UsageError(
            f"--every {every:g}: {every:g} deg do not divide a turn of 360 deg; give {near:g}"
        )
    scenario = open_scenario(config, request, (unknown_codes,)).scenario
    _check_formats(request.formats)
    target = request.out or free_folder(RESULTS / scenario.name / "capability")
    with RunWriter(target, force=request.force, argv=request.argv) as writer:
        found = capability_of(
            scenario.vessel,
            scenario.actuator,
            load,
            np.radians(every * np.arange(count)),
            own=scenario.sea,
            progress=progress,
        )
        with interrupts_deferred():
            done = CapabilityOfScenario(found, scenario.actuator.takes_sway, target)
            _write(writer, done, request.formats)
            writer.add_origin(scenario.plugged)
            return replace(done, folder=writer.finish())


def _check_formats(formats: Any) -> None:
    """Raises UsageError for a format of images that there is not."""
    from podusv_cli.figures.drawing import check_names  # matplotlib is slow to import

    check_names((), formats)


def _write(writer: RunWriter, done: CapabilityOfScenario, formats: Any) -> None:
    """Write the result as JSON and CSV, and its figure in each of `formats` (png, ...)."""
    from podusv_cli.figures.capability import polar  # matplotlib is slow to import
    from podusv_cli.figures.style import house_style, image

    writer.add_json("capability.json", done.as_json())
    writer.add("capability.csv", csv_files.lines(done.table(), "%.6g").encode())
    words = f"{LOADS[done.found.load].words} [{done.found.unit}]"
    with house_style():
        figure = polar(done.found, words)
        for form in formats:
            writer.add(f"figures/capability.{form}", image(figure, form))
