"""JSON as podusv writes it: two spaces, keys as given, null for what is no finite number."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from podusv_cli.errors import StorageError
from podusv_cli.logbook.regular import read_text


def encode(content: Mapping[str, Any]) -> bytes:
    """UTF-8 text with a final newline. TypeError for values that JSON does not know."""
    text = json.dumps(_plain(content), indent=2, ensure_ascii=False, allow_nan=False)
    # What the system could not decode in a name or argument keeps its JSON escape.
    return f"{text}\n".encode("utf-8", "backslashreplace")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(inner) for inner in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def read(path: Path) -> dict[str, Any]:
    """A JSON object; raises StorageError where the file holds anything else."""
    try:
        content = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise StorageError(f"cannot read {path}: no JSON ({error})") from error
    if not isinstance(content, dict):
        raise StorageError(f"cannot read {path}: no JSON object")
    return content
