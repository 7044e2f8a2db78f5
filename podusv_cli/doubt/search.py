"""The walk: every choice alone, then all at once, with a judge that is handed in."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from podusv_cli.core.about import Claim
from podusv_cli.core.errors import PodusvError
from podusv_cli.doubt.alone import TriedChoice, explore_choice
from podusv_cli.doubt.answer import Tried
from podusv_cli.doubt.choices import Choice
from podusv_cli.doubt.compared import ClaimNumber, compared_numbers
from podusv_cli.doubt.judged import Judge, Judged
from podusv_cli.doubt.together import Draws, draw_worlds
from podusv_cli.process.interrupts import interrupts_enabled
from podusv_cli.process.workers import Job, run_shares
from podusv_cli.scenario.doubt import Doubt

BATCH = 10  # draws that a process makes before it tells


def search(
    claims: Mapping[str, Claim],
    moving: Sequence[Choice],
    judge: Judge,
    doubt: Doubt,
    workers: int = 0,
    progress: Callable[[str, float], None] | None = None,
) -> Tried:
    """Try every choice alone, and draw all at once; what is tried is shorter after an interrupt.

    `claims` are by name, `moving` the choices. `judge` says what the claims answer in a world.
    `workers` is the number of processes, 0 for as many as there are cores. `progress` is called
    with what is tried and the fraction done.
    """
    base = judge({})
    numbers = {
        name: compared_numbers(claim.expect, claim.tolerance) for name, claim in claims.items()
    }
    draws = draw_worlds(moving, doubt.seed, doubt.draws)
    tell = progress or (lambda what, fraction: None)
    alone = _results_of(
        [partial(_explore_choice, choice, judge, base, numbers) for choice in moving],
        partial(tell, "one at a time"),
        workers,
    )
    parts = [range(i, min(i + BATCH, doubt.draws)) for i in range(0, doubt.draws, BATCH)]
    worlds = _results_of(
        [partial(_judge_draws, draws, part, judge) for part in parts],
        partial(tell, "all at once"),
        workers,
    )
    return Tried(base, alone, draws, [world for part in worlds for world in part])


def _results_of(jobs: Sequence[Job], progress: Callable[[float], None], workers: int) -> list[Any]:
    """The results of jobs, in their order, up to the first without one.

    A job has none where it was interrupted. Raises PodusvError for a failed one.
    """
    outcomes = run_shares(jobs, progress, workers)
    for outcome in outcomes:
        if outcome.failure and not outcome.interrupted:
            raise PodusvError(outcome.failure)
    ended = next((i for i, outcome in enumerate(outcomes) if outcome.result is None), len(outcomes))
    return [outcome.result for outcome in outcomes[:ended]]


def _explore_choice(
    choice: Choice,
    judge: Judge,
    base: Judged,
    numbers: Mapping[str, Sequence[ClaimNumber]],
    tell: Callable[[float], None],
) -> TriedChoice:
    """`explore_choice` as a job of a process, which an interrupt ends at once.

    The arguments are its own; `tell` is not called, as a job has to take it.
    """
    with interrupts_enabled():
        return explore_choice(choice, judge, base, numbers)


def _judge_draws(
    draws: Draws, part: range, judge: Judge, tell: Callable[[float], None]
) -> list[Judged]:
    with interrupts_enabled():
        return [judge(draws.world(i)) for i in part]
