"""Gains that change no run: a search would only spend its runs on them.

A law has numbers that its options leave unread, and limits that nothing reaches. At some points of
the space, the scenario's own gains first, every gain goes to the ends of its range, while the
others stay. One that changes no metric of any run, bit for bit, is idle.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from podusv_cli.core.errors import PodusvError
from podusv_cli.process.workers import Progress, run_all
from podusv_cli.studies.counting.runs import Unit, UnitResult
from podusv_cli.studies.making.draws import uniforms
from podusv_cli.studies.making.unit import make
from podusv_cli.studies.tuning.plan import TRAIN, TunePlan
from podusv_cli.studies.tuning.space import Gain, with_gains

POINTS = 8  # of the space, each with a training draw of its own
STREAM = "idle gains"  # of the random numbers of the points

Gains = Mapping[str, Any]


def find_idle(plan: TunePlan, workers: int) -> dict[str, tuple[str, ...]]:
    """The keys of the idle gains of every law that has gains.

    The runs are made in processes of their own. Of a law that ends its process, none is idle.
    Raises KeyboardInterrupt, and PodusvError where a run cannot be made at all.
    """
    laws = [law for law, gains in plan.gains.items() if gains]
    outcomes = run_all([partial(_of_law, plan, law) for law in laws], workers=workers)
    if any(outcome.interrupted for outcome in outcomes):
        raise KeyboardInterrupt
    for outcome in outcomes:
        if outcome.failure and not outcome.killed:
            raise PodusvError(outcome.failure)
    return {law: outcome.result or () for law, outcome in zip(laws, outcomes, strict=True)}


def _of_law(plan: TunePlan, law: str, progress: Progress) -> tuple[str, ...]:
    """The keys of the gains of a law that change no run when they change."""
    left = list(plan.gains[law])
    for place, point in enumerate(_points(plan, law)):
        run = partial(_run, plan, law, place % plan.tune.train)
        # A law may refuse a point; then the next one has to tell.
        if left and (own := run(point)):
            left = [gain for gain in left if not _matters(run, own, point, gain)]
    return tuple(gain.key for gain in left)


def _points(plan: TunePlan, law: str) -> Iterator[Gains]:
    """Gains to try: the scenario's own, then POINTS - 1 random points of the space."""
    gains = plan.gains[law]
    yield {gain.key: gain.own for gain in gains}
    assert plan.scenario.sweep
    seed = plan.scenario.sweep.seed
    drawn = {
        gain.key: uniforms(seed, f"{law}.{gain.key}", 0, POINTS - 1, STREAM).tolist()
        for gain in gains
    }
    for place in range(POINTS - 1):
        yield {gain.key: gain.at(drawn[gain.key][place]) for gain in gains}


def _matters(run: Any, own: UnitResult, point: Gains, gain: Gain) -> bool:
    """Whether `gain` changes the run at an end of its range, or one of its words does.

    The other gains stay as at `point`, whose run has the result `own`. `run` takes gains and
    returns a result, or None where the law refuses them; a refused end counts as a change.
    """
    others = (run({**point, gain.key: end}) for end in gain.ends)
    return any(other is None or _differ(own, other) for other in others)


def _run(plan: TunePlan, law: str, draw: int, gains: Gains) -> UnitResult | None:
    """One run with these gains in training draw number `draw`; None where the law refuses them."""
    if with_gains(plan.laws[law], gains) is None:
        return None
    return make(plan.variant({law: (law, gains)}, TRAIN, draw + 1), Unit(law, 0, draw, 1))


def _differ(one: UnitResult, other: UnitResult) -> bool:
    """Whether two results differ in any bit; NaN equals NaN."""

    def numbers(result: UnitResult) -> Sequence[Any]:
        return [result.status, result.until, *result.metrics.values()]

    pairs = zip(numbers(one), numbers(other), strict=True)
    return not all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)
