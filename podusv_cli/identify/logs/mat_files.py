"""MATLAB's .mat files: vectors, columns of matrices, and fields of structures as columns."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.identify.logs.contents import Contents, LogFault, list_names

WIDEST = 16  # columns of a matrix
OWN = "__"  # begins what MATLAB notes about a file


def read_mat(path: Path) -> Contents:
    """Every vector as a column by its name, "s.field" of a structure, "m_2" of a matrix.

    Rows are as many as most vectors have numbers. What is no vector or narrow matrix of real
    numbers is named. Raises LogFault, with what to write in MATLAB for another format.
    """
    from scipy.io import loadmat  # slow to import

    try:
        content = loadmat(str(path), squeeze_me=True, struct_as_record=False)
    except NotImplementedError as error:
        raise LogFault(
            f"{path}: is a .mat file of version 7.3; save it as -v7, or write a table with "
            "writetable"
        ) from error
    except Exception as error:
        raise LogFault(f"{path}: cannot be read: it is no .mat file, or damaged") from error
    parts = {name: part for name, part in content.items() if not name.startswith(OWN)}
    vectors, odd = dict[str, Vector](), list[str]()
    for name, values in _vectors(parts, ""):
        if values is None or name in vectors:
            odd.append(name)
        else:
            vectors[name] = values
    if not vectors:
        raise LogFault(f"{path}: holds no vectors of numbers")
    lengths = [len(values) for values in vectors.values()]
    rows = max(set(lengths), key=lambda n: (lengths.count(n), n))
    short = [name for name, values in vectors.items() if len(values) != rows]
    whole = {name: values for name, values in vectors.items() if len(values) == rows}
    why = {f"they do not have {rows} rows": short, "they are no vectors of real numbers": odd}
    lines = (f"left out, {what}: {list_names(names)}" for what, names in why.items() if names)
    return Contents(whole, warnings=tuple(lines))


def _vectors(content: Any, name: str) -> Iterator[tuple[str, Vector | None]]:
    """The vectors of numbers in what a file holds, by name; None for other arrays than these."""
    if isinstance(content, dict):
        for key, part in content.items():
            yield from _vectors(part, f"{name}.{key}" if name else key)
    elif hasattr(content, "_fieldnames"):
        fields = {field: getattr(content, field) for field in content._fieldnames}
        yield from _vectors(fields, name)
    elif isinstance(content, np.ndarray) and content.size > 1:
        narrow = content.ndim == 1 or (content.ndim == 2 and min(content.shape) <= WIDEST)
        if content.dtype.kind not in "fiub" or not narrow:
            yield name, None
            return
        values = np.where(np.isfinite(content), content, math.nan).astype(float)
        if values.ndim == 1:
            yield name, values
            return
        across = values if values.shape[0] >= values.shape[1] else values.T
        for i, column in enumerate(across.T, 1):
            yield f"{name}_{i}", column
