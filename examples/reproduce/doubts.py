"""Print results/doubt.csv: what every verdict depends on, most fragile first; by `make doubt`.

    python examples/reproduce/doubts.py FOLDER...

A folder is what `podusv doubt` wrote, below results/.doubt/PAPER or results/.doubt/studies.
"""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

BUILT = "by construction"  # robust, as nothing that was moved acts on it
WORDS = (
    "knife's edge",
    "fragile",
    "under conditions",
    "in combination only",
    "robust where it can tell",
    "robust",
    BUILT,
)
UNKNOWN = "cannot tell"
COLUMNS = ("paper", "scenario", "claim", "verdict", "word", "draws", "nearest", "share", "beside")


def rows(folder: Path) -> Iterator[dict[str, Any]]:
    """The claims of an answer, with the paper and the scenario that they are of."""
    studied = folder / "answer"  # beside the studies that were made for it
    answer = studied if studied.is_dir() else folder
    claims = {
        claim["claim"]: claim for claim in json.loads((answer / "doubt.json").read_text())["claims"]
    }
    with (answer / "doubt.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            word = BUILT if row["word"] == "robust" and row["acted"] == "0" else row["word"]
            turns = claims[row["claim"]]["turns"]
            yield {
                **row,
                "word": word,
                "paper": folder.parent.name,
                "scenario": folder.name,
                "own": claims[row["claim"]]["source"].startswith("ours"),
                "turns": [turn for turn in turns if not turn["task"]],
                "others": [turn for turn in turns if turn["task"]],
            }


def nearest(turns: Sequence[dict[str, Any]]) -> tuple[str, str]:
    """The value that turns the verdict, and its distance."""
    if not turns:
        return "", ""
    turn = turns[0]
    other = turn["turns_at"]
    if turn["share"] is None:
        return f"{turn['key']}: {other}", ""
    far = f"{100.0 * turn['share']:.3g} %"
    if turn["share"] < 0.01:
        return f"{turn['key']} {other - turn['own']:+.2g} {turn['unit']}".rstrip(), far
    return f"{turn['key']} {other:.3g} {turn['unit']}".rstrip() + f" ({turn['own']:.3g})", far


def cells(row: dict[str, Any]) -> list[str]:
    """A row of the table; one that nobody can tell has nothing that turns it."""
    if not row["word"]:
        return [row["paper"], row["scenario"], row["claim"], UNKNOWN, UNKNOWN, "", "", "", ""]
    counts = [int(row[name]) for name in ("kept", "turned", "unknown", "failed")]
    open_ = f", {row['unknown']} cannot tell" if int(row["unknown"]) else ""
    draws = f"{row['kept']} of {sum(counts)}{open_}" if any(counts) else ""
    place, far = nearest(row["turns"])
    other, by = row["word_for_neighbours"], " by " + nearest(row["others"])[0]
    beside = f"{other}{by}" if other != row["word"] and row["others"] else ""
    verdict = row["verdict"]
    if row["own"]:
        verdict = {"reproduced": "holds", "not reproduced": "fails"}.get(verdict, verdict)
    told = (verdict, row["word"], draws, place, far, beside)
    return [row["paper"], row["scenario"], row["claim"], *told]


def order(row: dict[str, Any]) -> tuple[int, float, str]:
    """Most fragile first."""
    share = float(row["nearest_share"] or "inf")
    return WORDS.index(row["word"]), share, row["claim"]


def main(*folders: str) -> None:
    """The table."""
    found = [row for folder in folders for row in rows(Path(folder))]
    decided = sorted((row for row in found if row["word"]), key=order)
    lines = csv.writer(sys.stdout, lineterminator="\n")
    lines.writerow(COLUMNS)
    lines.writerows(map(cells, [*decided, *(row for row in found if not row["word"])]))


if __name__ == "__main__":
    main(*sys.argv[1:])
