"""`make bench`: measure, and write results.md and results.json beside this file."""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.alternatives import plain_engine, python_alternatives
from benchmarks.batch import batch_costs, hours_for_a_million, side_by_side_laws
from benchmarks.by_steps import step_costs
from benchmarks.c_program import build
from benchmarks.commands import commands
from benchmarks.engine import actuators, all_beside_c, growth, law_costs, log_megabytes, seas
from benchmarks.report import markdown
from benchmarks.side_by_side import side_by_side_costs
from benchmarks.timing import machine

HERE = Path(__file__).parent


def beside_c() -> dict[str, Any]:
    """All cases beside the C programs, with progress."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for label, measured in all_beside_c(build(Path(folder))):
            found[label] = measured
            level = measured["ratios"]["podusv / C -O3"][1]
            print(f"  {label}: {level:.2f} of the time of C -O3", file=sys.stderr)
    return found


PARTS: dict[str, Callable[[], Any]] = {
    "machine": machine,
    "beside_c": beside_c,
    "growth": growth,
    "batch": batch_costs,
    "side_by_side_laws": side_by_side_laws,
    "side_by_side": side_by_side_costs,
    "million": hours_for_a_million,
    "log_megabytes": log_megabytes,
    "law": law_costs,
    "actuators": actuators,
    "seas": seas,
    "by_steps": step_costs,
    "plain_engine": plain_engine,
    "alternatives": python_alternatives,
    "commands": commands,
}


def main() -> None:
    """Measure everything; takes about three minutes on two cores."""
    results, began = {}, time.perf_counter()
    for name, part in PARTS.items():
        results[name] = part()
        print(f"{name}: {time.perf_counter() - began:.0f} s", file=sys.stderr)
    (HERE / "results.json").write_text(json.dumps(results, indent=1) + "\n")
    (HERE / "results.md").write_text(markdown(results))
    print(HERE / "results.md")


if __name__ == "__main__":
    main()
