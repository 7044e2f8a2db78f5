"""How much work something is, counted in calls: the same on every machine, however busy it is."""

import cProfile
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")


def counted(work: Callable[[], Result]) -> tuple[Result, int]:
    """What the work returns, and how many functions it called, Python's own among them."""
    profile = cProfile.Profile()
    result = profile.runcall(work)
    return result, sum(entry.callcount for entry in profile.getstats())
