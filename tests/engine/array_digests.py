"""Digests of all arrays of three shipped scenarios: the same on every system and processor.

python tests/engine/array_digests.py > tests/engine/array_digests.json
"""

from __future__ import annotations

import hashlib
import json
import sys

import numpy as np

from podusv_cli.scenario.case import Case
from podusv_cli.scenario.load import load
from podusv_cli.workflows.execute import Stopwatch, add_derived, simulate_case

# With networks and the monitor; with waves, wind, sensors and a filter; behind a pod.
SCENARIOS = ("mu_2017/corrected", "sea/sensors", "pod/single")
SETS = ("simulation.duration=12", "log.every=10")


def digests_of(name: str) -> dict[str, str]:
    """A short digest of each array that a scenario's log has, by its name."""
    loaded = load(f"podusv:{name}.yaml", SETS)
    label, single = next(iter(loaded.scenario.singles().items()))
    case = Case.of(single)
    whole, _ = add_derived(case, simulate_case(case, Stopwatch()))
    arrays = {**whole.signals, **whole.fixed}
    return {f"{label} {signal}": digest(values) for signal, values in sorted(arrays.items())}


def digest(values: np.ndarray) -> str:
    """Of the numbers as they lie in a file; NaN has one form there."""
    numbers = np.asarray(values, "<f8")
    numbers = np.where(np.isnan(numbers), np.nan, numbers)
    return hashlib.sha256(numbers.tobytes()).hexdigest()[:12]


if __name__ == "__main__":
    made = {name: digests_of(name) for name in SCENARIOS}
    json.dump(made, sys.stdout, indent=1)
    print()
