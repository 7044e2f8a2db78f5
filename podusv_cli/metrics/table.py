"""All metrics, and one kernel that gathers for all of them at every step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np

from podusv_cli.core import registry
from podusv_cli.core.component import describe
from podusv_cli.core.errors import LawError, in_a_line
from podusv_cli.core.kernel import Vector, kernel, specialise, tail, taking
from podusv_cli.core.plugins import Plugins
from podusv_cli.engine.loop.closed_loop import ClosedLoop, Probe
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.metrics import spans, windows
from podusv_cli.metrics.metric import Accumulator, Measured, Metric, close_integrals
from podusv_cli.metrics.windows import ERROR_RMS, NONE, Radii, Windows, metrics_of_windows


@cache
def metrics_with(plugins: Plugins, own: tuple[Windows, Radii] = NONE) -> dict[str, Metric]:
    """All metrics by name, in the order of tables, with those of these plug-ins.

    `own` are the windows and radii that a scenario names.
    """
    of_files = registry.find_by_name("podusv_cli.metrics", Metric, plugins).values()
    return {
        m.name: m
        for m in sorted((*of_files, *metrics_of_windows(*own).values()), key=lambda m: m.place)
    }


METRICS = metrics_with(())
# Measured times, which never repeat
CLOCKED = tuple(name for name, metric in METRICS.items() if metric.unit == "ns")


def headlines_first(known: Mapping[str, Metric]) -> list[Metric]:
    """The metrics in the order in which a reader sees them."""
    return sorted(known.values(), key=lambda metric: not metric.headline)


Failed = Callable[[str, Exception], None]
Parts = tuple[tuple[Accumulator, int], ...]
COUNT = 0  # placeholder: how many numbers `first_kernel` gathers


# the arguments of an accumulator's kernel
WATCH = ("t", "weight", "steady", "s", "row", "k", "seen")


# Arguments as those of `spans.all_kernels`.
@kernel
def first_kernel(
    t: float, weight: float, steady: float, s: Vector, row: Vector, k: Any, seen: Vector
) -> None:
    """Placeholder of the first accumulator's kernel; does nothing after the last one."""


# Arguments as those of `spans.all_kernels`.
@kernel
def other_kernels(
    t: float, weight: float, steady: float, s: Vector, row: Vector, k: Any, seen: Vector
) -> None:
    """Placeholder of the other accumulators' kernel."""


# Arguments as those of `spans.all_kernels`.
def call_both(
    t: float, weight: float, steady: float, s: Vector, row: Vector, k: Any, seen: Vector
) -> None:
    """Call the first kernel, then the others."""
    first_kernel(t, weight, steady, s, row, k, seen)
    other_kernels(t, weight, steady, s, row, k, tail(seen, COUNT))


@cache
def _watch(parts: Parts) -> Callable[..., None]:
    """One kernel that calls those of all parts, each with the numbers that follow the last's.

    It is nested, one level a part, because compiled code cannot loop over functions. How many
    numbers the last part gathers is no part of the code.
    """
    if not parts:
        return first_kernel
    (first, count), *others = parts
    inner = taking(first.watch, WATCH)
    if not others:
        return inner  # type: ignore[no-any-return]
    kernels = {"first_kernel": inner, "other_kernels": _watch(tuple(others))}
    return specialise(call_both, "metrics", COUNT=count, **kernels)  # type: ignore[no-any-return]


@cache
def _within_span(parts: Parts, has_end: bool) -> Callable[..., None]:
    """The kernel of all parts, shown the instants that count."""
    span = spans.by_path if has_end else spans.by_time
    return specialise(span, "metrics", all_kernels=_watch(parts))  # type: ignore[no-any-return]


