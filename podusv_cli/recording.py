"""What comes out of a simulation: named arrays over time, and how it ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from podusv_cli.kernels import Vector

Status = Literal["finished", "diverged", "interrupted"]


@dataclass(frozen=True)
class Recording:
    """Signals by name, each of shape (rows,) or (rows, ...), with `time` [s] along the rows.

    `fixed` holds arrays that do not run over time, such as network centres. `seen` is what the
    observer gathered at every step, thinned log or not. `message` says how a run ended that did
    not finish.
    """

    status: Status
    controller: str
    signals: Mapping[str, Vector]
    fixed: Mapping[str, Vector] = field(default_factory=dict)
    seen: Vector | None = None
    message: str = ""

    def __getitem__(self, name: str) -> Vector:
        """A signal or fixed array; KeyError where there is none."""
        return self.signals[name] if name in self.signals else self.fixed[name]

    def __contains__(self, name: str) -> bool:
        """Whether there is a signal or fixed array of this name."""
        return name in self.signals or name in self.fixed
