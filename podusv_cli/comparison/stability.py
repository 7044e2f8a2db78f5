"""What each run's theory.json says, as rows of a table: the bound of V beside V."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

HEAD = (
    "run", "part", "lambda [1/s]", "bound of V", "printed form's", "largest V",
    "what the proof needs and this run does not have",
)  # fmt: skip


def rows(theories: Mapping[str, Mapping[str, Any]]) -> Iterator[list[str]]:
    """A row for each run and window; `theories` are contents of theory.json by run."""
    for label, theory in theories.items():
        missing = "; ".join(_missing(theory)) or "nothing"
        for part, window in theory["windows"].items():
            corrected, printed = window["corrected"], window["printed"]
            numbers = (
                corrected["lambda"], corrected["bound"], printed["bound"], window["largest_V"]
            )  # fmt: skip
            yield [label, part, *map(_number, numbers), missing]


def _missing(theory: Mapping[str, Any]) -> Iterator[str]:
    for condition in theory["conditions"]:
        if not condition["holds"]:
            yield "{name} = {value:g} has to exceed {limit:.3g}".format(**condition)
    for said in theory["assumptions"]:
        if not said["holds"]:
            yield said["assumption"] + (f" (off by {said['found']:.3g})" if "found" in said else "")


def _number(number: float | None) -> str:
    return "none" if number is None else f"{number:.3g}"
