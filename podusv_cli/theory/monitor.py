"""The stability monitor: V, its terms and its rate along a run, and the bounds of the proof."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from podusv_cli.components.controllers.network import ACTIVATION, NODE_DISTANCE, W_NORM_R, W_NORM_U
from podusv_cli.components.controllers.polar_backstepping import Y_R, Y_U, PolarBackstepping
from podusv_cli.core.derived import Derived
from podusv_cli.core.kernel import Vector
from podusv_cli.core.portable import exponential, total
from podusv_cli.core.recording import Allocate, Recording, blocks, largest
from podusv_cli.core.signal import Signal, by_name
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.replay import Replayed, rates_replay
from podusv_cli.theory import bounds, ideal_weights
from podusv_cli.theory.lyapunov import TERMS, V_DOT, V, lyapunov, norms, remainders
from podusv_cli.theory.rates import error_rates

WINDOWS = ("whole", "settled")
BLOCK = 4096  # rows computed together, so that they stay in the processor's cache
LARGEST_BLOCK = 2**22  # numbers in a block, with one for every node in every row
ERRORS = (Y_U, Y_R)  # of the filters; a law without them has none
NETWORKS = (W_NORM_U, W_NORM_R, ACTIVATION, NODE_DISTANCE)
_of_windows = partial(Signal, axes=("window",), fixed=True)
_of_nodes = partial(Signal, axes=("node",), fixed=True)
FIXED = (
    _of_nodes("W_star_u", "m/s2", "ideal weights of the surge network, fitted to the run", "W_u^*"),
    _of_nodes("W_star_r", "rad/s2", "ideal weights of the yaw network, fitted to the run", "W_r^*"),
    _of_windows(
        "window_start", "s", "start of the part of the run whose extremes enter V_Delta", "t_0"
    ),
    _of_windows("V_lambda", "1/s", "rate lambda of (49), corrected", r"\lambda"),
    _of_windows(
        "V_Delta", "1/s", "Delta of (49), corrected, from extremes of that part", r"\Delta"
    ),
    _of_windows("V_bound", "1", "ultimate bound of V, corrected", r"\Delta/2\lambda"),
    _of_windows("v_bound", "m/s", "bound of the sway speed (51), with all damping", r"|v|_{\max}"),
)
V_DOT_BOUND = Signal(
    "V_dot_bound",
    "1/s",
    "bound of V_dot (49), corrected; derived, not logged",
    r"-2\lambda V+\Delta",
)
# Quantities at every row from which the bounds are computed; not logged.
UNLOGGED = (
    "alpha_u_dot",
    "alpha_r_dot",
    "drift_u",
    "drift_r",
    "epsilon_u",
    "epsilon_r",
    "rest_u",
    "rest_r",
    "push",
    "printed_push",
    "turn",
)

Traces = dict[str, Vector]


@dataclass(frozen=True)
class Window:
    """A part of a run: its start [s], the largest values in it, and the bounds from these.

    `kept` is the fraction of its rows with V' <= -2 lambda V + Delta, NaN without a bound.
    `observed` is None with sampled control, and where the run ended before the window.
    """

    since: float
    observed: bounds.Observed | None
    bound: bounds.UltimateBound
    sway: bounds.SwayBound
    largest_V: float
    largest_v: float
    kept: float


@dataclass(frozen=True)
class Monitored:
    """A recording with the monitor's signals, and the bounds in each window.

    `traces` are all quantities at every row, those that are not logged included.
    """

    recording: Recording
    windows: dict[str, Window]
    traces: Traces


def signals(plan: Plan) -> tuple[Signal, ...]:
    """The signals that the monitor adds over time; none for a law without V."""
    law = plan.loop.lyapunov()
    if law is None:
        return ()
    rate = () if plan.sampled else (V_DOT,)
    return (V, *rate, *TERMS, *(ERRORS if law.filter_slots() else ()), *NETWORKS)


def about(plan: Plan) -> dict[str, Signal]:
    """All signals of the log, the monitor's included. Raises LawError as `plan.about`."""
    added = signals(plan)
    added += FIXED if added else ()
    return by_name(
        ((lambda: "the loop", plan.about.values()), (lambda: "the stability monitor", added))
    )


def prepare(plan: Plan, compiled: bool) -> None:
    """Compile and load the code that the monitor needs."""
    if plan.loop.lyapunov() is not None:
        rates_replay(plan, compiled=compiled)


