"""What a user asks of a command: one set of options for all of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Any


def silent(*_: Any) -> None:
    """Tell nobody."""


@dataclass(frozen=True)
class Request:
    """The options of `podusv run`, `compare`, `sweep` and the others; see their help.

    A command reads those that it has, and leaves the others alone.
    """

    overrides: Sequence[str] = ()  # as `--set` has them: `vessel.m=24`
    out: Path | None = None  # the folder of the result, by default one that its name gives
    _: KW_ONLY
    force: bool = False  # whether a finished result there is replaced
    figures: bool = True
    argv: Sequence[str] = ()  # the command line, for the record
    plugins: Sequence[str] = ()  # files beside those that a scenario names
    trust: bool = False  # whether plug-in files of a folder may be executed
    allow_large: bool = False
    workers: int = 0  # processes at a time; 0: one a core
    controller: str = ""  # which of `controllers`
    # of a comparison
    names: Sequence[str] = ()  # of figures, as `figures.drawing` has them
    formats: Sequence[str] = ("png",)  # of figures
    metrics: Sequence[str] = ()  # those that are asked for; all where empty
    align: str = ""  # "start" lays a log's clock and place on the first run, "place" its place
    ratios: bool = False  # whether comparison.tex has ratios to the first run
    doubt: bool = False  # whether it also says what its verdicts hang on
    # of a study or search
    scheduler: str = ""  # of a Dask cluster, as tcp://host:port
    seconds: float = math.inf  # of computing, after which no unit is begun
    shard: tuple[int, int] = (1, 1)  # which part of how many
    # whom to tell
    say: Callable[..., None] = silent  # what is done, or what a run chose
    warn: Callable[..., None] = silent  # what is odd, and no error
    begin: Callable[..., None] = silent  # of a search before its first run
    compiling: Callable[[float], None] | None = None  # the fraction that is, if any is missing
