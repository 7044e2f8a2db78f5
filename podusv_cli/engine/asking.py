"""Is a law what it says it is? Asked once, in plain Python, before it becomes machine code.

There its vectors are bare pointers, and what it writes past their ends is somebody else's number.
"""

from __future__ import annotations

import numpy as np

from podusv_cli.controllers.base import Controller
from podusv_cli.engine.blocks import Aside, Failed, never_returns
from podusv_cli.engine.simulate import ClosedLoop
from podusv_cli.errors import LawError
from podusv_cli.kernels import Vector, bundle

UNWRITTEN = -1.234567890123e-290  # no law writes just this


def check_law(loop: ClosedLoop) -> None:
    """Ask the loop's law at the start of a run, with vectors of the declared sizes.

    Raises LawError for a memory or outputs of another size, an output left unwritten, an exception,
    and for a law that does not return. No number at all is left for the run to tell.
    """
    law = loop.controller
    try:
        with np.errstate(all="ignore"), Aside() as aside:  # which takes it along
            aside.finish(lambda: _ask(loop))
    except TimeoutError:
        raise LawError(f"law {law.label}: asked at the start, {never_returns()}") from None
    except Failed as failed:
        error = failed.__cause__
        if isinstance(error, LawError):
            raise error from None
        if not isinstance(error, (ArithmeticError, ValueError)):
            raise LawError(f"law {law.label}: asked at the start, {failed.told()}") from error


def _ask(loop: ClosedLoop) -> int:
    law, target = loop.controller, loop.first_target()
    memory = law.start(np.array(loop.start), target, loop.nominal)
    _check_memory(law, memory)
    names = [name for name, size in law.slots() for _ in range(size)]
    tau, rate, signals = (np.full(size, UNWRITTEN) for size in (2, len(names), len(law.signals)))
    law.law(
        0.0, np.array(loop.start), memory, target, bundle(law.informed(loop.nominal)), law.table(),
        tau, rate, signals, np.zeros(law.workspace()),
    )  # fmt: skip
    outputs = [*zip(("tau_u_cmd", "tau_r_cmd"), tau, strict=True)]
    outputs += [*zip(law.signals, signals, strict=True)]
    outputs += [(f"the rate of {name}", number) for name, number in zip(names, rate, strict=True)]
    left = next((name for name, number in outputs if number == UNWRITTEN), "")
    if left:
        raise LawError(f"law {law.label}: it leaves {left} unwritten")
    return 0


def _check_memory(law: Controller, memory: Vector) -> None:
    declared = (sum(size for _, size in law.slots()),)
    if np.shape(memory) != declared:
        shapes = f"it starts with a memory of shape {np.shape(memory)}, its slots are {declared}"
        raise LawError(f"law {law.label}: {shapes}")
