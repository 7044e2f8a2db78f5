"""The arithmetic that a law takes, counted by evaluating it on numbers that count."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from podusv_cli.core.elementary import arctangent
from podusv_cli.core.kernel import bundle, call, scratch, transplant
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import DEMAND_SIZE, TARGET_SIZE
from podusv_cli.engine.loop.closed_loop import STATE
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.replay import logged_rows
from podusv_cli.metrics.metric import Metric

# where the target, the vessel's state and the law's memory begin in a logged row
ENDS = (1, 1 + TARGET_SIZE, 1 + TARGET_SIZE + len(STATE))

law_operations = Metric(
    "law_operations",
    "1",
    "floating-point operations of one evaluation of the law",
    place=200,
    words="operations of one evaluation of the law",
)


@dataclass
class OperationTally:
    """How many operations were done so far; stands in a kernel for the module math."""

    count: int = 0

    def __getattr__(self, name: str) -> Any:
        """As the module math: a constant of it, or a function that counts."""
        member = getattr(math, name)
        return partial(self.apply, member) if callable(member) else member

    def apply(self, operation: Callable[..., Any], *operands: Any) -> Counted:
        """Apply an operation to operands, and count one."""
        self.count += 1
        return self.number(operation(*map(_plain, operands)))

    def number(self, number: Any) -> Counted:
        """A number that counts; numpy's, because division by zero is no error in a law."""
        # numpy's number, which divides by 0 without raising
        return Counted(np.float64(number), self)

    def vector(self, numbers: Any) -> Any:
        """An array of numbers that count."""
        return np.array([self.number(number) for number in np.ravel(numbers)], dtype=object)

    def kernel(self, function: Any) -> Any:
        """The kernel, and all that it calls, with arithmetic that counts.

        A direction counts as one operation, as the functions of the module math do; a cosine with
        its sine, and an exponential, count as the arithmetic that they are.
        """
        parts = {math: self, float: lambda x: x, scratch: partial(np.empty, dtype=object)}
        return transplant(function, parts | {arctangent: partial(self.apply, math.atan2)})


@dataclass(eq=False, slots=True)
class Counted:
    """A number whose arithmetic is counted; comparisons and changes of sign are free."""

    number: Any
    tally: OperationTally


def _plain(number: Any) -> Any:
    """The number that a counted one stands for; any other as it is."""
    return number.number if type(number) is Counted else number


def _forward(operation: Callable[..., Any]) -> Callable[..., Counted]:
    """An operator of Python that counts one operation: self, then the other."""
    return lambda self, other: self.tally.apply(operation, self, other)


def _backward(operation: Callable[..., Any]) -> Callable[..., Counted]:
    """As `_forward`, with the other operand first, as `2.0 * x` calls it."""
    return lambda self, other: self.tally.apply(operation, other, self)


def _comparison(operation: Callable[..., Any]) -> Callable[..., bool]:
    """An operator that compares, and counts nothing."""
    return lambda self, other: bool(operation(self.number, _plain(other)))


def _conversion(kind: Callable[[Any], Any]) -> Callable[..., Any]:
    """A conversion to a plain number, which counts nothing."""
    return lambda self: kind(self.number)


def _sign(operation: Callable[..., Any]) -> Callable[..., Counted]:
    """A change of sign, which counts nothing."""
    return lambda self: Counted(operation(self.number), self.tally)


for _kind in (float, int, bool):
    setattr(Counted, f"__{_kind.__name__}__", _conversion(_kind))
for _name in ("neg", "abs"):
    setattr(Counted, f"__{_name}__", _sign(getattr(operator, _name)))
for _name in ("add", "sub", "mul", "truediv", "pow", "mod"):
    setattr(Counted, f"__{_name}__", _forward(getattr(operator, _name)))
    setattr(Counted, f"__r{_name}__", _backward(getattr(operator, _name)))
for _name in ("lt", "le", "gt", "ge", "eq", "ne"):
    setattr(Counted, f"__{_name}__", _comparison(getattr(operator, _name)))


def _of_numpy(self: Counted, function: Callable[..., Any], _: str, *operands: Any) -> Counted:
    """One operation for a function of numpy that is called with a counted number."""
    return self.tally.apply(function, *operands)


setattr(Counted, "__array_ufunc__", _of_numpy)  # noqa: B010 - as the others


@np.errstate(all="ignore")
def operations(plan: Plan, recording: Recording) -> dict[str, float]:
    """The metric of this run's law, by its name, counted at the middle row of the log.

    Errors of numbers are let pass: a law may divide by 0.
    """
    law, tally = plan.loop.controller, OperationTally()
    rows = logged_rows(plan, recording, 3)  # first, middle, last
    t, target, state, memory = np.split(rows[len(rows) // 2], ENDS)
    constants = plan.law_constants
    vectors = {
        "x": state,
        "memory": memory,
        "target": target,
        "table": plan.law_table,
        "tau": np.zeros(DEMAND_SIZE),
        "rate": np.zeros(len(memory)),
        "signals": np.zeros(len(law.signals)),
        "work": np.zeros(law.workspace()),
    }
    counted = {name: tally.vector(vector) for name, vector in vectors.items()}
    k: Any = {name: tally.number(number) for name, number in constants.items()}
    call(tally.kernel(law.law), t=tally.number(t[0]), k=bundle(k), **counted)
    return {law_operations.name: float(tally.count)}
