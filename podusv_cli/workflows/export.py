"""`podusv export`: the law of a scenario as C and as an FMU, with a run of it to check against."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector
from podusv_cli.core.phrases import unknown_word
from podusv_cli.core.recording import Recording
from podusv_cli.engine.running.simulate import to_end
from podusv_cli.export import c, objects
from podusv_cli.export.check import ABOUT, FMU, SAMPLES
from podusv_cli.export.fmu import fmu
from podusv_cli.export.law import ExportedLaw
from podusv_cli.export.link import linker, this_machine
from podusv_cli.findings.finding import unknown_codes
from podusv_cli.scenario.limits import limits
from podusv_cli.scenario.load import load
from podusv_cli.scenario.plugins import of_files
from podusv_cli.storage import csv_files
from podusv_cli.storage.run_folder import RunWriter
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import others, single


@dataclass(frozen=True)
class Products:
    """What an exported law is written as: C, an FMU, and for which platforms (none: the usual)."""

    c: bool = True
    fmu: bool = True
    platforms: Sequence[str] = ()


def export(config: Path, request: Request, products: Products = Products()) -> Path:
    """Write the law of a scenario into a folder, as `products` says; the folder.

    Raises ScenarioError, UsageError, LawError, StorageError.
    """
    platforms, linked = _platforms(products), _linkable_platforms(products) if products.fmu else {}
    too_large = limits(allow_large=False)
    checks, plugged = (unknown_codes, too_large), of_files(request.trust)
    loaded = load(config, request.overrides, checks, request.plugins, plugged).warn_of_remarks(
        request.say
    )
    scenario = single(loaded, request.controller)
    law = ExportedLaw.of(scenario)
    # The exported law's scenario logs every step, so it may be too large where this one is not.
    if too_large(replace(loaded, scenario=law.scenario)):
        raise UsageError(
            f"{scenario.name}: the run that an exported law is checked against logs every step, "
            f"too many of them in {scenario.simulation.duration:g} s; simulate less, as --set "
            "simulation.duration=100 [s]"
        )
    folder = request.out or Path(f"{Path(str(config).removeprefix('podusv:')).stem}-law")
    with RunWriter(folder, force=request.force, argv=request.argv) as writer:
        if names := ", ".join(others(loaded, request.controller)):
            request.say(f"exporting `controller`; --controller chooses among {names}")
        request.say("simulating the run that the law is checked against")
        law.scenario.ready()
        run = to_end(law.plan, compiled=law.scenario.simulation.compiled)
        seen = law.samples(run)
        # What the law answers outside of the loop, which users check their code against.
        samples = law.by_itself(seen)
        of_run = np.array_equal(samples, seen)
        for note in _notes(law, run, of_run):
            request.say(note)
        request.say(f"compiling {law.loop.controller.label} for {', '.join(platforms)}")
        text = objects.together(law.pieces)
        if products.c:
            for name, content in c.sources(law).items():
                writer.add(name, content.encode())
            for name in platforms:
                writer.add(f"{name}/law.o", objects.object_file(text, objects.PLATFORMS[name]))
        if products.fmu:
            writer.add(FMU, fmu(law, text, linked, law.inputs(samples)[0], request.say))
        writer.add(SAMPLES, _table(law, samples).encode())
        about = law.as_json(platforms, objects.library_functions(text))
        writer.add_json(ABOUT, {**about, "of_run": of_run})
        writer.add_origin(scenario.plugged)
        return writer.finish()


def _platforms(products: Products) -> Sequence[str]:
    """The platforms of the object files. Raises UsageError for an unknown one, or for no files."""
    for name in products.platforms:
        if name not in objects.PLATFORMS:
            raise UsageError(unknown_word(f"platform {name!r}", name, objects.PLATFORMS))
    if not (products.c or products.fmu):
        raise UsageError("--no-c and --no-fmu leave nothing to export; give one of them only")
    return tuple(dict.fromkeys(products.platforms)) or tuple(objects.PLATFORMS)


def _notes(law: ExportedLaw, run: Recording, of_run: bool) -> Iterator[str]:
    """Sentences that a user needs on the run and on the law by itself.

    `of_run` says whether both gave the same demands.
    """
    if run.status != "finished":
        yield f"the run {run.message}; {SAMPLES} has the samples before"
    if law.needs_loads:
        yield (
            f"{law.loop.controller.label} asks which loads acted: pass them to podusv_law_step; "
            "with NULL it assumes that its whole demand acted, and winds up where the actuator "
            "gives less"
        )
    if not of_run:
        yield (
            "the demands of the exported law differ from those in log.h5: it gets loads at its "
            f"samples alone, in the run also between them; check your code by {SAMPLES}, which has "
            "what the exported law answers"
        )


def _linkable_platforms(products: Products) -> Mapping[str, objects.Platform]:
    """The platforms of the FMU by name. Raises UsageError for one without libraries or a linker."""
    names = products.platforms or (this_machine(),)
    if "" in names:
        raise UsageError(
            "there is no export for this machine, so no FMU without zig: install it with pip "
            "install 'podusv[export]', or export with --no-fmu"
        )
    platforms = {name: objects.PLATFORMS[name] for name in names}
    if alone := [name for name, platform in platforms.items() if not platform.library]:
        raise UsageError(
            f"{alone[0]} has no shared libraries, so an FMU cannot hold the law for it; export it "
            "with --no-fmu"
        )
    for name, platform in platforms.items():
        linker(name, platform)
    return platforms


def _table(law: ExportedLaw, samples: Vector) -> str:
    """The samples with names and every bit."""
    return csv_files.lines([law.columns, *samples.tolist()])
