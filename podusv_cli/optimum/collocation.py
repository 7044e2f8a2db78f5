"""Direct collocation: the motion as unknowns on a time grid, solved by IPOPT through CasADi.

Hermite-Simpson in its compressed form, with demands on straight lines between the grid's times; see
Kelly, An introduction to trajectory optimization, SIAM Review 59 (2017), section 4. The plant is
podusv's own kernel, evaluated on symbols.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.errors import NotConvergedError, UsageError
from podusv_cli.core.kernel import Vector, bundle, transplant
from podusv_cli.optimum.problem import Motion, OptimumProblem, loads_of
from podusv_cli.process.interrupts import interrupts_caught, interrupts_deferred

TOLERANCE = 1e-8  # of IPOPT
MOST_ITERATIONS = 1000
GRIDS = 3  # each with half the step of the one before
# The distance |e| has no slope at 0: it becomes sqrt(e^2 + s^2) - s with ever smaller s [m].
SMOOTHED = {"iae": (0.3, 0.03, 1e-3, 1e-4), "ise": (0.0,)}
BARRIER = 1e-4  # IPOPT's parameter where it starts from an optimum of another grid or smoothing
WARM = {
    "ipopt.warm_start_init_point": "yes",
    "ipopt.warm_start_bound_push": 1e-6,
    "ipopt.warm_start_mult_bound_push": 1e-6,
}
STATES = 6  # at each time (x, y, psi, u, v, r); behind them the demands
Tell = Callable[[str, float], None]


@dataclass(frozen=True)
class Stage:
    """An optimum on one grid: what the search began from, the grid's step [s], and the work done.

    `integral` is without smoothing; NaN, with no motion, where IPOPT did not converge.
    """

    start: str
    step: float
    integral: float
    iterations: int
    seconds: float
    motion: Motion | None = None


def casadi() -> Any:
    """The module casadi. Raises UsageError where it is not installed."""
    try:
        import casadi
    except ImportError:
        raise UsageError("podusv optimum needs CasADi: pip install 'podusv[optimum]'") from None
    return casadi


def dynamics(k: Any, demands: int = 2) -> Any:
    """A CasADi function: the rate of the state (x, y, psi, u, v, r) under demand and load.

    `k` has the coefficients of the vessel; `demands` counts the numbers of a demand, two or three.
    The function takes state (6,), demand (demands,) and load (3,) [N, N, N m].
    """
    ca = casadi()
    kernel = transplant(plant, {cos_sin: lambda a: (ca.cos(a), ca.sin(a)), float: lambda x: x})
    x, demand, b = ca.SX.sym("x", STATES), ca.SX.sym("demand", demands), ca.SX.sym("b", 3)
    rate: list[Any] = [0.0] * STATES
    tau = loads_of(ca.vertsplit(demand))
    kernel(ca.vertsplit(x), tau, ca.vertsplit(b), k, rate)
    return ca.Function("dynamics", [x, demand, b], [ca.vertcat(*rate)])


def search_optima(
    problem: OptimumProblem, guesses: Mapping[str, Motion], step: float, tell: Tell | None = None
) -> tuple[list[Stage], Motion]:
    """Optima on the coarsest grid from every guess, then of the best on finer grids.

    Returns all stages, and the motion of the last. `guesses` are motions by what they come from;
    the finest grid has the `step` [s] or a little less; `tell` hears what is done and which
    fraction. Raises NotConvergedError. An interrupt ends the solver at its next iteration.
    """
    finest = 2 ** (GRIDS - 1)
    n = max(1, int(np.ceil(problem.duration / step / finest - 1e-9)))  # 1e-9: of rounding
    count = len(guesses) + GRIDS - 1
    stages: list[Stage] = []
    for start, guess in guesses.items():
        report = partial(_tell, tell, len(stages), count)
        stages.append(_solve_stage(_Program(problem, n, report), start, guess))
    # What did not converge is last: its integral is NaN, which compares with nothing
    best = min(stages, key=lambda stage: (stage.motion is None, stage.integral))
    for grid in range(1, GRIDS):
        report = partial(_tell, tell, len(stages), count)
        program = _Program(problem, n * 2**grid, report, warm={"ipopt.mu_init": BARRIER})
        best = _solve_stage(program, best.start, _motion_or_raise(best))
        stages.append(best)
    return stages, _motion_or_raise(best)


def _motion_or_raise(stage: Stage) -> Motion:
    """The stage's motion. Raises NotConvergedError."""
    if stage.motion is None:
        raise NotConvergedError(
            f"IPOPT found no optimum with a step of {stage.step:g} s in {stage.iterations} "
            "iterations; try another --step, or a scenario with more laws in `controllers`"
        )
    return stage.motion


