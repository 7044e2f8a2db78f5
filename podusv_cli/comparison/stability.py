"""What each run's theory.json says, as rows of a table: the bound of V beside V."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from podusv_cli.core.errors import StorageError

HEAD = (
    "run", "part", "lambda [1/s]", "bound of V", "printed form's", "largest V",
    "what the proof needs and this run does not have",
)  # fmt: skip


def check(theory: Mapping[str, Any], path: Path) -> None:
    """StorageError where a run's theory.json is not as podusv writes it."""
    try:
        list(rows({"": theory} if theory else {}))
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise StorageError(f"{path}: damaged: not as podusv writes it ({error})") from error


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
            value, limit = _number(condition["value"], "g"), _number(condition["limit"])
            yield f"{condition['name']} = {value} has to exceed {limit}"
    for said in theory["assumptions"]:
        if not said["holds"]:
            off = f" (off by {_number(said['found'])})" if "found" in said else ""
            yield f"{said['assumption']}{off}"


def _number(number: float | None, form: str = ".3g") -> str:
    return "none" if number is None else f"{number:{form}}"