def monitor_recording(
    plan: Plan,
    recording: Recording,
    *,
    steady_fraction: float = 0.2,
    compiled: bool = True,
    allocate: Allocate = np.empty,
) -> Monitored | None:
    """Add V, its terms, V' and its bounds to a fresh recording; None for a law without V.

    V uses the disturbance's bound, and weights fitted to this run (`theory.ideal_weights`). With
    sampled control, sensors or a delay there is no V' and no bound of V: old measurements act.
    `steady_fraction` is the last part of the run that counts as settled; `allocate` makes the
    arrays for the added signals.
    """
    loop, grid = plan.loop, plan.grid
    law, count = loop.lyapunov(), len(recording["time"])
    if law is None or not count:
        return None
    with np.errstate(all="ignore"):  # numbers of a diverging run overflow
        replayed = rates_replay(plan, compiled=compiled)
        chosen = recording.part(ideal_weights.rows_to_fit(count, law.network.count))
        ideal = ideal_weights.fit_weights(loop, law, chosen, replayed(chosen))
        b = _disturbance_bound(loop, recording)
        traces: Traces = {}
        for rows in blocks(count, min(BLOCK, max(1, LARGEST_BLOCK // law.network.count))):
            log = recording.part(rows)
            for name, part in _traces(loop, law, log, replayed(log), (ideal, b)).items():
                if name not in traces:
                    traces[name] = allocate(count)
                traces[name][rows] = part
        bounded = _Bounds(loop, law, recording, traces, ideal, b, not plan.sampled)
        starts = (0.0, grid.last_part(steady_fraction))
        windows = dict(zip(WINDOWS, map(bounded.window, starts), strict=True))
    logged = [signal.name for signal in signals(plan)]
    extended = replace(
        recording,
        signals={**recording.signals, **{name: traces[name] for name in logged}},
        fixed={**recording.fixed, **_fixed_arrays(windows, ideal)},
        about=about(plan),
    )
    return Monitored(extended, windows, traces)


def _disturbance_bound(loop: ClosedLoop, log: Recording) -> bounds.Pair:
    """Largest |b_u|, |b_r| of the disturbance; where it gives no bounds, those in the run."""
    known = loop.disturbance.bounds()
    if known is not None:
        return bounds.Pair(known[0], known[2])
    return bounds.Pair(_largest(log["b_u"]), _largest(log["b_r"]))


def _largest(values: Vector) -> float:
    """The largest magnitude in a trace (rows,), block by block; NaN without any."""
    return largest(len(values), lambda rows: values[rows])


def _traces(
    loop: ClosedLoop,
    law: PolarBackstepping,
    log: Recording,
    now: Replayed,
    unknown: tuple[ideal_weights.IdealWeights, bounds.Pair],
) -> Traces:
    """All that the proof is about, (rows,) each, over the rows of a log: V, its rate, remainders.

    `now` has the rates at these rows; `unknown` are the weights fitted to the run, and the largest
    |b_u| [N], |b_r| [N m].
    """
    ideal, b = unknown
    e = error_rates(log, now, law)
    factors = ideal_weights.exponents(law.network, log)
    phi = ideal_weights.outputs(law.network, factors)
    distance = ideal_weights.node_distance(law.network, factors)
    fit_u, fit_r = (ideal_weights.network_output(phi, W) for W in (ideal.W_u, ideal.W_r))
    f_u, f_r = ideal_weights.unloaded_accelerations(loop, now)
    rest_u, rest_r = remainders(loop, law, log, now, e)
    A_u, A_r = law.filter_decay(now.signals["alpha_u"], now.signals["alpha_r"])
    push, printed_push = bounds.sway_push(loop.vessel, log, now)
    return lyapunov(loop, law, log, now, e, ideal, b) | {
        "alpha_u_dot": e.alpha_u_dot,
        "alpha_r_dot": e.alpha_r_dot,
        # Without a filter A is infinite, and nothing lags behind the virtual control
        "drift_u": np.where(np.isinf(A_u), 0.0, e.y_u_dot + A_u * e.y_u),
        "drift_r": np.where(np.isinf(A_r), 0.0, e.y_r_dot + A_r * e.y_r),
        "epsilon_u": f_u - fit_u,
        "epsilon_r": f_r - fit_r,
        "rest_u": rest_u - loop.nominal.m11 * fit_u,
        "rest_r": rest_r - loop.nominal.m33 * fit_r,
        "push": push,
        "printed_push": printed_push,
        "turn": e.turn,
        "y_u": e.y_u,
        "y_r": e.y_r,
        "W_norm_u": norms(log["W_hat_u"]),
        "W_norm_r": norms(log["W_hat_r"]),
        "activation": exponential(-0.5 * distance**2),
        "node_distance": distance,
    }


@dataclass(frozen=True)
class _Bounds:
    """Computes the bounds of a part of a run from its largest values."""

    loop: ClosedLoop
    law: PolarBackstepping
    log: Recording
    traces: Traces
    ideal: ideal_weights.IdealWeights
    b: bounds.Pair
    continuous: bool

    def window(self, since: float) -> Window:
        """The part of the run from the time `since` [s] on, with its largest values and bounds."""
        # 1e-9 s: times of a log are rounded
        rows = slice(int(np.searchsorted(self.log["time"], since - 1e-9)), None)
        value, rate = self.traces["V"][rows], self.traces["V_dot"][rows]
        observed = self._observe_rows(rows) if self.continuous and len(value) else None
        bound = bounds.ultimate_bound(self.law, self.loop.vessel, observed)
        kept = _share_below_bound(bound.corrected, value, rate)
        pushes = [_largest(self.traces[name][rows]) for name in ("push", "printed_push")]
        sway = bounds.sway_bound(self.loop.vessel, *pushes)
        largest_v = _largest(self.log["v"][rows])
        return Window(since, observed, bound, sway, _largest(value), largest_v, kept)

    def _observe_rows(self, rows: slice) -> bounds.Observed:
        """What the proof takes as bounded, as large as it was in these rows of the log."""
        start, ideal = self.law.network.initial_weight, self.ideal
        W = (math.sqrt(total((weights - start) ** 2)) for weights in (ideal.W_u, ideal.W_r))
        return bounds.Observed(
            b=self.b,
            W=bounds.Pair(*W),
            alpha_dot=self._both(rows, "alpha_u_dot", "alpha_r_dot"),
            drift=self._both(rows, "drift_u", "drift_r"),
            epsilon=self._both(rows, "epsilon_u", "epsilon_r"),
            rest=self._both(rows, "rest_u", "rest_r"),
        )

    def _both(self, rows: slice, u: str, r: str) -> bounds.Pair:
        """The largest sizes of a surge trace and a yaw trace in these rows."""
        return bounds.Pair(_largest(self.traces[u][rows]), _largest(self.traces[r][rows]))


def _share_below_bound(bound: bounds.Bound, V: Vector, rate: Vector) -> float:
    """Fraction of the rows with V' <= -2 lambda V + Delta; NaN without a bound or rows.

    V and its rate are (rows,).
    """
    if not (np.isfinite(bound.Delta) and len(V)):
        return np.nan
    keeps = (rate[rows] <= -2.0 * bound.lambda_ * V[rows] + bound.Delta for rows in blocks(len(V)))
    return sum(int(np.count_nonzero(part)) for part in keeps) / len(V)


def _fixed_arrays(
    windows: dict[str, Window], ideal: ideal_weights.IdealWeights
) -> dict[str, Vector]:
    """The arrays of the monitor that are constant in time, by name.

    Ideal weights (nodes,), and numbers of each window (windows,).
    """
    parts = windows.values()
    numbers = {
        "window_start": [part.since for part in parts],
        "V_lambda": [part.bound.corrected.lambda_ for part in parts],
        "V_Delta": [part.bound.corrected.Delta for part in parts],
        "V_bound": [part.bound.corrected.value for part in parts],
        "v_bound": [part.sway.value for part in parts],
    }
    fixed = {"W_star_u": ideal.W_u, "W_star_r": ideal.W_r}
    return fixed | {name: np.array(values) for name, values in numbers.items()}


def _v_dot_bound(log: Recording) -> Vector:
    """The bound of V' over the rows of a log (rows,), from the window that each row is in."""
    window = np.searchsorted(log["window_start"], log["time"], side="right") - 1
    return np.asarray(-2.0 * log["V_lambda"][window] * log["V"] + log["V_Delta"][window])


v_dot_bound = Derived(V_DOT_BOUND, ("V_dot", "V_Delta"), _v_dot_bound)