def _solve_stage(program: _Program, start: str, guess: Motion) -> Stage:
    """The optimum on a program's grid, smoothed less and less.

    `start` names what the guess comes from. Where IPOPT does not converge, the stage has no motion,
    and NaN for the integral.
    """
    began, iterations, motion = time.perf_counter(), 0, guess.at(program.times)
    smoothed = SMOOTHED[program.problem.minimised]
    try:
        # A warm guess is an optimum of a coarser grid already: much smoothing would lead away from
        # it
        for eps in smoothed[-2:] if program.warm else smoothed:
            motion = program.solve(motion, eps)
            iterations += program.iterations
    except NotConvergedError:
        iterations += program.iterations
        return Stage(start, program.step, math.nan, iterations, time.perf_counter() - began)
    seconds = time.perf_counter() - began
    return Stage(start, program.step, program.integral(motion), iterations, seconds, motion)


def _tell(tell: Tell | None, stage: int, count: int, iterations: int) -> None:
    """Tell the fraction done: `stage` of `count`, and a part of this one by its iterations."""
    if tell:  # nobody knows how many iterations there will be
        tell("solving", (stage + iterations / (iterations + 50.0)) / count)


class _Program:
    """The nonlinear program of one grid of `n` equal steps."""

    def __init__(
        self,
        problem: OptimumProblem,
        n: int,
        told: Callable[[int], None],
        warm: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        """The program of a `problem` with `n` segments; `told` hears the number of each iteration.

        `warm` are IPOPT's options where the guess is nearly an optimum.
        """
        ca = casadi()
        self.step = problem.duration / n
        self.times: Vector = self.step * np.arange(n + 1, dtype=np.float64)
        self.problem, self.n, self.told, self.iterations = problem, n, told, 0
        self._unknowns = STATES + problem.demands
        self.warm = dict(warm)
        between = self.times[:-1] + 0.5 * self.step
        self._loads = [problem.loads(times.tolist()).T for times in (self.times, between)]
        self._places = [problem.places(times.tolist()).T for times in (self.times, between)]
        self._segment = _segment(problem, self.step)
        w, eps = ca.MX.sym("w", self._unknowns * (n + 1)), ca.MX.sym("eps")
        every = ca.reshape(w, self._unknowns, n + 1)
        gaps, cost, _ = self._segment.map(n)(
            every[:, :-1],
            every[:, 1:],
            *_thirds(*self._loads),
            *_thirds(*self._places),
            ca.repmat(eps, 1, n),
        )
        self._nlp = {"x": w, "p": eps, "f": ca.sum2(cost), "g": ca.vec(gaps)}
        self._multipliers: dict[str, Any] = {}

    def solve(self, guess: Motion, eps: float) -> Motion:
        """The optimum with the smoothing `eps` [m], from a guess on the grid.

        Sets `iterations`, and what a further call starts from. Raises NotConvergedError.
        """
        ca = casadi()
        low, high = self._bounds()
        own = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False}
        own |= {"ipopt.tol": TOLERANCE, "ipopt.max_iter": MOST_ITERATIONS}
        with interrupts_caught() as here, interrupts_deferred():
            # IPOPT would swallow an interrupt, so `watch` asks for it between iterations
            watch = _watch(self._unknowns * (self.n + 1), STATES * self.n, self._look(here))
            options = own | {"iteration_callback": watch} | self.warm
            solver = ca.nlpsol("optimum", "ipopt", self._nlp, options)
            start = np.hstack([guess.states, guess.demands]).clip(low, high).ravel()
            solution = solver(
                x0=start,
                p=eps,
                lbx=low.ravel(),
                ubx=high.ravel(),
                lbg=0.0,
                ubg=0.0,
                **self._multipliers,
            )
        stats = solver.stats()
        self.iterations = int(stats["iter_count"])
        if not stats["success"]:
            raise NotConvergedError(f"IPOPT: {stats['return_status']}")
        self.warm = {"ipopt.mu_init": BARRIER, **WARM}  # the next call begins near an optimum
        self._multipliers = {"lam_g0": solution["lam_g"], "lam_x0": solution["lam_x"]}
        # IPOPT may leave bounds by its tolerance
        rows = np.array(solution["x"]).reshape(self.n + 1, self._unknowns).clip(low, high)
        return Motion(self.times, rows[:, :STATES], rows[:, STATES:])

    def integral(self, motion: Motion) -> float:
        """The integral of the distance to the target [m s] or of its square [m2 s].

        By Simpson's rule, whose middle place in a segment is that of the collocation. No smoothing.
        """
        rows = np.hstack([motion.states, motion.demands]).T
        # The last argument is eps: no smoothing. `half` are the places at the segments' middles.
        _, _, half = self._segment.map(self.n)(
            rows[:, :-1], rows[:, 1:], *_thirds(*self._loads), *_thirds(*self._places), 0.0
        )
        distances = [
            np.hypot(*(places - self._places[i]))
            for i, places in enumerate((motion.states.T[:2], np.array(half)))
        ]
        ends, middle = (d if self.problem.minimised == "iae" else d**2 for d in distances)
        return float(self.step / 6.0 * (ends[:-1] + 4.0 * middle + ends[1:]).sum())

    def _bounds(self) -> tuple[Vector, Vector]:
        """The least and the largest value of every unknown, each (n + 1, unknowns).

        Demands have the actuator's limits; the first state is given, so both bounds are it.
        """
        low = np.full((self.n + 1, self._unknowns), -np.inf)
        low[:, STATES:] = -np.array(self.problem.loop.actuator.limits())
        high = -low
        low[0, :STATES] = high[0, :STATES] = self.problem.loop.start
        return low, high

    def _look(self, here: Any) -> Callable[[], bool]:
        """A function for every iteration: tells of it, and whether an interrupt waits."""

        def look() -> bool:
            """Count an iteration, and say whether the user wants to stop."""
            self.iterations += 1
            self.told(self.iterations)
            return bool(here.number)

        return look


