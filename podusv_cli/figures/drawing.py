"""Which figures there are, and drawing them into files."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from functools import cache, partial

import numpy as np

from podusv_cli.core import registry
from podusv_cli.core.errors import UsageError
from podusv_cli.core.phrases import unknown_word
from podusv_cli.core.plugins import Plugins
from podusv_cli.figures.sheet import Sheet
from podusv_cli.figures.shown import Shown
from podusv_cli.figures.style import FORMATS, Look, house_style, image
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.process.interrupts import interrupts_enabled
from podusv_cli.process.workers import Progress, run_shares


def _place(sheet: Sheet) -> tuple[int, str]:
    return sheet.place, sheet.name


@cache
def figures_with(plugins: Plugins) -> dict[str, Sheet]:
    """All figures by name, in order, with those of these plug-ins."""
    sheets = registry.find_by_name("podusv_cli.figures", Sheet, plugins).values()
    return {sheet.name: sheet for sheet in sorted(sheets, key=_place)}


FIGURES = figures_with(())
USUAL = ("trajectory", "errors", "path")  # a run has `errors`, or `path` on one that is followed
ALL = "all"  # in place of names
SCREEN = Look()
PHONE = "phone.png"  # a format of reports: a PNG one column wide


def figures_of(plugins: Iterable[Plugins]) -> dict[str, Sheet]:
    """All figures by name, in order, with those of the plug-ins of several runs."""
    return figures_with(tuple(dict.fromkeys(p for several in plugins for p in several)))


def choose_sheets(names: Sequence[str], runs: Sequence[Shown], extras: Extras) -> list[Sheet]:
    """The figures of these names or `ALL` that fit; without names, the `USUAL` and plug-ins' own.

    One that is named and that no run has signals for is noted as missing in `extras`.
    """
    known = figures_of(shown.run.plugins for shown in runs)
    fitting = {name: sheet for name, sheet in known.items() if sheet.fits(runs)}
    for name in (name for name in names if name not in (ALL, *fitting)):
        wanted = ", ".join(known[name].signals)
        extras.missing.append(Failure(f"figure {name}", f"no run logged any of {wanted}"))
    usual = [*USUAL, *(name for name in known if name not in FIGURES)]
    asked = fitting if ALL in names else names or usual
    return [fitting[name] for name in dict.fromkeys(asked) if name in fitting]


def draw(
    runs: Sequence[Shown], sheets: Iterable[Sheet], formats: Sequence[str], look: Look = SCREEN
) -> Iterator[tuple[str, bytes]]:
    """File name and content of each figure that fits the runs, in each of `formats`.

    `look` says size and style.
    """
    with house_style(look.style), np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of numbers near the end of all, as diverged runs have
        for sheet in (sheet for sheet in sheets if sheet.fits(runs)):
            figure = look.given_to(sheet.family(runs, look.columns))
            for form in formats:
                drawn = sheet.family(runs, 1) if form == PHONE else figure
                yield f"{sheet.name}.{form}", image(drawn, form.rpartition(".")[2])


def draw_in_parallel(
    runs: Sequence[Shown],
    sheets: Iterable[Sheet],
    formats: Sequence[str],
    extras: Extras,
    look: Look = SCREEN,
    progress: Progress = lambda fraction: None,
    workers: int = 0,
) -> dict[str, bytes]:
    """The files of `draw` by name, drawn in processes of their own.

    Each process draws several figures. A figure that fails is noted in `extras`. `progress` is
    called with the fraction of figures that are over. `workers` is how many processes draw at a
    time (0: one a core). Raises KeyboardInterrupt where one was interrupted.
    """
    sheets = tuple(sheets)

    def job(sheet: Sheet, tell: Progress) -> tuple[dict[str, bytes], list[Failure]]:
        """Draw one sheet in a process of its own: its files by name, and what failed."""
        # Of this process: what the other one notes comes back with the result.
        own = Extras()
        with interrupts_enabled():
            drawn = partial(draw, runs, [sheet], formats, look)
            files = own.make_or_record(f"figure {sheet.name}", lambda: dict(drawn()))
        return files or {}, own.missing

    outcomes = run_shares([partial(job, sheet) for sheet in sheets], progress, workers)
    if any(outcome.interrupted for outcome in outcomes):
        raise KeyboardInterrupt
    files_by_name: dict[str, bytes] = {}
    for sheet, outcome in zip(sheets, outcomes, strict=True):
        failed = [Failure(f"figure {sheet.name}", outcome.failure)]
        files, missing = outcome.result or ({}, failed)
        files_by_name |= files
        extras.missing += missing
    return files_by_name


def check_names(
    figures: Sequence[str], formats: Sequence[str], sheets: Iterable[str] = FIGURES
) -> None:
    """Raise UsageError for a figure or format that there is not; `sheets` are the known figures."""
    named = (*sheets, ALL)
    for what, names, known in (("figure", figures, named), ("format", formats, FORMATS)):
        for name in names:
            if name not in known:
                raise UsageError(unknown_word(f"{what} {name!r}", name, known, "podusv list"))
