"""What is worth a sentence about a finished search."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from podusv_cli.studies.counting.statistics import Interval, digits
from podusv_cli.studies.tuning.plan import ENOUGH, is_few
from podusv_cli.studies.tuning.results import MARGIN, SearchResults
from podusv_cli.studies.tuning.trials import FINISHED

ENOUGH_SEARCHES = 6  # with three, of 14 equal laws some are told apart in 40 % of all tables
ENOUGH_SETS = 5  # of training draws
BETTER = 0.8  # of the others' error: a law that ought to be noticed


def remarks(results: SearchResults) -> list[str]:
    """Sentences on the result: answer, what it depends on, what a user may want to change."""
    return [
        *_answer(results),
        *_power(results),
        *_remark_unsettled(results),
        *_once(results),
        *_bounds(results),
        *_remark_kept(results),
        *_idle(results),
        *_unsound(results),
        *_few(results),
        *_remark_overfitted(results),
        *_beyond(results),
    ]


def _answer(results: SearchResults) -> Iterator[str]:
    """The two best laws by the median of their searches, and in the same draw."""
    ranked = results.laws[results.laws.rank_after.notna()]
    ordered = ranked.sort_values("repeats_median").law.tolist()
    if len(ordered) < 2:
        return
    best, second = ordered[:2]
    rows: Any = results.searches.to_dict("records")
    # The pair may stand in the table in either order.
    for row in rows:
        if {row["a"], row["b"]} == {best, second}:
            yield (
                f"{best} has the least {results.plan.tune.objective} in the median of its "
                "searches; the ratio of the median "
                f"{results.plan.metrics[results.shown_metrics[0]].row} "
                f"({results.shown_metrics[0]}) of {row['a']} and {row['b']} over searches and "
                f"draws is {Interval.of(row, 'ratio'):.3f}: {_verdict(row)}"
            )


def _power(results: SearchResults) -> Iterator[str]:
    """Whether the laws differ at all, and what difference would have been noticed."""
    found = results.pairs_of_laws
    if math.isfinite(found.omnibus):
        yield (
            f"if all laws were equal, a largest difference like this had a probability of "
            f"{found.omnibus:.2g}; a law that is {1.0 - BETTER:.0%} better than all others would "
            f"have the first place for itself in {found.power(BETTER):.0%} of all such tables"
        )


def _remark_unsettled(results: SearchResults) -> Iterator[str]:
    """Laws that have no rank, since they seldom end at their target."""
    laws = results.laws[results.laws.rank_after.isna()].law
    if len(laws):
        yield (
            f"not ranked, since they do not end at their target in half of the fresh draws: "
            f"{', '.join(laws)}"
        )


def _once(results: SearchResults) -> Iterator[str]:
    """A warning where there are too few searches or training sets to order laws by."""
    tune = results.plan.tune
    if len(results.plan.laws) < 2:
        return
    if tune.searches < ENOUGH_SEARCHES:
        yield (
            f"searches of each law: {tune.searches}; so few do not tell how far another seed of "
            "the tuner would get, so no order of laws follows; give tune.repeats "
            f"{ENOUGH_SEARCHES} or more"
        )
    if tune.training_sets < ENOUGH_SETS:
        yield (
            f"training sets: {tune.training_sets}; other draws to train on may order the laws "
            f"otherwise; give tune.training_sets {ENOUGH_SETS} or more"
        )


def _verdict(row: dict[str, Any]) -> str:
    """Which law of a pair is better, by the interval of the ratio a / b of their objectives.

    Less is better. `row` is one of the table of `ratios`.
    """
    if row["ratio_high"] < 1.0:
        return f"{row['a']} is better"
    if row["ratio_low"] > 1.0:
        return f"{row['b']} is better"
    return "neither is better"


def _remark_kept(results: SearchResults) -> Iterator[str]:
    """Laws without gains."""
    for law in results.plan.laws:
        if law not in results.winners:
            yield f"{law} has no gains, kept as it is"


def _idle(results: SearchResults) -> Iterator[str]:
    """Gains that no run depends on."""
    for law, keys in results.plan.idle.items():
        if keys:
            yield f"{law}: not searched, since no run depends on them: {', '.join(keys)}"


def _unsound(results: SearchResults) -> Iterator[str]:
    """Laws whose best trial breaks an inequality, or has no value."""
    for law in results.winners:
        trial = results.winner(law)
        broken = [
            inequality.text
            for inequality, over in zip(results.plan.inequalities, trial.excesses, strict=True)
            if over > 0.0
        ]
        if broken:
            yield f"{law}: no trial held {' and '.join(broken)} on the training draws"
        elif not math.isfinite(trial.value):
            yield f"{law}: every trial failed on most draws; its gains mean nothing"


def _few(results: SearchResults) -> Iterator[str]:
    """Laws with too few whole trials for their gains."""
    few = []
    for law in results.winners:
        whole = min(sum(t.status == FINISHED for t in trials) for trials in results.trials[law])
        gains = len(results.plan.gains[law])
        if is_few(whole, gains):
            few.append(f"{law} {whole} for {gains} gains")
    if few:
        yield (
            f"fewer than {ENOUGH} trials on all draws for each gain, so chance has a part in what "
            f"was found: {', '.join(few)}; give a larger tune.budget"
        )


def _remark_overfitted(results: SearchResults) -> Iterator[str]:
    """Laws of which another search than the chosen one does better on fresh draws.

    The difference is over MARGIN.
    """
    for law in results.winners:
        reached = results.spread(law)
        taken = reached[results.winners[law].index(results.winner(law))]
        if taken > (1.0 + MARGIN) * min(reached):
            yield (
                f"{law}: the search that gained most on its training draws has "
                f"{digits(taken, '.4g')} on the fresh ones, another {digits(min(reached), '.4g')}; "
                "more draws for training "
                "(tune.train) may help"
            )


def _beyond(results: SearchResults) -> Iterator[str]:
    """Inequalities that the found gains hold on the training draws, and not on the fresh ones."""
    table = results.limits
    after: Any = table[table["when"] == "after"].to_dict("records")
    for row in after:
        if row["held_in_training"] and not row["holds"]:
            yield (
                f"{row['law']}: {row['inequality']} held on the training draws; on the fresh ones "
                f"it is {digits(row['value'], '.4g')}"
            )


def _bounds(results: SearchResults) -> Iterator[str]:
    """Gains that were found at an end of their range."""
    rows = results.gains[results.gains["at"] != ""].to_dict("records")
    at_ends = []
    for row in rows:
        end = row["low"] if row["at"] == "lower" else row["high"]
        at_ends.append(f"{row['law']}: {row['gain']} at the {row['at']} end, {end:.4g}")
    if at_ends:
        yield (
            "the table is not final, since gains are at an end of their range, and a wider one may "
            f"give more: {'; '.join(at_ends)}"
        )
