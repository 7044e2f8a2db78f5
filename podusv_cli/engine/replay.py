"""Evaluate a law again and again over logged states, to see what one evaluation costs."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from podusv_cli.engine import signatures
from podusv_cli.engine.simulate import STATE, ClosedLoop
from podusv_cli.kernels import Vector, bundle
from podusv_cli.paths.base import TARGET
from podusv_cli.recording import Recording


def _rows(loop: ClosedLoop, recording: Recording, most: int) -> Vector:
    times = recording["time"]
    chosen = np.unique(np.linspace(0, len(times) - 1, min(most, len(times))).astype(int))
    names = [*STATE, *(name for name, _ in loop.controller.slots())]
    logged = np.column_stack([recording[name][chosen] for name in names])
    k, table = bundle(loop.path.constants()), loop.path.table()
    targets = np.zeros((len(chosen), len(TARGET)))
    for t, target in zip(times[chosen], targets, strict=True):
        loop.path.evaluate(float(t), k, table, target)
    return np.column_stack([times[chosen], targets, logged])


def replayer(
    loop: ClosedLoop, recording: Recording, *, most: int = 1000, evaluations: int = 4000
) -> Callable[[], float]:
    """A function that times one evaluation of the law [ns], as the mean of one replay.

    A replay goes over at most `most` logged rows until it has `evaluations`, in machine code.
    """
    from podusv_cli.engine import compiling  # a loop in plain Python needs no compiler

    rows = _rows(loop, recording, most)
    count, width = rows.shape
    rounds = -(-evaluations // count)
    room = max(width, len(loop.controller.signals)) * 2 + loop.controller.workspace()
    informed = loop.controller.informed(loop.nominal)
    p = np.array(list(informed.values()))
    buffers = (rows.ravel(), p, loop.controller.table(), np.zeros(2), np.zeros(room))
    vectors = [signatures.pointer(buffer) for buffer in buffers]
    replay: Callable[..., None] = compiling.replay()
    law = compiling.entry(signatures.law_entry, loop.controller.law, tuple(informed))

    def timed() -> float:
        began = time.perf_counter_ns()
        replay(law, rounds, count, width, *vectors)
        return float((time.perf_counter_ns() - began) / (rounds * count))

    return timed
