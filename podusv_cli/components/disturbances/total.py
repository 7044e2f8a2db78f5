"""Several disturbances at once: the sum of their loads, and all of their signals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence, Set
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from podusv_cli.components.disturbances.base import ARGUMENTS, Disturbance
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.kernel import (
    Vector,
    arguments_of,
    constants_type,
    kernel,
    scratch,
    shared,
    tail,
)
from podusv_cli.core.plugins import TEXT
from podusv_cli.core.signal import Signal


class SumPart(NamedTuple):
    """What the kernel of the sum has to know of a part."""

    evaluate: Callable[..., None]
    constants: tuple[str, ...]
    places: tuple[int, ...]  # of its signals among those of the sum


class Total(Disturbance):
    """The sum of several disturbances, which a scenario gives as a list."""

    parts: tuple[Any, ...]

    @property
    def of_time(self) -> bool:  # type: ignore[override]
        """Whether no part looks at the state."""
        return all(part.of_time for part in self.parts)

    @property
    def signals(self) -> tuple[Signal, ...]:
        """The signals of all parts, in their order; once where several parts add up to one."""
        return tuple(signal for _, signals in self.told() for signal in signals)

    def told(self) -> Iterator[tuple[Disturbance, tuple[Signal, ...]]]:
        """Each part, with those of its signals that no part before it shares."""
        before: set[Signal] = set()
        for part in self.parts:
            yield part, tuple(s for s in part.signals if not (part.adds_up and s in before))
            before |= set(part.signals)

    def _places(self) -> Iterator[tuple[int, ...]]:
        """For each part the places of its signals among those of the sum.

        A signal that an earlier part has already shares its place, so that both add up there.
        """
        known, behind = self.signals, 0
        for part, own in self.told():
            new = {signal: behind + i for i, signal in enumerate(own)}
            yield tuple(new.get(s, known.index(s)) for s in part.signals)
            behind += len(own)

    def each(self) -> tuple[Disturbance, ...]:
        """Its parts."""
        return self.parts

    def constant_of(self, position: int, name: str) -> str:
        """What the sum calls a part's constant: with the part's position in front."""
        return f"part{position}_{name}"

    def kernel_with(self, vessel: Vessel) -> Callable[..., None]:
        """The kernel of the sum."""
        return _sum(
            tuple(
                SumPart(part.kernel_with(vessel), tuple(part.constants_with(vessel)), places)
                for part, places in zip(self.parts, self._places(), strict=True)
            )
        )

    def constants_with(self, vessel: Vessel) -> dict[str, float]:
        """The constants of all parts by name, each with the part's position in front."""
        return {
            self.constant_of(i, name): number
            for i, part in enumerate(self.parts)
            for name, number in part.constants_with(vessel).items()
        }

    def table_for(self, vessel: Vessel, duration: float) -> Vector:
        """Where each part's table begins, one number a part, then these tables; one vector."""
        tables = [part.table_for(vessel, duration) for part in self.parts]
        starts = np.cumsum([len(tables), *map(len, tables[:-1])]).astype(float)
        return np.concatenate([starts, *tables])

    def shared_places(self) -> list[int]:
        """Where the parts' tables begin. Raises TypeError for a part with places of its own."""
        if any(part.shared_places() for part in self.parts):
            raise TypeError("a part of the list has places in its table that runs have to share")
        return list(range(len(self.parts)))

    def choices(self) -> frozenset[str]:
        """The choices of all parts, by the names of `constant_of`."""
        each = ((i, name) for i, part in enumerate(self.parts) for name in part.choices())
        return frozenset(self.constant_of(*place) for place in each)

    def conflicts(self, vessel: Vessel, step: float) -> Iterator[tuple[str, str]]:
        """Key and message of all parts' conflicts, with the part's position in front of the key."""
        for i, part in enumerate(self.parts):
            yield from ((f"parts[{i}].{key}", text) for key, text in part.conflicts(vessel, step))

    def bounds(self) -> tuple[float, float, float] | None:
        """The sum of the parts' bounds, which their sum need not reach; None if a part has none."""
        each = [part.bounds() for part in self.parts]
        if None in each:
            return None
        u, v, r = np.sum(each, axis=0).tolist()
        return u, v, r


@cache
def _sum(parts: Sequence[SumPart]) -> Callable[..., None]:
    """The kernel that adds up the loads of these parts, with the arguments `ARGUMENTS`.

    Its source is written out, because compiled code cannot choose between functions.
    """
    scope: dict[str, Any] = {"scratch": scratch, "tail": tail, "shared": shared}
    scope["__name__"] = __name__  # podusv's own, which may use `shared`
    lines = [f"def evaluate({', '.join(ARGUMENTS)}):", "    u = v = r = 0.0"]
    written: set[int] = set()
    # By place how many parts write it: a signal of one part alone is found again at the next call
    count = Counter(place for part in parts for place in part.places)
    for i, part in enumerate(parts):
        scope |= {f"evaluate{i}": part.evaluate, f"Constants{i}": constants_type(part.constants)}
        lines += _lines(i, part, written, alone=all(count[place] == 1 for place in part.places))
        written |= set(part.places)
    scope[TEXT] = "\n".join([*lines, "    b[0], b[1], b[2] = u, v, r"])
    exec(compile(scope[TEXT], "sum of disturbances", "exec"), scope)  # noqa: S102
    return kernel(scope["evaluate"])  # type: ignore[no-any-return]


def _lines(i: int, part: SumPart, written: Set[int], alone: bool) -> Iterator[str]:
    """Lines of the kernel of the sum for part `i`: call it, add its load, put its signals away.

    `written` are places of signals that parts before it have written, and that it adds to. One that
    is `alone` at its places finds there what it wrote last, which `again` needs; one whose signals
    add up does not.
    """
    given = ", ".join(f"k.part{i}_{name}" for name in part.constants)
    own = {"k": f"Constants{i}({given})", "table": f"tail(table, begin{i})", "b": f"load{i}"}
    own |= {} if alone else {"again": "0.0"}
    passed = (own.get(a, a) for a in arguments_of(part.evaluate, ARGUMENTS))
    yield f"    load{i} = scratch({3 + len(part.places)})"
    yield f"    begin{i} = int(shared(table[{i}]))"
    for j, place in enumerate(part.places):
        yield f"    load{i}[{3 + j}] = {f'b[{3 + place}]' if alone else '0.0'}"
    yield f"    evaluate{i}({', '.join(passed)})"
    yield from (f"    {axis} += load{i}[{j}]" for j, axis in enumerate("uvr"))
    for j, place in enumerate(part.places):
        yield f"    b[{3 + place}] {'+=' if place in written else '='} load{i}[{3 + j}]"
