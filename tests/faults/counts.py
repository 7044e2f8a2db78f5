"""How many samples a test takes: few by default, all of them with PODUSV_FAULTS=full."""

from __future__ import annotations

import os


def count(few: int, full: int) -> int:
    """`full` where the environment variable PODUSV_FAULTS is `full`, else `few`."""
    return full if os.environ.get("PODUSV_FAULTS") == "full" else few
