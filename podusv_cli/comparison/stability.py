"""The contents of the runs' theory.json as a table: the bounds of V beside V."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from podusv_cli.core.errors import StorageError

HEAD = (
    "run",
    "window",
    "lambda [1/s]",
    "bound of V",
    "as printed",
    "largest V",
    "conditions of the proof that fail",
)


def check(theory: Mapping[str, Any], path: Path) -> None:
    """Raise StorageError if a run's theory.json is not as podusv writes it."""
    try:
        list(rows({"": theory} if theory else {}))
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise StorageError(f"{path}: damaged: not as podusv writes it ({error})") from error


def rows(theories: Mapping[str, Mapping[str, Any]]) -> Iterator[list[str]]:
    """A row of texts for each run and window, under HEAD; `theories` are theory.json by label."""
    for label, theory in theories.items():
        failing = "; ".join(_failing(theory)) or "none"
        for part, window in theory["windows"].items():
            corrected, printed = window["corrected"], window["printed"]
            numbers = (
                corrected["lambda"],
                corrected["bound"],
                printed["bound"],
                window["largest_V"],
            )
            yield [label, part, *map(_number, numbers), failing]


def _failing(theory: Mapping[str, Any]) -> Iterator[str]:
    """The conditions and assumptions that do not hold, in words.

    `theory` is the content of a run's theory.json.
    """
    for condition in theory["conditions"]:
        if not condition["holds"]:
            value, limit = _number(condition["value"], "g"), _number(condition["limit"])
            yield f"{condition['name']} = {value} must exceed {limit}"
    for assumption in theory["assumptions"]:
        if not assumption["holds"]:
            number = f" ({_number(assumption['found'])})" if "found" in assumption else ""
            yield f"not true: {assumption['assumption']}{number}"


def _number(number: float | None, form: str = ".3g") -> str:
    return "none" if number is None else f"{number:{form}}"
