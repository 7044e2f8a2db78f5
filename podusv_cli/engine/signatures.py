"""The few signatures that the loop calls through.

A component's kernel takes its constants as a named tuple `k`; the loop hands over a bare vector
`p`. Each function here is the door between the two. `kernel` and `named` stand for the component's
kernel and for the unpacking of its constants; `bind` puts them in, here as Python, in
`compiling` as machine code.
"""

from __future__ import annotations

from typing import Any

from podusv_cli.kernels import Vector, unpacker, with_globals


def kernel(*arguments: Any) -> None:
    """Stands for a component's kernel."""
    raise NotImplementedError


def named(p: Vector) -> Any:
    """Stands for the unpacking of its constants."""
    raise NotImplementedError


def path_entry(t: float, p: Vector, table: Vector, target: Vector) -> None:
    """A path's door."""
    kernel(t, named(p), table, target)


def disturbance_entry(t: float, x: Vector, p: Vector, table: Vector, b: Vector) -> None:
    """A disturbance's door."""
    kernel(t, x, named(p), table, b)


def law_entry(
    t: float, x: Vector, memory: Vector, target: Vector, p: Vector, table: Vector,
    tau: Vector, rate: Vector, signals: Vector, work: Vector,
) -> None:  # fmt: skip
    """A law's door."""
    kernel(t, x, memory, target, named(p), table, tau, rate, signals, work)


def sample_entry(
    t: float, x: Vector, memory: Vector, target: Vector, p: Vector, table: Vector
) -> None:
    """The door of a law's sampling."""
    kernel(t, x, memory, target, named(p), table)


def actuator_entry(
    t: float, x: Vector, state: Vector, demand: Vector, p: Vector, table: Vector,
    tau: Vector, rate: Vector, signals: Vector,
) -> None:  # fmt: skip
    """An actuator's door."""
    kernel(t, x, state, demand, named(p), table, tau, rate, signals)


def observer_entry(
    t: float, weight: float, s: Vector, row: Vector, p: Vector, seen: Vector
) -> None:
    """An observer's door: state and signals at an instant, and its weight [s] in an integral."""
    kernel(t, weight, s, row, named(p), seen)


def bind(entry: Any, inner: Any, names: tuple[str, ...]) -> Any:
    """`entry` around the kernel `inner` whose constants have these names, as plain Python."""
    return with_globals(entry, entry.__name__, kernel=inner, named=unpacker(names))
