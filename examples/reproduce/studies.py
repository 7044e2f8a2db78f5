"""Fill the tables and numbers of docs/studies.md in from results/studies/; prints the page.

python examples/reproduce/studies.py > results/.table && mv results/.table docs/studies.md
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
from fill_page import ratio, with_numbers, with_rows

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "studies.md"
FOUND = "## What the committed studies found\n"  # where the numbers begin
TOLD = "### True hull and nominal hull\n"
REST = "### All laws\n"
LAWS = ["adaptive_neural", "dsc", "full_backstepping", "pid"]
ABLATED = {"no_adaptation": "no adaptation", "equal_gain": "equal gain"}


def table(study: str, name: str = "summary", metric: str = "iae") -> pd.DataFrame:
    """The rows of a committed table for one metric."""
    return pd.read_csv(ROOT / "results" / "studies" / study / f"{name}.csv").query(
        "metric == @metric"
    )


def pairs(study: str, metric: str = "iae") -> pd.DataFrame:
    """By the two laws."""
    return table(study, "pairs", metric).set_index(["a", "b"])


def percent(share: float) -> str:
    """One decimal."""
    return f"{100 * share:.1f}"


def law_rows(study: str) -> Iterator[list[str]]:
    """Failures and IAE of each law, with intervals."""
    summary = table(study).set_index("law")
    for law in [law for law in (*LAWS, *ABLATED) if law in summary.index]:
        row = summary.loc[law]
        failed = [f"{100 * row[f'failed{end}']:.2f}" for end in ("", "_low", "_high")]
        median = [f"{row[f'q50{end}']:.1f}" for end in ("", "_low", "_high")]
        last = "more than 5 % fail" if row.failed > 0.05 else f"{row.q95:.1f}"
        yield [
            ABLATED.get(law, law),
            *("{} [{}, {}]".format(*one) for one in (failed, median)),
            last,
        ]


def coupled_rows() -> Iterator[list[str]]:
    """CyberShip II with its coupling: failures, IAE and errors of each law, by IAE."""
    study = "rivals_cybership2"
    settled, late, iae = (
        table(study, metric=metric).set_index("law")
        for metric in ("e_steady", "error_after_max", "iae")
    )
    for law in iae.q50.sort_values().index:
        ends = (_millimetres(one.loc[law]) for one in (settled, late))
        yield [law, percent(settled.failed[law]), f"{iae.q50[law]:.0f}", *ends]


def _millimetres(row: Any) -> str:
    ends = (1000 * row.q50, 1000 * row.q95)
    return ", ".join(f"{end:.0f}" if math.isfinite(end) else "fails" for end in ends)


def hull_sentences() -> Iterator[tuple[Any, ...]]:
    """Sentences of the study of hull, sea and start, and their numbers."""
    study = "hull_and_sea"
    iae, beyond = pairs(study), pairs(study, "iae_e")
    pid, li = (("adaptive_neural", law) for law in ("pid", "full_backstepping"))
    won, lost = (percent(iae.loc[pid, side]) for side in ("a_wins", "b_wins"))
    yield "better than PID by more than 1 % in {} % of the draws, and worse in {} %", won, lost
    won, lost = (percent(beyond.loc[pid, side]) for side in ("a_wins", "b_wins"))
    yield "By the error beyond the standoff it is better in {} % and worse in {} %", won, lost
    won, lost = (percent(iae.loc[li, side]) for side in ("b_wins", "a_wins"))
    yield "proposed law by more than 1 % in {} % of the draws, and worse in {} %", won, lost
    yield (
        "The proposed law's IAE is {} [{}, {}] of its in the median, the error {} [{}, {}]",
        *ratio(iae.loc[li]),
        *ratio(beyond.loc[li]),
    )
    turned = table(study, "sensitivity").query("law == 'adaptive_neural'").set_index("quantity")
    yield "of its IAE with start.x is {}.", f"{turned.correlation['start.x']:.2f}"


def told_sentences() -> Iterator[tuple[Any, ...]]:
    """Sentences of the study of true and nominal hulls, and their numbers."""
    study = "unknown_dynamics"
    iae, beyond = pairs(study), pairs(study, "iae_e")
    adapted, equal, li, pid = (
        ("adaptive_neural", law)
        for law in ("no_adaptation", "equal_gain", "full_backstepping", "pid")
    )
    yield (
        "IAE {} [{}, {}] of that without in the median, error beyond the standoff {} [{}, {}]",
        *ratio(iae.loc[adapted]),
        *ratio(beyond.loc[adapted]),
    )
    yield "of `adaptive_neural` and `equal gain` is {} [{}, {}]", *ratio(iae.loc[equal])
    steady = table(study, metric="z_e_steady").set_index("law")
    yield "without adaptation the median is {} m", f"{steady.q50['no_adaptation']:.2f}"
    yield "better by more than 1 % in {} % of the draws and worse", percent(iae.loc[li, "b_wins"])
    yield "proposed to full backstepping is {} [{}, {}]", *ratio(iae.loc[li])
    won = [
        percent(iae.loc[pid, side]) for side in ("a_wins", "b_wins", "b_wins_low", "b_wins_high")
    ]
    yield "PID is worse in {} % of the draws (U3) and better in {} % [{}, {}]", *won
    rows = table(study, "sensitivity").query("law == 'adaptive_neural'").set_index("quantity")
    true = [f"{abs(rows.correlation[name]):.2f}" for name in ("surge_damping", "vessel.m")]
    yield (
        "has a rank correlation above {} (chance) with the IAE of the proposed law; the true "
        "damping in surge has {}, the true mass {}.",
        f"{rows.by_chance.max():.2f}",
        *true,
    )


def rival_sentences() -> Iterator[tuple[Any, ...]]:
    """Sentences on all laws, in forces fixed to the earth and on CyberShip II."""
    best = ("velocity_vector", "momentum_vector")
    named = "`{}` / `{}`".format(*best)
    late = [
        f"{1000 * table(study, metric='error_after_max').set_index('law').q50[best[0]]:.0f}"
        for study in ("rivals_earth", "rivals")
    ]
    yield f"{named} is {{}} [{{}}, {{}}], and the", *ratio(pairs("rivals_earth").loc[best])
    yield "after 60 s is {} in place of {} mm", *late
    yield f"{named} {{}} [{{}}, {{}}] in IAE", *ratio(pairs("rivals_cybership2").loc[best])


def filled(page: str) -> str:
    """The page with its tables and numbers anew; where lines break stays."""
    before, title, text = page.partition(FOUND)
    hulls, told_title, rest = text.partition(TOLD)
    told, rest_title, rivals = rest.partition(REST)
    parts = (
        with_numbers(with_rows(hulls, "| law |", law_rows("hull_and_sea")), hull_sentences()),
        with_numbers(with_rows(told, "| law |", law_rows("unknown_dynamics")), told_sentences()),
        with_numbers(with_rows(rivals, "| law |", coupled_rows()), rival_sentences()),
    )
    return "".join((before, title, parts[0], told_title, parts[1], rest_title, parts[2]))


if __name__ == "__main__":
    print(filled(PAGE.read_text()), end="")
