"""Where errors leave podusv for Python: without its own frames, which tell a user nothing."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from podusv_cli.core.errors import PodusvError, UsageError

if TYPE_CHECKING:
    import pandas as pd

ROOT = Path(__file__).parents[1]
Given = ParamSpec("Given")
Result = TypeVar("Result")


class ParameterError(UsageError, ValueError):
    """A Python value that a function of podusv cannot take."""


def interrupt_with(runs: pd.DataFrame) -> KeyboardInterrupt:
    """What ends a batch that was interrupted; its attribute `runs` is the table so far."""
    finished = int((runs["status"] == "finished").sum())
    stop = KeyboardInterrupt(
        f"interrupted; {finished} of {len(runs)} runs are finished, in the attribute `runs` of "
        "this exception"
    )
    # No class of its own: Python tells the shell of an interrupt only where it is this very class.
    vars(stop)["runs"] = runs
    return stop


def user_level() -> int:
    """The `stacklevel` with which a warning from the caller names the user's line.

    How many frames of podusv lie between differs from function to function of the interface.
    """
    frame, own, level = sys._getframe(1), f"{ROOT}{os.sep}", 1
    while frame.f_back is not None and frame.f_code.co_filename.startswith(own):
        frame, level = frame.f_back, level + 1
    return level


def with_short_traceback(function: Callable[Given, Result]) -> Callable[Given, Result]:
    """The function, whose errors of podusv's own have a traceback of one frame.

    Notebooks and pytest leave that frame out, too. Interrupts and bugs keep theirs.
    """

    @wraps(function)
    def call_shortened(*given: Given.args, **named: Given.kwargs) -> Result:
        """The function's result; its own errors begin where the user called it."""
        __tracebackhide__ = True
        try:
            return function(*given, **named)
        except PodusvError as error:
            raise error.with_traceback(None) from None

    return call_shortened
