"""How many samples a test takes: few by default, all of them with PODUSV_FAULTS=full."""

import os
from collections.abc import Sequence
from itertools import cycle, product
from typing import Any, TypeVar

import pytest

T = TypeVar("T")


def count(few: T, full: T) -> T:
    """`full` where the environment variable PODUSV_FAULTS is `full`, else `few`."""
    return full if os.environ.get("PODUSV_FAULTS") == "full" else few


def each_with_some(commands: Sequence[tuple[str, ...]], others: Sequence[Any]) -> list[Any]:
    """Each command with one of the other things in turn; with all, where all samples are taken."""
    pairs = count(zip(commands, cycle(others), strict=False), product(commands, others))
    return [
        pytest.param(words, other, id=f"{' '.join(words)}-{other.__name__}")
        for words, other in pairs
    ]


def few(commands: Sequence[tuple[str, tuple[str, ...]]]) -> list[Any]:
    """All commands; but for the first `run` and the first `compare` they are slow tests."""
    first = {words[0]: place for place, (_, words) in reversed(list(enumerate(commands)))}
    quick = {first["run"], first["compare"]}
    return [
        pytest.param(*command, marks=() if place in quick else pytest.mark.slow)
        for place, command in enumerate(commands)
    ]
