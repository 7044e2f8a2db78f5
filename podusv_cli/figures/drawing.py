"""Which figures there are, and drawing them into files."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache, partial

import numpy as np

from podusv_cli.core import registry
from podusv_cli.core.errors import UsageError
from podusv_cli.core.plugins import Plugins
from podusv_cli.figures.sheet import Sheet
from podusv_cli.figures.shown import Shown
from podusv_cli.figures.style import FORMATS, house_style, image
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.process.interrupts import interrupts_enabled
from podusv_cli.process.workers import run_shares
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.phrases import unknown


def _place(sheet: Sheet) -> tuple[int, str]:
    return sheet.place, sheet.name


@cache
def figures_with(plugins: Plugins) -> dict[str, Sheet]:
    """All figures by name, in order, with those of these plug-ins."""
    found = registry.named("podusv_cli.figures", Sheet, plugins).values()
    return {sheet.name: sheet for sheet in sorted(found, key=_place)}


FIGURES = figures_with(())


def figures_of(scenarios: Iterable[Scenario]) -> dict[str, Sheet]:
    """All figures by name, in order, with those of these scenarios' plug-ins."""
    return figures_with(tuple(dict.fromkeys(p for one in scenarios for p in one.plugged)))


def draw(
    runs: Sequence[Shown], names: Iterable[str], formats: Sequence[str], columns: int = 2
) -> Iterator[tuple[str, bytes]]:
    """File name and content of each figure that fits the runs, in each format."""
    with house_style(), np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of numbers near the end of all, as diverged runs have
        known = figures_of(run.scenario for run in runs)
        for name in (name for name in names if known[name].fits(runs)):
            figure = known[name].family(runs, columns)
            for form in formats:
                yield f"{name}.{form}", image(figure, form)


def draw_in_parallel(
    runs: Sequence[Shown], names: Iterable[str], formats: Sequence[str], extras: Extras,
    columns: int = 2, progress: Callable[[float], None] = lambda fraction: None, workers: int = 0,
) -> dict[str, bytes]:  # fmt: skip
    """The same as `draw`, in processes of their own, each of which draws several figures.

    A figure that fails is missing among the `extras`. `progress` is called with the fraction of
    figures that are over. Raises KeyboardInterrupt where one was interrupted.
    """
    names = tuple(names)

    def job(name: str, tell: Callable[[float], None]) -> tuple[dict[str, bytes], list[Failure]]:
        own = Extras()
        with interrupts_enabled():
            files = own.made(f"figure {name}", lambda: dict(draw(runs, [name], formats, columns)))
        return files or {}, own.missing

    outcomes = run_shares([partial(job, name) for name in names], progress, workers)
    if any(outcome.interrupted for outcome in outcomes):
        raise KeyboardInterrupt
    found: dict[str, bytes] = {}
    for name, outcome in zip(names, outcomes, strict=True):
        files, missing = outcome.result or ({}, [Failure(f"figure {name}", outcome.failure)])
        found |= files
        extras.missing += missing
    return found


def check_names(
    figures: Sequence[str], formats: Sequence[str], sheets: Iterable[str] = FIGURES
) -> None:
    """UsageError for a figure, of all `sheets`, or format that there is not."""
    for what, names, known in (("figure", figures, tuple(sheets)), ("format", formats, FORMATS)):
        for name in names:
            if name not in known:
                raise UsageError(unknown(f"{what} {name!r}", name, known, "podusv list"))
