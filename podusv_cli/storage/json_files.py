"""JSON files, read with every doubt about them."""

from __future__ import annotations

import json
import math
from collections import Counter
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from podusv_cli.core.errors import StorageError
from podusv_cli.storage.files import read_text

LONGEST = 300  # digits of an integer that is a finite float
Model = TypeVar("Model", bound=BaseModel)


def read(path: Path) -> dict[str, Any]:
    """Read a JSON object; raises StorageError for anything that podusv does not write."""
    return parse_json(read_text(path), path)


def parse_json(text: str, path: Path) -> dict[str, Any]:
    """As `read`, of the text of the file at `path`, which messages name.

    Python's json takes a key twice, NaN and numbers that become infinite; this does not.
    """
    try:
        content = json.loads(
            text,
            object_pairs_hook=_object,
            parse_float=_finite,
            parse_int=_whole,
            parse_constant=_finite,
        )
    except (ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise StorageError(f"cannot read {path}: not valid JSON ({reason})") from error
    if not isinstance(content, dict):
        raise StorageError(f"cannot read {path}: no JSON object")
    return content


def read_as(path: Path, model: type[Model]) -> Model:
    """Read a JSON object of known keys; raises StorageError for a wrong one, with its place."""
    return parsed_as(read_text(path), path, model)


def parsed_as(text: str, path: Path, model: type[Model]) -> Model:
    """As `read_as`, of the text of the file at `path`, which messages name."""
    try:
        # By way of JSON text: from Python's own lists a strict model would take no tuples.
        return model.model_validate_json(
            json.dumps(parse_json(text, path))
        )  # a list is a tuple, too
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise StorageError(
            f"cannot read {path}: damaged, not as podusv wrote it ({place}: {first['msg']})"
        ) from error


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """The dict of a JSON object. Raises ValueError for a key that comes twice or does not show."""
    entries = dict(pairs)
    if len(entries) != len(pairs):
        ((twice, _),) = Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f"{twice[:60]!r} is given twice")
    if not all(map(str.isprintable, entries)):
        raise ValueError("a key holds characters that do not show")
    return entries


def _finite(digits: str) -> float:
    """A number of a JSON text. Raises ValueError for one that floats cannot hold, as 1e999."""
    number = float(digits)
    if not math.isfinite(number):
        raise ValueError(f"{digits:.40} is no finite number")
    return number


def _whole(digits: str) -> int:
    """A whole number from its text. Raises ValueError for one too large for a float."""
    # Whatever reads the number may want it as a float.
    return int(digits) if len(digits) < LONGEST else int(_finite(digits))
