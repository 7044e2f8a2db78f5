"""What podusv is meant to reach, and whether it does."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from benchmarks.cases import CASES, LAWS, Case
from benchmarks.commands import FEW, STUDY, short_run

Results = Mapping[str, Any]
USUAL = [Case(law, "" if law == "pid" else "27 grid").label for law in LAWS]
MANY_NODES = [case.label for case in CASES if "125" in case.network]
LISTED = [case.label for case in CASES if "listed" in case.network]
RUN = "podusv run --no-figures"


@dataclass(frozen=True)
class Goal:
    """A number that is to stay at or below a limit; `measured` finds it in the results."""

    says: str
    most: float
    measured: Callable[[Results], float]
    unit: str = ""


def _worst(labels: list[str], ratio: str) -> Callable[[Results], float]:
    return lambda results: max(
        float(results["beside_c"][label]["ratios"][ratio][1]) for label in labels
    )


def _steps(results: Results) -> float:
    cost = results["growth"]["steps"]
    return float(cost["100000"][1] / cost["10000"][1])


def _nodes(results: Results) -> float:
    cost = {int(nodes): values[1] for nodes, values in results["growth"]["nodes"].items()}
    few, some, many = sorted(cost)[-3:]
    slopes = (cost[b] - cost[a] for a, b in ((few, some), (some, many)))
    first, last = (
        slope / count for slope, count in zip(slopes, (some - few, many - some), strict=True)
    )
    return float(last / first)


def _seconds(command: str) -> Callable[[Results], float]:
    return lambda results: float(results["commands"][command]["seconds"][1])


def _beside_imports(command: str) -> Callable[[Results], float]:
    return lambda results: float(results["commands"][command]["ratio"][1])


def _memory(command: str) -> Callable[[Results], float]:
    return lambda results: float(
        results["commands"][command]["megabytes"][1] - results["log_megabytes"]
    )


def _study_beyond_a_run(results: Results) -> float:
    times = results["commands"]
    return float(times[STUDY.format(FEW)]["least"] - times[RUN]["least"])


def _side_by_side(labels: list[str], steps: int) -> Callable[[Results], float]:
    return lambda results: max(
        float(results["side_by_side_laws"][f"{label}; {steps}"]["ratio"][1]) for label in labels
    )


def _beside_c(results: Results) -> float:
    return max(float(median) for _, median, _ in results["side_by_side"]["ratios"].values())


GOALS = (
    Goal("a run of any law, 27 nodes, beside C -O3", 0.8, _worst(USUAL, "podusv / C -O3")),
    Goal("the same beside C -Ofast", 1.0, _worst(USUAL, "podusv / C -Ofast")),
    Goal("27 nodes that lie on no grid, beside C -O3", 1.05, _worst(LISTED, "podusv / C -O3")),
    Goal("a step of 100 000 beside one of 10 000", 1.05, _steps),
    Goal("a node of 343 beside one of 125", 1.1, _nodes),
    Goal(
        "N runs at once beside N / cores single ones",
        1.05,
        lambda results: float(results["batch"]["31000"]["cost"][1]),
    ),
    Goal("a run side by side beside one by one, 31 000 steps", 0.3, _side_by_side(USUAL, 31_000)),
    Goal("the same, 1000 steps", 0.3, _side_by_side(USUAL, 1_000)),
    Goal("the same, 125 nodes, 31 000 steps", 0.25, _side_by_side(MANY_NODES, 31_000)),
    Goal("a run side by side beside C side by side", 1.3, _beside_c),
    Goal(
        "a run in current, wind, 100 waves, with sensors, beside calm water",
        2.5,
        lambda results: float(results["seas"]["sea, sensors"][1]),
    ),
    Goal("peak memory less the log, without figures", 150.0, _memory(RUN), "MB"),
    Goal("peak memory less the log, with figures", 150.0, _memory("podusv run"), "MB"),
    Goal("`podusv run` without figures", 0.7, _seconds(RUN), "s"),
    Goal("`podusv run` with figures", 1.8, _seconds("podusv run"), "s"),
    Goal("processors' time without figures, beside that of imports", 2, _beside_imports(RUN)),
    Goal("the same with figures", 4, _beside_imports("podusv run")),
    Goal("the same, a comparison of four laws with report", 8, _beside_imports("podusv compare")),
    Goal("the same, what a study of eight draws takes beyond a run", 1.7, _study_beyond_a_run),
    Goal(
        "the same in thousandths, one more run of 1000 steps in a study",
        0.8,
        lambda results: short_run(results["commands"]),
    ),
    Goal("peak memory less the log, of that comparison", 130.0, _memory("podusv compare"), "MB"),
    Goal(
        "the report of that comparison",
        3.0,
        lambda results: float(results["commands"]["podusv compare"]["report_megabytes"]),
        "MB",
    ),
    Goal("the very first run", 5.0, _seconds(f"{RUN}, for the first time"), "s"),
    Goal("`podusv --help`", 0.15, _seconds("podusv --help"), "s"),
)


def goal_rows(results: Results) -> Iterator[list[str]]:
    """Goal, limit, what was measured, and whether that is within the limit."""
    for goal in GOALS:
        value = goal.measured(results)
        limit, got = (f"{number:.3g} {goal.unit}".strip() for number in (goal.most, value))
        yield [goal.says, limit, got, "yes" if value <= goal.most else "**no**"]
