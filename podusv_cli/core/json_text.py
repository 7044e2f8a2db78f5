"""JSON as text: indented by two spaces, with null for numbers that are not finite."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from podusv_cli.core import escaping


def encode(content: Mapping[str, Any]) -> bytes:
    """UTF-8 text with a final newline. TypeError for values that JSON does not know."""
    text = json.dumps(_plain(content), indent=2, ensure_ascii=False, allow_nan=False)
    return f"{escaping.json(text)}\n".encode()


def plain(content: Mapping[str, Any]) -> dict[str, Any]:
    """The content as JSON gives it back."""
    return dict(json.loads(encode(content)))


def _plain(value: Any) -> Any:
    """A value that JSON can hold: arrays as lists, numpy's numbers as Python's, NaN as null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(inner) for inner in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value
