"""Differences between two runs in words, for `rerun` and `diff`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from podusv_cli.comparison.log_difference import Deviation, LogDifference
    from podusv_cli.comparison.run_difference import Change

DIFFERENT = 3  # exit code
COUNTABLE = 1000  # ulps; beyond, only the relative difference says something


def deviation_in_words(d: Deviation) -> str:
    """`psi_e at t = 0.3 s: 0.1 -> 0.2 rad (relative difference 0.5)`."""
    when = "" if d.time is None else f" at t = {d.time!r} s"
    return f"{d.signal}{when}: {d.one!r} -> {d.other!r} {d.unit} ({size(d)})"


def size(d: Deviation) -> str:
    """How far apart the two numbers are."""
    if math.isinf(d.gap):
        return "one is not finite"
    if d.ulps == 0:
        return "the sign of zero"
    if d.ulps is not None and d.ulps <= COUNTABLE:
        return f"{d.ulps} ulp, relative difference {d.relative:.2g}"
    return f"relative difference {d.relative:.2g}"


def changes_in_words(changes: Mapping[str, Change]) -> str:
    """`a 1 -> 2; b x -> y`."""
    return "; ".join(change_in_words(key, change) for key, change in changes.items())


def change_in_words(key: str, change: Change) -> str:
    """`a 1 -> 2`, with - for no value."""
    from podusv_cli.scenario.phrases import as_yaml

    one, other = ("-" if value is None else as_yaml(value) for value in change)
    return f"{key} {one} -> {other}"


def log_in_words(log: LogDifference) -> Iterator[str]:
    """Sentences about everything in which two logs differ but the signals' largest differences."""
    if log.first:
        yield f"first difference: {deviation_in_words(log.first)}"
        yield f"{len(log.largest)} of {len(log.compared)} signals differ"
    for name, (one, other) in log.endings.items():
        yield f"{name}: {one or '-'} -> {other or '-'}"
    if len(set(log.rows)) > 1:
        yield "rows: {} -> {}, compared at the {} times that both have".format(*log.rows)
    for names, what in (
        (log.reshaped, "of another size"),
        (log.only_one, "in the first only"),
        (log.only_other, "in the second only"),
    ):
        if names:
            yield f"{what}: {', '.join(names)}"
