"""Networks for the law `policy`, as the base64 of a safetensors file that is written here."""

import base64
import json
from itertools import pairwise
from typing import Any

import numpy as np

DTYPES = {"float32": "F32", "float64": "F64", "float16": "F16", "int64": "I64"}


def packed(tensors: dict[str, Any], **remarks: str) -> bytes:
    """A safetensors file: the length of a header, the header, the numbers."""
    header: dict[str, Any] = {"__metadata__": remarks} if remarks else {}
    numbers = b""
    for name, tensor in tensors.items():
        own = np.asarray(tensor)
        ends = [len(numbers), len(numbers) + own.nbytes]
        header[name] = {"dtype": DTYPES[str(own.dtype)], "shape": own.shape, "data_offsets": ends}
        numbers += own.tobytes()
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + numbers


def content(tensors: dict[str, Any]) -> str:
    """The same as a scenario has it."""
    return base64.b64encode(packed(tensors)).decode()


def symmetric() -> dict[str, Any]:
    """A network that steers to port as it steers to starboard, and follows a slow target.

    Two units see what is the same in a mirror, two what changes its sign.
    """
    first = np.zeros((4, 8))
    first[0, [0, 2, 5]] = 0.2, -0.4, 0.4
    first[1, [2, 5]] = -0.3, 0.2
    first[2, [1, 4, 7]] = 0.05, -0.6, 0.8
    first[3, [3, 4, 6]] = 0.1, -0.5, 0.2
    return {
        "0.weight": first,
        "0.bias": np.array([0.1, -0.2, 0.0, 0.0]),
        "2.weight": np.array([[1.5, 0.5, 0.0, 0.0], [0.0, 0.0, 1.2, 0.4]]),
        "2.bias": np.array([0.05, 0.0]),
    }


def drawn(sizes: list[int], seed: int = 3, dtype: Any = np.float64) -> dict[str, Any]:
    """Layers of these sizes with drawn numbers, named as torch does."""
    random = np.random.default_rng(seed)
    found = {}
    for i, (before, after) in enumerate(pairwise(sizes)):
        found[f"{2 * i}.weight"] = random.normal(0.0, before**-0.5, (after, before)).astype(dtype)
        found[f"{2 * i}.bias"] = random.normal(0.0, 0.1, after).astype(dtype)
    return found
