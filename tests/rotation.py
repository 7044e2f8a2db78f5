"""A part of a matrix for `make test`, in turn; the rest is long."""

from collections.abc import Sequence
from typing import Any

import pytest


def one_in(count: int, cases: Sequence[Any], first: int = 0) -> list[Any]:
    """Parameters: every so manieth case from `first` on, and the others as long tests."""
    return [
        pytest.param(
            *(case if isinstance(case, tuple) else (case,)),
            marks=[pytest.mark.long] * (place % count != first),
        )
        for place, case in enumerate(cases)
    ]
