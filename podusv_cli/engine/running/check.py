"""Is a law what it says it is? Asked once, in plain Python, before it becomes machine code.

There its vectors are bare pointers, and what it writes past their ends is somebody else's number.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from numbers import Real

import numpy as np

from podusv_cli.components.vessels.vessel import COEFFICIENTS
from podusv_cli.core.component import describe
from podusv_cli.core.errors import LawError, in_a_line
from podusv_cli.core.kernel import NoKernel, Vector, bundle, call
from podusv_cli.core.signal import NAME, SWAY_DEMAND, Signal
from podusv_cli.engine.loop.closed_loop import DEMAND, ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine.kernel_faults import check_arguments, check_kernel
from podusv_cli.engine.running.thread import Work

PROVENANCE = "provenance"  # is a group in every log
UNWRITTEN = -1.234567890123e-290  # no law writes just this
FLOAT_AS_COUNT = "'float' object cannot be interpreted as an integer"
READ = ("x", "memory", "target", "table")  # arguments that a law may only read
# What a law's arithmetic may raise: the run tells it, as divergence.
OF_NUMBERS = (ArithmeticError, ValueError)


def check_law(plan: Plan) -> None:
    """Ask the plan's path and law at the start of a run, with vectors of the declared sizes.

    Raises LawError for signals that are undeclared or declared twice, a memory, table or outputs of
    another size, an output left unwritten, an argument written that is to be read, an exception,
    for a law that does not return, and as `check_kernel`. No number at all is left for the run to
    tell.
    """
    loop = plan.loop
    law = loop.controller.law
    check_kernel(law)
    check_kernel(loop.path.evaluate)
    if loop.path.follows:
        check_kernel(loop.path.locate)
    with np.errstate(all="ignore"):
        ask_part(partial(describe, loop.path), lambda: plan.path_table)
        ask_part(partial(describe, loop.path), lambda: plan.first_target, OF_NUMBERS)
        ask_part(partial(describe, loop.controller), partial(_check_declared, plan))
        ask_part(partial(describe, loop.controller), partial(_ask, plan), OF_NUMBERS)
    # In its source, too: it may write in a branch that the first instant does not take
    check_arguments(law, READ)


def ask_part(
    part: Callable[[], str], ask: Callable[[], object], left: tuple[type[Exception], ...] = ()
) -> None:
    """Ask, and raise LawError for any exception but those that are `left` for the run to tell.

    `part` describes the component, for messages. In a thread, since a law may never return.
    """
    # Any number will do: without one the work counts as not done
    work = Work(lambda: int(ask() is None))
    work.finish()
    if isinstance(work.error, NoKernel):
        raise LawError(f"{part()}: {work.error}") from work.error
    if isinstance(work.error, LawError):
        raise work.error
    if work.result is None and not isinstance(work.error, left):
        fault = _constant(work.error) or work.fault()
        if FLOAT_AS_COUNT in str(work.error):
            fault += "; constants are floats: write int(k.count)"
        message = f"{part()}, evaluated once before the run: {fault}"
        raise LawError(message) from work.error


def _constant(error: BaseException | None) -> str:
    """What is wrong where a kernel reads a constant that is missing, and which ones there are.

    "" for an error of another kind. Constants are named tuples, to which an AttributeError refers.
    """
    if not (isinstance(error, AttributeError) and hasattr(error.obj, "_fields")):
        return ""
    names = error.obj._fields
    inherited = ["those of the nominal vessel"] if set(COEFFICIENTS) <= set(names) else []
    known = ", ".join(name for name in names if name not in COEFFICIENTS)
    constants = ", and ".join(filter(None, [known, *inherited]))
    return f"{in_a_line(error)}; it has {constants or 'none'}"


def _check_declared(plan: Plan) -> None:
    """Raises LawError where memory, table or constants are not what the law declares."""
    law = plan.loop.controller
    _check_signals(plan)
    memory, declared = plan.first_memory, (len(plan.states["law"]),)
    if np.shape(memory) != declared:
        shapes = f"it starts with a memory of shape {np.shape(memory)}, its slots are {declared}"
        raise LawError(f"{describe(law)}: {shapes}")
    table = plan.law_table
    if not (isinstance(table, np.ndarray) and table.dtype == np.float64 and table.ndim == 1):
        raise LawError(f"{describe(law)}: its table is no vector of float64; write np.array([1.0])")
    for name, number in plan.law_constants.items():
        if not (name.isidentifier() and isinstance(number, Real)):
            raise LawError(f"{describe(law)}: its constant {name} = {number!r} is no named number")


def evaluate_law(plan: Plan, before: float) -> tuple[Vector, Vector, Vector]:
    """Demand (2,) or with a sway force (3,), rates (slots,) and signals that the law writes.

    At the start of a run, after a sample if it takes any. The arrays are full of `before` before
    that, so that one sees what it leaves unwritten. Raises LawError where it writes what it may
    only read.
    """
    # Copies, as the plan hands the same arrays to every run and a law may write to them
    law, memory, target = plan.loop.controller, plan.first_memory.copy(), plan.first_target.copy()
    x, k, table = np.array(plan.loop.start), bundle(plan.law_constants), plan.law_table.copy()
    demands = len(DEMAND) + law.asks_sway()
    tau, rate, signals = (np.full(n, before) for n in (demands, len(memory), len(law.signals)))
    read = {"x": x, "memory": memory, "target": target, "table": table}
    if law.takes_samples():
        call(law.sample, t=0.0, k=k, **read)
    before_it = {name: vector.copy() for name, vector in read.items()}
    work = np.zeros(law.workspace())
    call(law.law, t=0.0, **read, k=k, tau=tau, rate=rate, signals=signals, work=work)
    for name, vector in read.items():
        # NaN is not equal to itself, but unchanged
        same = (vector == before_it[name]) | (np.isnan(vector) & np.isnan(before_it[name]))
        if len(changed := np.flatnonzero(~same)):
            raise LawError(
                f"{describe(law)}: it writes {name}[{changed[0]}], which it may only read"
            )
    return tau, rate, signals


def _ask(plan: Plan) -> None:
    """Raises LawError for an output that the law does not write at the first instant.

    A law that wants the loads is also called with them, all 0.
    """
    law, (tau, rate, signals) = plan.loop.controller, evaluate_law(plan, UNWRITTEN)
    slots = [f"the rate of {name}" for name in plan.states["law"]]
    sway = [SWAY_DEMAND.name] if law.asks_sway() else []
    names = (*DEMAND, *sway, *(part.name for part in law.signals), *slots)
    outputs = zip(names, (*tau, *signals, *rate), strict=True)
    if left := next((name for name, number in outputs if number == UNWRITTEN), ""):
        raise LawError(f"{describe(law)}: it leaves {left} unwritten")
    if law.wants_loads():
        call(
            law.after_saturation,
            t=0.0,
            x=np.array(plan.loop.start),
            memory=plan.first_memory.copy(),
            demand=tau,
            tau=np.zeros(3),
            k=bundle(plan.law_constants),
            table=plan.law_table.copy(),
            rate=rate,
        )


def _check_signals(plan: Plan) -> None:
    """Raises LawError for signals that the log could not take, or would mix up."""
    law = plan.loop.controller
    if isinstance(law.signals, str):
        raise LawError(f"{describe(law)}: its signals are no tuple; write (Signal(...),)")
    plan.about  # noqa: B018  names that are taken twice
    try:
        _check_axes(plan)
    except LawError as error:
        raise LawError(f"{describe(law)}: {error}") from error


def _check_axes(plan: Plan) -> None:
    """Raises LawError unless arrays with an axis in common have as many values along it.

    Also for names and shapes that no log can hold.
    """
    lengths: dict[str, tuple[int, str]] = {}
    names = {*plan.about, PROVENANCE}
    for part, shape in _shapes(plan.loop):
        if part.fixed and not part.axes:
            raise LawError(f"signal {part.name}: it is fixed and has no axis; name one")
        taken = [axis for axis in part.axes if axis in names or not NAME.fullmatch(axis)]
        if taken or part.name == PROVENANCE or 0 in shape:
            what = f"its axis {taken[0]!r}" if taken else f"its name or its shape {shape}"
            raise LawError(f"signal {part.name}: {what} cannot stand in a log; choose another")
        if len(shape) != len(part.axes):
            raise LawError(
                f"signal {part.name}: its values have the shape {shape} at an instant and its axes "
                f"are {part.axes}; name one axis for each dimension"
            )
        for axis, size in zip(part.axes, shape, strict=True):
            known, other = lengths.setdefault(axis, (size, part.name))
            if known != size:
                raise LawError(
                    f"signal {part.name}: it has {size} values along {axis!r}, and {other} has "
                    f"{known}; name their axes differently"
                )


def _shapes(loop: ClosedLoop) -> Iterator[tuple[Signal, tuple[int, ...]]]:
    """The signals that may be vectors, each with its shape at an instant."""
    law, actuator = loop.controller, loop.actuator
    for part, count in (*law.slots(), *Counter((*actuator.states, *actuator.signals_with)).items()):
        yield part, (count,) if part.axes or count > 1 else ()
    yield from ((part, array.shape) for part, array in law.fixed_signals().items())
