"""Fill the tables and numbers of docs/bench.md in from results/bench/; prints the page.

python examples/reproduce/bench.py > results/.table && mv results/.table docs/bench.md
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from fill_page import with_numbers, with_rows

from podusv_cli.studies.bench.standing import CROSS, PLACE, by_vessel, leaderboard, middle

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "bench.md"
RUNS, BOATS, POSES, OPTIMA = (
    pd.read_csv(ROOT / "results" / "bench" / f"{name}.csv")
    for name in ("runs", "boats", "dp", "optima")
)
HOLDING, FERRY = "## Holding a pose\n", "The ferry:\n"
SEAS = ["calm", "slight", "moderate", "rough"]
BOARDS, BOAT_BOARDS = (
    {vessel: leaderboard(rows) for vessel, rows in by_vessel(made).items()}
    for made in (RUNS, BOATS)
)
LENGTHS = {"cybership2": 1.255, "otter": 2.0, "paper_nonlinear": 1.255, "revolt": 3.0}
CONDITIONS = ["calm", "sea", "hull_other", "sampled"]  # beside the optimum
FAMILY = ["dsc", "full_backstepping", "adaptive_neural", "adaptive_neural_crab"]
HAND = ["adrc", "hand_position", "sliding_mode", "super_twisting"]


def over_optimum() -> pd.DataFrame:
    """IAE over the optimum's, on the paper's hull; what laws are told does not change that."""
    least = OPTIMA.set_index(["task", "condition"]).optimum
    runs = RUNS[(RUNS.vessel == "paper_nonlinear") & RUNS.condition.isin(CONDITIONS)]
    seas = np.where(runs.condition == "calm", "calm", "sea")
    optimum = [least[place] for place in zip(runs.task, seas, strict=True)]
    return runs.assign(of=runs.iae.where(runs.status == "finished", np.inf) / optimum)


def law_rows() -> Iterator[list[str]]:
    """Mean rank and failures on each hull, then the ratios to the optimum; by mean of the ranks."""
    ratios = over_optimum().groupby(["law", "condition"]).of.agg(middle).unstack()[CONDITIONS]
    for law in RUNS.groupby("law")["rank"].mean().sort_values(kind="stable").index:
        boards = [board.loc[law] for board in BOARDS.values()]
        ranks = [f"{board.mean_rank:.1f}, {board.failed:.0f}" for board in boards]
        yield [law, *ranks, *(f"{r:.2f}" if np.isfinite(r) else CROSS for r in ratios.loc[law])]


def boat_rows() -> Iterator[list[str]]:
    """On each boat rank and failures, ratio to the best and variation; by rank on the Otter."""
    for law in BOAT_BOARDS["otter"].index:
        cells = (_boat_cells(board.loc[law]) for board in BOAT_BOARDS.values())
        yield [law, *(cell for three in cells for cell in three)]


def _boat_cells(row: Any) -> tuple[str, str, str]:
    """A cross where too many runs failed."""
    told = (f"{row.median_ratio:.2f}", f"{row.variation:.3g}")
    return f"{row.mean_rank:.1f}, {row.failed:.0f}", *(
        told if np.isfinite(row.median_ratio) else (CROSS, CROSS)
    )


def sentences() -> Iterator[tuple[Any, ...]]:
    """Sentences with places for numbers, and the numbers."""
    axes = ("law", "task", "vessel", "condition")
    counts = [RUNS[name].nunique() for name in axes]
    said = "`make bench-laws`: {} laws over {} tasks, {} vessels and {} conditions, {} runs"
    yield said, *counts, len(RUNS)
    best = RUNS[RUNS.ratio == 1.0].groupby("law").size()
    yield (
        "Over all {} cases `super_twisting` has the least IAE in {}, `velocity_vector` in {}, "
        "`momentum_vector` in {}.",
        len(RUNS) // counts[0],
        *best[["super_twisting", "velocity_vector", "momentum_vector"]],
    )
    beyond = {vessel: f"{board.median_ratio_e.pid:.3g}" for vessel, board in BOARDS.items()}
    yield (
        "at {} times the best law in the median on `cybership2`, {} on the Otter, {} on "
        "`paper_nonlinear` and {} on ReVolt.",
        *(beyond[vessel] for vessel in ("cybership2", "otter", "paper_nonlinear", "revolt")),
    )
    yield from _where_failing_begins()
    yield from _who_fails()
    by = RUNS.pivot_table("rank", "law", "condition")
    yield (
        "falls from mean rank {} in calm water to {}, `sliding_mode` from {} to {}.",
        *(f"{r:.1f}" for law in HAND[1:3] for r in by.loc[law, ["calm", "hull_light"]]),
    )
    yield "change no mean rank by more than {}.", f"{(by.sea_fixed - by.sea).abs().max():.1f}"
    runs = over_optimum()
    above = 100 * (runs[runs.condition == "sea"].groupby("task").of.min() - 1)
    corners = ["lawnmower", "square", "station"]
    smooth = above.drop(corners)
    yield (
        "the best law is {} to {} % above the optimum. At corners it is {} and {} % above it "
        "(`lawnmower`, `square`), and {} % where",
        *(f"{percent:.0f}" for percent in (smooth.min(), smooth.max(), *above[corners])),
    )
    yield from _boat_sentences()


def lost_within(metric: str, lengths: float) -> pd.Series:
    """How many runs of each law diverge, or end so many hull lengths off."""
    return (
        ((RUNS.status == "diverged") | (RUNS[metric] > lengths * RUNS.vessel.map(LENGTHS)))
        .groupby(RUNS.law)
        .sum()
    )


def _where_failing_begins() -> Iterator[tuple[Any, ...]]:
    limits = (("e_steady", 0.5), ("e_steady", 0.3), ("z_e_steady", 0.5))
    half, near, plain = (lost_within(*limit) for limit in limits)
    yield (
        "PID ({} of 256 cases), at 0.3 lengths `momentum_vector` ({}; PID {}), by the distance to "
        "the target `momentum_vector` ({}; PID {}).",
        half.pid,
        *(lost[law] for lost in (near, plain) for law in ("momentum_vector", "pid")),
    )


def failures(query: str, runs: pd.DataFrame = RUNS) -> pd.Series:
    """How many runs of each law fail among those that a query names."""
    chosen = runs.query(query)
    return (chosen.status != "finished").groupby(chosen.law).sum()


def _who_fails() -> Iterator[tuple[Any, ...]]:
    pods = failures("condition == 'pod'")[HAND]
    yield "{} to {} of 32 cases), since they do not count", pods.min(), pods.max()
    sampled = failures("condition == 'sampled'")
    family = sampled[FAMILY]
    yield "in {} to {} of 32 cases, PID in {} ([why]", family.min(), family.max(), sampled.pid
    corners = failures("task in ('lawnmower', 'square')")
    yield "full backstepping fails in {} of 64 cases", corners.full_backstepping
    resting = failures("task == 'station'")
    yield (
        "`velocity_vector` fails in {} of 32 cases, `momentum_vector` in {}; PID in {}.",
        *resting[["velocity_vector", "momentum_vector", "pid"]],
    )


def _boat_sentences() -> Iterator[tuple[Any, ...]]:
    counts = [BOATS[name].nunique() for name in ("law", "task", "vessel", "condition")]
    yield (
        "{} laws over {} tasks of legs, {} vessels and {} conditions, {} runs",
        *counts,
        len(BOATS),
    )
    otter, wamv = BOAT_BOARDS["otter"], BOAT_BOARDS["wamv"]
    failed = (otter.failed + wamv.failed).astype(int)
    yield (
        "{} times the best in the median on either, no failure",
        f"{otter.median_ratio.momentum_vector:.2f}",
    )
    tuned = ["ardupilot", "ardupilot_l1"]
    ratios = [f"{r:.2f}" for board in (otter, wamv) for r in board.median_ratio[tuned]]
    yield "Otter {} and {}, WAM-V {} and {}, no failure", *ratios
    firmware = [f"{law}_firmware" for law in tuned]
    yield "with the firmware's gains {} and {} of 48 fail", *failed[firmware]
    px4 = [f"{board.median_ratio.px4:.2f}" for board in (otter, wamv)]
    yield "Otter {}, WAM-V {}, fails in {} of 48", *px4, failed.px4
    iae = BOATS.pivot_table("iae", PLACE, "law")
    better = (iae.momentum_vector < iae.ardupilot_l1).groupby("vessel").sum()
    yield (
        "is better than L1 in {} of 24 cases on the Otter and in {} on the WAM-V",
        better.otter,
        better.wamv,
    )
    yield (
        "L1 fails on the Otter in {} of 24 cases and the position controller in {}, on the WAM-V "
        "in {} and {}; with the wheels' gains PX4 in {} and {}.",
        *(f"{x:.0f}" for board in (otter, wamv) for x in board.failed[firmware[::-1]]),
        *(f"{board.failed.px4_r1:.0f}" for board in (otter, wamv)),
    )
    windy = failures("vessel == 'wamv' and condition not in ('calm', 'current')", BOATS)
    yield "On the WAM-V in wind it fails in {} of 16 cases", windy.px4


def pose_rows(vessel: str) -> Iterator[list[str]]:
    """Of laws that hold a pose: rank, ratio, and what each settles at in each sea [mm]; by rank."""
    rows = POSES[POSES.vessel == vessel]
    for law, row in leaderboard(rows).iterrows():
        ratio = f"{row.median_ratio:.2f}" if np.isfinite(row.median_ratio) else CROSS
        held = rows[(rows.task == "hold") & (rows.law == law)].set_index("condition").loc[SEAS]
        ends = zip(held.status, 1000.0 * held.z_e_steady, strict=True)
        shown = [f"{float(f'{end:.3g}'):g}" if one == "finished" else CROSS for one, end in ends]
        yield [str(law), f"{row.mean_rank:.1f}, {row.failed:.0f}", ratio, *shown]


def pose_sentences() -> Iterator[tuple[Any, ...]]:
    """Of laws that hold a pose."""
    counts = [POSES[name].nunique() for name in ("law", "task", "vessel", "condition")]
    said = "{} laws over {} tasks, {} vessels and {} conditions, {} runs"
    yield said, *counts, len(POSES)
    lost = failures("vessel == 'milliampere'", POSES).drop(["pid", "pd_fed"])
    yield "drift off** in {} of 32 cases", lost.sum()


def filled(page: str) -> str:
    """The page with its tables and numbers anew; where lines break stays."""
    page, holding, poses = page.partition(HOLDING)
    page = with_rows(page, "| law | `cybership2` |", law_rows())
    page = with_numbers(with_rows(page, "| law | Otter |", boat_rows()), sentences())
    model, ferry, boat = with_numbers(poses, pose_sentences()).partition(FERRY)
    model = with_rows(model, "| law | rank, failed |", pose_rows("cybership2"))
    boat = with_rows(boat, "| law | rank, failed |", pose_rows("milliampere"))
    return "".join((page, holding, model, ferry, boat))


if __name__ == "__main__":
    print(filled(PAGE.read_text()), end="")