@dataclass(frozen=True, kw_only=True)
class Metrics(Probe):
    """A probe for `engine.running.simulate` that gathers the numbers of all metrics."""

    parts: Parts
    step: float  # s
    known: Mapping[str, Metric]
    layout: Measured
    ahead: int  # numbers ahead of those of the parts

    def constants_for(self, loop: ClosedLoop) -> dict[str, float]:
        """The constants of all accumulators in a run of this loop.

        Raises LawError where one of them gathers another number of numbers than in the probe's
        own loop, or has another value than another one for a constant of the same name.
        """
        layout, sizes = replace(self.layout, loop=loop), dict(self.parts)
        constants = _asked_span(layout)
        for part, metric in self._accumulators.items():
            size, own = _ask_accumulator(part, metric, layout)
            if size != sizes.get(part, 0):
                what = f"gathers {size} numbers in this run and {sizes.get(part, 0)} in others"
                raise LawError(f"metric {metric}: its accumulator {what} of the same batch")
            for name, number in own.items():
                if constants.setdefault(name, number) != number:
                    what = f"has another constant {name!r} than another metric"
                    raise LawError(f"metric {metric}: its accumulator {what}; give it another name")
        return constants

    def first(self) -> Vector:
        """What is gathered before the first instant: numbers that accumulators begin with."""
        return self._first.copy()

    @cached_property
    def _first(self) -> Vector:
        """The vector of all accumulators at the start, each in its own part."""
        parts = [np.zeros(self.ahead)]
        parts += [np.array([*p.first, *[0.0] * (n - len(p.first))]) for p, n in self.parts]
        return np.concatenate(parts)

    @cached_property
    def _accumulators(self) -> dict[Accumulator, str]:
        """Every accumulator of the probe's metrics, with one of them."""
        return _accumulators(self.known)

    def summary(self, seen: Vector, failed: Failed | None = None) -> dict[str, float]:
        """Metrics by name from `seen` (numbers,); NaN where a run ended before one is defined.

        A metric that raises is left out where `failed` is told; else it raises LawError.
        """
        numbers: dict[str, float] = {}
        for metric, runs in self._close_integrals(seen[np.newaxis]):
            try:
                numbers[metric.name] = float(metric.result(runs[0], self.step))
            except Exception as error:  # a plug-in's function may raise anything
                if not failed:
                    raise _fault(metric, error) from error
                failed(f"metric {metric.name}", error)
        return numbers

    def one(self, name: str, seen: Vector) -> Vector:
        """The metric of this name (runs,) from `seen` (numbers, runs); NaN where undefined.

        All NaN for a metric that this probe does not gather.
        """
        metric, begin = self.known[name], self.ahead
        for part, size in self.parts:
            if part is metric.accumulator:
                own = close_integrals(seen[begin : begin + size], part.integrals, self.step)
                return np.array([float(metric.result(run, self.step)) for run in own.T])
            begin += size
        return np.full(seen.shape[1], np.nan)

    def summaries(self, seen: Vector) -> dict[str, Vector]:
        """Metrics by name (runs,), from rows of gathered numbers (runs, numbers), as `Batch.seen`.

        NaN where a run ended before a metric is defined; all NaN for a run that never began. Raises
        LawError for a metric that raises.
        """
        numbers: dict[str, Vector] = {}
        for metric, runs in self._close_integrals(seen):
            try:
                each = [float(metric.result(run, self.step)) for run in runs]
            except Exception as error:  # a plug-in's function may raise anything
                raise _fault(metric, error) from error
            numbers[metric.name] = np.array(each, dtype=float)
        return numbers

    def _close_integrals(self, seen: Vector) -> Iterator[tuple[Metric, Vector]]:
        """Each metric with its accumulator's numbers (runs, size), integrals closed.

        `seen` is (runs, numbers).
        """
        # A run that saw an instant has changed a number: at least its time
        begun = (seen != self._first).any(axis=1, keepdims=True)
        seen = np.where(begun, seen, np.nan)  # no instant at all: NaN
        seen = seen[:, self.ahead :]
        ends = np.cumsum([size for _, size in self.parts])[:-1]
        own = {
            part: np.ascontiguousarray(close_integrals(numbers, part.integrals, self.step).T)
            for (part, _), numbers in zip(self.parts, np.split(seen.T, ends), strict=True)
        }
        return ((m, own[m.accumulator]) for m in self.known.values() if m.accumulator in own)


def _fault(metric: Metric, error: Exception) -> LawError:
    """The error that says which metric failed, and how."""
    return LawError(f"metric {metric.name}: {in_a_line(error)}")


def metrics_probe(
    plan: Plan,
    *,
    steady_fraction: float,
    settling_radius: float,
    known: Mapping[str, Metric] = METRICS,
) -> Metrics:
    """The probe of those of the known metrics that this loop has.

    `steady_fraction` is the last part of the run that counts as steady, `settling_radius` in m. It
    serves all loops of the same structure: each has constants of its own. Raises LawError for a
    metric whose accumulator does not answer.
    """
    since = plan.grid.last_part(steady_fraction)
    layout = Measured(plan.loop, plan.layout, since, settling_radius, steady_fraction)
    has_end = "over_at" in _asked_span(layout)
    sizes = {
        part: _ask_accumulator(part, metric, layout)[0]
        for part, metric in _accumulators(known).items()
    }
    parts = tuple((part, size) for part, size in sizes.items() if size)
    differing = frozenset(name for part, _ in parts for name in part.differing)
    ahead = spans.AHEAD if has_end else 0
    metrics = Metrics(
        _within_span(parts, has_end),
        ahead + sum(size for _, size in parts),
        differing,
        parts=parts,
        step=plan.grid.step,
        known=known,
        layout=layout,
        ahead=ahead,
    )
    metrics.constants_for(plan.loop)  # for the errors that it raises, before any run
    return metrics


def _accumulators(known: Mapping[str, Metric]) -> dict[Accumulator, str]:
    """Every accumulator, with a metric that is computed from it.

    That of windows and radii is always there and the last, so that any of them need the same code.
    """
    found = {metric.accumulator: name for name, metric in known.items() if metric.accumulator}
    own = next((part for part in found if part.watch is windows.watch), None)
    last = own or windows.accumulator(*NONE)
    name = found.pop(last, ERROR_RMS.name)
    return {**found, last: name}


def _asked_span(layout: Measured) -> dict[str, float]:
    """The constants that tell which instants count. Raises LawError where the path fails."""
    try:
        return spans.constants(layout)
    except Exception as error:  # a plug-in's path may raise anything
        # Described here alone: to look for a class in its source takes as long as a run.
        what = f"{describe(layout.loop.path)}, asked where it ends"
        said = str(error) if isinstance(error, LawError) else in_a_line(error)
        raise LawError(f"{what}: {said}") from error


def _ask_accumulator(
    part: Accumulator, metric: str, layout: Measured
) -> tuple[int, dict[str, float]]:
    """How many numbers an accumulator gathers in a loop, and its constants; none for 0 numbers.

    `metric` names one that is computed from it, for messages. Raises LawError where it fails.
    """
    if part.of_target and not layout.loop.has_target:
        return 0, {}
    try:
        size = part.size(layout)
        constants = dict(part.constants(layout)) if size else {}
    except Exception as error:  # a plug-in's function may raise anything
        what = "its accumulator, asked for size and constants"
        raise LawError(f"metric {metric}, {what}: {in_a_line(error)}") from error
    if size and len(part.first) > size:
        what = f"begins with {len(part.first)} numbers and gathers {size}"
        raise LawError(f"metric {metric}: its accumulator {what}; give `first` at most {size}")
    return size, constants