def _thirds(ends: Vector, middle: Vector) -> tuple[Vector, Vector, Vector]:
    """The columns at a segment's beginning, middle and end, each (numbers, n).

    `ends` (numbers, n + 1) are at the grid's times, `middle` (numbers, n) between them.
    """
    return ends[:, :-1], middle, ends[:, 1:]


def _segment(problem: OptimumProblem, h: float) -> Any:
    """A CasADi function of a segment of `h` [s]: its gaps, share of the integral, middle place.

    Gaps (6,) are the collocation's defects, 0 on a motion; the place (2,) is in m. It takes states
    and demands before and after, three loads, three places of the target, and the smoothing [m].
    """
    ca, rate = casadi(), dynamics(bundle(problem.loop.vessel.constants()), problem.demands)
    unknowns = STATES + problem.demands
    before, after = ca.SX.sym("before", unknowns), ca.SX.sym("after", unknowns)
    loads = [ca.SX.sym(f"b{i}", 3) for i in range(3)]
    places = [ca.SX.sym(f"d{i}", 2) for i in range(3)]
    eps = ca.SX.sym("eps")
    x0, x1 = before[:STATES], after[:STATES]
    f0, f1 = rate(x0, before[STATES:], loads[0]), rate(x1, after[STATES:], loads[2])
    half = (x0 + x1) / 2.0 + h / 8.0 * (f0 - f1)  # of Hermite's cubic through both ends
    demand = (before[STATES:] + after[STATES:]) / 2.0
    gaps = x1 - x0 - h / 6.0 * (f0 + 4.0 * rate(half, demand, loads[1]) + f1)
    squares = [ca.sumsqr(x[:2] - d) for x, d in zip((x0, half, x1), places, strict=True)]
    if problem.minimised == "iae":
        squares = [ca.sqrt(square + eps**2) - eps for square in squares]
    cost = h / 6.0 * (squares[0] + 4.0 * squares[1] + squares[2])
    return ca.Function("segment", [before, after, *loads, *places, eps], [gaps, cost, half[:2]])


def _watch(unknowns: int, gaps: int, look: Callable[[], bool]) -> Any:
    """A CasADi callback that IPOPT calls after every iteration; `look` says whether to stop.

    `unknowns` and `gaps` count the program's variables and constraints, whose shapes CasADi asks.
    """
    ca: Any = casadi()
    sizes = {"f": 1, "x": unknowns, "lam_x": unknowns, "g": gaps, "lam_g": gaps}

    class Watch(ca.Callback):  # type: ignore[misc]
        def __init__(self) -> None:
            ca.Callback.__init__(self)
            self.construct("watch", {})

        def get_n_in(self) -> int:
            """How many arguments CasADi passes: all results of the solver."""
            return int(ca.nlpsol_n_out())

        def get_n_out(self) -> int:
            """One result: whether to stop."""
            return 1

        def get_sparsity_in(self, i: int) -> Any:
            """The shape of argument number i, empty where it is not needed."""
            size = sizes.get(ca.nlpsol_out(i), 0)
            return ca.Sparsity.dense(size) if size else ca.Sparsity(0, 0)

        def eval(self, arguments: Any) -> list[float]:
            """1 where the solver is to stop, else 0."""
            return [float(look())]

    return Watch()
