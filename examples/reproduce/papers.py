"""Print a line a paper: how many of its claims are reproduced, made by `make reproduce`.

    python examples/reproduce/papers.py mu_2017/corrected_compare lefeber_2003 fossen_2003 ...

A name is a folder below results/runs: one comparison, or all those in it.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path

RUNS = Path(__file__).parents[2] / "results/runs"
VERDICTS = ("reproduced", "not reproduced", "cannot tell")


def verdicts(name: str) -> Counter[str]:
    """How often each verdict is in the comparisons of a folder; those on times are apart."""
    files = [file for form in ("claims", "timing") for file in (RUNS / name).rglob(f"{form}.json")]
    found = (json.loads(file.read_text()).get("claims", ()) for file in files)
    return Counter(claim["verdict"] for claims in found for claim in claims)


def main(*names: str) -> None:
    """A line each."""
    for name in names:
        counts = verdicts(name)
        numbers = ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS)
        sys.stdout.write(f"{name.partition('/')[0]:<14} {counts.total():>3} claims: {numbers}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
