"""MATLAB's .mat files: vectors, columns of matrices, and fields of structures as columns."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.identify.logs.contents import Contents, LogFault

WIDEST = 16  # columns of a matrix
OWN = "__"  # begins what MATLAB notes about a file


def read_mat(path: Path) -> Contents:
    """Every vector as a column by its name, "s.field" of a structure, "m_2" of a matrix.

    Rows are those of the longest dimension that most columns have; a timeseries has `Time` and
    `Data`. Raises LogFault, with what to write in MATLAB where the format is another one.
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
    vectors = dict(_vectors({k: v for k, v in content.items() if not k.startswith(OWN)}, ""))
    if not vectors:
        raise LogFault(f"{path}: holds no vectors of numbers")
    lengths = [len(values) for values in vectors.values()]
    rows = max(set(lengths), key=lambda n: (lengths.count(n), n))
    left = [name for name, values in vectors.items() if len(values) != rows]
    warning = f"{', '.join(left)} are left out: they do not have {rows} rows as most columns"
    columns = {name: values for name, values in vectors.items() if len(values) == rows}
    return Contents(columns, warnings=(warning,) if left else ())


def _vectors(content: Any, name: str) -> Iterator[tuple[str, Vector]]:
    """The vectors of numbers in what a file holds, by name."""
    if isinstance(content, dict):
        for key, part in content.items():
            yield from _vectors(part, f"{name}.{key}" if name else key)
    elif hasattr(content, "_fieldnames"):
        fields = {field: getattr(content, field) for field in content._fieldnames}
        yield from _vectors(fields, name)
    elif isinstance(content, np.ndarray) and content.dtype.kind in "fiub" and content.size > 1:
        values = np.asarray(content, float)
        if values.ndim == 1:
            yield name, values
        elif values.ndim == 2 and min(values.shape) <= WIDEST:
            across = values if values.shape[0] >= values.shape[1] else values.T
            for i, column in enumerate(across.T, 1):
                yield f"{name}_{i}", np.where(np.isfinite(column), column, math.nan)
