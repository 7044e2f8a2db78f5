"""Signals that follow from logged ones, declared beside the law or theory they belong to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal


@dataclass(frozen=True)
class Derived:
    """A signal computed from logged ones."""

    signal: Signal
    needs: tuple[str, ...]
    compute: Callable[[Recording], Vector]

    @property
    def name(self) -> str:
        """The signal's name."""
        return self.signal.name


def difference(signal: Signal, minuend: str, subtrahend: str, *beside: str) -> Derived:
    """One logged signal less another, where those `beside` them are logged, too."""
    needs = (minuend, subtrahend, *beside)
    return Derived(signal, needs, lambda log: log[minuend] - log[subtrahend])


def norm(signal: Signal, vector: str) -> Derived:
    """The Euclidean norm of a logged vector at each time."""
    return Derived(signal, (vector,), lambda log: np.linalg.norm(log[vector], axis=1))
