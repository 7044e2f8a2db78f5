"""Print the verdicts on the paper's claims in all four readings, made by `make reproduce`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

PAPER = Path(__file__).parents[2] / "results/runs/mu_2017"
READINGS = {
    "P": "printed_compare",
    "F": "figures_compare",
    "S": "figures_compare_standoff",
    "C": "corrected_compare",
}
SIGNS = {"reproduced": "+", "not reproduced": "-", "cannot tell": "?"}


def verdicts(name: str) -> dict[str, dict[str, str]]:
    """The claims of a comparison by name; those about times are in timing.json."""
    files = (PAPER / name / file for file in ("claims.json", "timing.json"))
    found = (json.loads(file.read_text())["claims"] for file in files if file.exists())
    return {claim["claim"]: claim for claims in found for claim in claims}


def main() -> None:
    """Print a line a claim: name, sign in each reading, the claim in words."""
    tables = {letter: verdicts(name) for letter, name in READINGS.items()}
    lines = ["      " + "  ".join(READINGS) + "   + reproduced, - not reproduced, ? cannot tell"]
    for name, claim in sorted(tables["C"].items(), key=lambda item: natural(item[0])):
        signs = "  ".join(SIGNS[table[name]["verdict"]] for table in tables.values())
        lines.append(f"{name:<5} {signs}   {claim['says']}")
    sys.stdout.write("\n".join(lines) + "\n")


def natural(name: str) -> tuple[int, str]:
    """C2 before C10."""
    digits = "".join(filter(str.isdigit, name))
    return int(digits or 0), name


if __name__ == "__main__":
    main()
