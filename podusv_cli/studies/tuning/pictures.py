"""Which figures a search has, with their captions."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import pandas as pd

from podusv_cli.pages.page import Picture
from podusv_cli.process.extras import Extras
from podusv_cli.studies.study.pictures import COLUMNS, Sketch, rendered
from podusv_cli.studies.tuning.results import Results
from podusv_cli.studies.tuning.space import units_of
from podusv_cli.studies.tuning.trials import front


def drawn(results: Results, extras: Extras) -> tuple[dict[str, bytes], list[Picture]]:
    """All figures: PNG by file name, and as pictures."""
    return rendered(lambda: list(sketches(results)), extras)


def sketches(results: Results) -> Iterator[Sketch]:
    """The figures that there are numbers for."""
    from podusv_cli.studies.tuning import figures  # matplotlib is slow to import

    objective = results.plan.tune.objectives[0]
    yield Sketch(
        "validation",
        f"{objective} on the fresh draws, before (hollow) and after the search (filled), with "
        f"{100 * results.level:g} % intervals",
        partial(figures.before_and_after, results.laws, results.label(0), COLUMNS),
    )
    if results.winners:
        yield from _of_searches(results, objective)


def _of_searches(results: Results, objective: str) -> Iterator[Sketch]:
    from podusv_cli.studies.study.figures import ratios
    from podusv_cli.studies.tuning import figures

    yield Sketch(
        "history",
        f"best {objective} on the training draws so far, a curve for each repeat: the curves begin "
        "with the scenario's gains; one rises where a trial holds the inequalities better",
        partial(figures.history, results.history, results.label(0), COLUMNS),
    )
    rows = results.pairs[(results.pairs["when"] == "tuning")]
    rows = rows[rows.metric == (results.shown[0])]
    if len(rows):
        yield Sketch(
            "ratios",
            f"what the search changed in {results.shown[0]}: the median ratio of each law after "
            "and before in the same fresh draw, with its interval; below 1 is better",
            partial(ratios, rows, COLUMNS),
        )
    if len(results.plan.objectives) > 1:
        yield _front(results)
    if len(results.importance):
        yield Sketch(
            "importance",
            "importance of each gain: the share of the variation between good trials and all that "
            "it explains (PED-ANOVA); the lines go from the least to the most of all repeats and "
            "parts of the trials",
            partial(figures.importance, results.importance, COLUMNS),
        )
    for law in results.winners:
        yield _slices(results, law, objective)


def _front(results: Results) -> Sketch:
    from podusv_cli.studies.tuning import figures

    points = {
        law: np.array(sorted(t.values for trials in all_ for t in front(trials))).reshape(-1, 2)
        for law, all_ in results.trials.items()
    }
    taken = {law: results.winner(law).values for law in results.winners}
    first = {law: all_[0][0].values for law, all_ in results.trials.items()}
    labels = results.label(0), results.label(1)
    return Sketch(
        "front",
        "Pareto front of the training draws: trials that no other trial of the law is better than "
        "in both objectives; a star is what was taken, a cross are the scenario's gains",
        partial(figures.pareto, points, taken, first, labels, COLUMNS),
    )


def _slices(results: Results, law: str, objective: str) -> Sketch:
    from podusv_cli.studies.tuning import figures

    tried = pd.DataFrame(
        [
            {**trial.gains, "objective": trial.values[0], "repeat": repeat}
            for repeat, trials in enumerate(results.trials[law]) for trial in trials
        ]
    )  # fmt: skip
    return Sketch(
        f"slices-{law}",
        f"every trial of {law} by each of its gains: {objective} over the draws that the trial "
        "met, a colour for each repeat; the full line is the gain that was found, the broken one "
        "the scenario's",
        partial(
            figures.slices, tried, results.plan.gains[law], results.winner(law).gains,
            results.label(0), units_of(results.plan.laws[law]), COLUMNS,
        ),
    )  # fmt: skip
