"""An exported law as a functional mock-up unit: FMI 2.0 for co-simulation."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from podusv_cli.export import c, objects
from podusv_cli.export.law import LOAD_NUMBERS, STATE_NUMBERS, ExportedLaw
from podusv_cli.export.link import shared_library, waiting

STAMP = (1980, 1, 1, 0, 0, 0)  # of files in the archive: the same law gives the same bytes
DIGITS = 32  # of the guid


class Variable(NamedTuple):
    """A variable of modelDescription.xml."""

    name: str
    unit: str
    meaning: str
    causality: str
    start: str | None = None


def variables(law: ExportedLaw, first: Sequence[float]) -> list[Variable]:
    """Inputs, then demand, signals and memory: a variable's place is its reference.

    `first` are the inputs of the run's first sample, at which they begin.
    """
    numbers = [*STATE_NUMBERS, *law.targets, *(LOAD_NUMBERS if law.needs_loads else ())]
    given = [
        Variable(*number, "input", repr(float(start)))
        for number, start in zip(numbers, first, strict=False)
    ]
    said = [Variable(*number, "output") for number in (*law.demands, *law.signals)]
    return [*given, *said, *(Variable(*number, "local") for number in law.memory)]


def fmu(
    law: ExportedLaw,
    text: str,
    platforms: Mapping[str, objects.Platform],
    first: Sequence[float],
    say: Callable[[str], None] = lambda line: None,
) -> bytes:
    """The archive with a library for each platform, of the law's module `text`.

    `first` as in `variables`; `say` is called before each platform. Raises UsageError where a
    library cannot be linked.
    """
    shown = variables(law, first)
    starts = [c.literal(float(variable.start)) for variable in shown if variable.start is not None]
    sources = c.sources(law)
    content = "".join([text, *sources.values(), *starts])  # all that makes one FMU another
    about = {
        **c.template_values(law),
        "guid": hashlib.sha256(content.encode()).hexdigest()[:DIGITS],
        "units": sorted({variable.unit for variable in shown} - {"", "1"}),
        "variables": shown,
        "starts": starts,
        "loads": law.needs_loads,
        "outputs": [i for i, variable in enumerate(shown, 1) if variable.causality == "output"],
        "exact_period": c.literal(law.period),
        "stop": repr(law.scenario.simulation.duration),
    }
    files = {**sources, "fmu.c": c.render_file("fmu.c", about)}
    members = {"modelDescription.xml": c.render_file("modelDescription.xml", about).encode()}
    for name, platform in platforms.items():
        inside = {file: part.encode() for file, part in files.items()}
        inside["law.o"] = objects.object_file(text, platform)
        say(f"linking the FMU for {name}{waiting(name, platform)}")
        library = shared_library(inside, name, platform)
        members[f"binaries/{name}/law{platform.library}"] = library
    return _archive(members)


def _archive(members: Mapping[str, bytes]) -> bytes:
    """A ZIP archive with the same bytes whenever it is made."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name, STAMP), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
