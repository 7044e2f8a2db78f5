"""What one would use instead: podusv's own plain Python, numpy with RK4, scipy's solve_ivp."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from benchmarks.c_program import TOLERANCE
from benchmarks.cases import LAWS, Case, grid
from benchmarks.plain import Loop, rk4
from benchmarks.timing import in_turns, quartiles, timed
from podusv_cli.core.kernel import Vector
from podusv_cli.engine.loop.closed_loop import STATE
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.engine.step.grid import TimeGrid

SPAN = 5.0  # s
CASE = Case("adaptive_neural", "27 grid")
PLAIN_STEPS = 100


def _end(step: float, steps: int) -> Vector:
    recording = simulate(CASE.loop(), TimeGrid(step, steps))
    return np.array([recording[name][-1] for name in STATE])


def _solved(loop: Loop, rtol: float) -> Vector:
    from scipy.integrate import solve_ivp

    done = solve_ivp(loop, (0.0, SPAN), loop.start, method="RK45", rtol=rtol, atol=0.01 * rtol)
    return np.asarray(done.y[:6, -1])


def matching_tolerance(loop: Loop, reference: Vector, error: float) -> float:
    """The largest rtol on a grid of thirds of decades with which RK45 errs no more than this."""
    for exponent in range(9, 40):
        rtol = float(10.0 ** (-exponent / 3))
        if np.abs(_solved(loop, rtol) - reference).max() <= error:
            return rtol
    raise ValueError(f"RK45 does not come within {error:.2g} of the reference")


def python_alternatives(rounds: int = 3) -> dict[str, Any]:
    """Seconds of computing for a simulated second, at the accuracy of RK4 with the usual step."""
    h = grid().step
    steps, loop = round(SPAN / h), Loop(CASE.loop())
    reference = _end(h / 20, 20 * steps)
    error = float(np.abs(_end(h, steps) - reference).max())
    apart = np.abs(rk4(loop, loop.start, h, steps)[-1, :6] - _end(h, steps)).max()
    if not apart <= TOLERANCE:
        raise ValueError(f"plain numpy and podusv are {apart:.2g} apart; not timed")
    rtol = matching_tolerance(loop, reference, error)
    times = in_turns(
        {
            "podusv": timed(partial(simulate, loop.parts, TimeGrid(h, steps))),
            "numpy": timed(partial(rk4, loop, loop.start, h, steps), 1),
            "solve_ivp": timed(partial(_solved, loop, rtol), 1),
        },
        rounds,
    )
    per_second = {name: quartiles(values / SPAN) for name, values in times.items()}
    return {"span_s": SPAN, "rk4_error": error, "rtol": rtol, "per_simulated_s": per_second}


def plain_engine(rounds: int = 3) -> dict[str, list[float]]:
    """Time of one step [s] of podusv's own kernels as plain Python, by law."""
    cases = [Case(law, "" if law == "pid" else "27 grid") for law in LAWS]
    over = grid(PLAIN_STEPS)
    timers = {
        case.law: timed(partial(simulate, case.loop(), over, compiled=False), 1) for case in cases
    }
    times = in_turns(timers, rounds)
    return {law: quartiles(values / PLAIN_STEPS) for law, values in times.items()}
