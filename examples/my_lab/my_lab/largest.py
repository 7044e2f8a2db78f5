"""How far east, or west, the vessel ever gets."""

from __future__ import annotations

from podusv_cli.plugin import Accumulator, Metric, Vector, gathered, kernel


@kernel
def watch(s: Vector, seen: Vector) -> None:
    """Keep the largest |y|; s begins with (x, y, psi, u, v, r)."""
    seen[0] = max(seen[0], abs(s[1]))


OF = Accumulator(watch, lambda layout: 1, lambda layout: {})
largest_east = Metric("largest_east", "m", "largest |y|, east or west", OF, gathered(0))
