"""From measurements to Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from benchmarks.goals import goal_rows

Quartiles = Sequence[float]
Results = Mapping[str, Any]

HEADING = """\
# How fast podusv is

Made by `make bench`. One run is the closed loop of `configs/mu_2017/corrected.yaml`: 31 000 steps
of RK4, every step logged. Times are medians with quartiles in brackets; what is compared is timed
in turns, and ratios are medians of the ratios of one turn each. Below 1 podusv is the faster one.
The engine, the C programs and the growth of a step are timed in processor time, which leaves out
what else the machine does; all other times are those of the clock on the wall.
"""

BESIDE_C = """\
`benchmarks/closed_loop.c` is the same loop by hand: the scenario's numbers are constants in it, its
log is there before the clock starts. podusv is timed from values to `Recording`; "with metrics"
adds the 14 metrics of `podusv run`, where the C program integrates the distance only. All numbers
of the last state and the integral of the distance agree to the relative difference in the last
column.
"""


LAWS_SIDE_BY_SIDE = """\
Processor time of a run that marches beside seven others, and of one of a batch that marches one by
one, both with all metrics and all that Python does for a run.
"""
MILLION = """\
Hours that a million runs of 31 000 steps with other starts take on all cores, from 512 runs side by
side and 64 one by one; compiling is left out.
"""
SIDE_BY_SIDE = """\
`benchmarks/side_by_side.c` marches eight runs of adaptive_neural with 27 nodes as structure of
arrays, with -O3 and without -ffast-math, and integrates the distance only. All integrals agree to
1e-9 relative. podusv is timed with all that Python does for a run, in processor time.
"""
BY_STEPS = """\
Control steps of ten integration steps each, episodes of 200 of them and their begin: a session of
Python, environments of Gymnasium with a reward, and `VectorEnv`, whose runs march side by side.
"""
BATCH = """\
`simulate_many` beside `simulate` for one loop after another: adaptive_neural with 27 nodes, another
disturbance in every run, all metrics, no log. The cost is the time of N runs over N / cores times
that of a single one; 1 is all that the cores can do. In processor time it shows what the batch adds
to a run, whether or not the cores were free.
"""


def spread(values: Quartiles, scale: float = 1.0) -> str:
    """Median and quartiles; a number alone where it was measured once."""
    low, middle, high = (_rounded(scale * value) for value in values)
    return f"{middle} [{low}, {high}]" if values[0] < values[2] else middle


def _rounded(value: float, digits: int = 3) -> str:
    decimals = max(0, digits - 1 - math.floor(math.log10(value)))
    return f"{value:.{decimals}f}"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def markdown(results: Results) -> str:
    """The whole report."""
    sections = [
        HEADING,
        table(["machine", ""], results["machine"].items()),
        "## Goals\n",
        table(["", "at most", "measured", "reached"], goal_rows(results)),
        "## The engine beside C\n",
        BESIDE_C,
        _ratios(results["beside_c"]),
        _seconds(results["beside_c"]),
        "## How the cost of a step grows\n",
        *_growth(results["growth"]),
        "## Many runs at once\n",
        BATCH,
        _batch(results["batch"]),
        "## Runs side by side\n",
        LAWS_SIDE_BY_SIDE,
        _laws_side_by_side(results["side_by_side_laws"]),
        SIDE_BY_SIDE,
        _side_by_side(results["side_by_side"]),
        MILLION,
        _million(results["million"]),
        "## One evaluation of a law\n",
        _laws(results["law"]),
        "## One step behind each actuator\n",
        table(
            ["actuator", "us"], ([name, spread(q, 1e6)] for name, q in results["actuators"].items())
        ),
        "## A run in a sea, beside one in calm water\n",
        table(
            ["run", "of the time in calm water"],
            ([name, spread(q)] for name, q in results["seas"].items() if name != "calm"),
        ),
        "## Runs that wait for demands\n",
        BY_STEPS,
        _by_steps(results["by_steps"]),
        "## Without compiled code\n",
        _plain(results["plain_engine"]),
        _alternatives(results["alternatives"]),
        "## Whole commands\n",
        *_commands(results["commands"]),
    ]
    return "\n".join(sections)


def _laws(costs: Results) -> str:
    rows = (
        [law, spread(found["seconds"], 1e9), spread(found["ratio"])] for law, found in costs.items()
    )
    return table(["law", "ns", "relative to adaptive_neural"], rows)


def _ratios(beside_c: Results) -> str:
    names = list(next(iter(beside_c.values()))["ratios"])
    rows = (
        [case, *(spread(measured["ratios"][name]) for name in names), f"{measured['apart']:.1g}"]
        for case, measured in beside_c.items()
    )
    return table(["law, network", *names, "apart"], rows)


def _seconds(beside_c: Results) -> str:
    names = list(next(iter(beside_c.values()))["seconds"])
    rows = (
        [case, *(spread(measured["seconds"][name], 1e3) for name in names)]
        for case, measured in beside_c.items()
    )
    return table(["ms a run", *(f"C -{n}" if n.startswith("O") else n for n in names)], rows)


def _batch(batch: Results) -> str:
    rows = (
        [
            steps,
            f"{measured['runs']} on {measured['cores']}",
            *(spread(measured["seconds"][name], 1e3) for name in ("alone", "batch")),
            *(spread(measured[name]) for name in ("cost", "processor cost")),
        ]
        for steps, measured in batch.items()
    )
    header = ["steps", "runs on cores", "ms a run alone", "ms a run in the batch"]
    return table([*header, "cost", "cost in processor time"], rows)


def _laws_side_by_side(laws: Results) -> str:
    rows = (
        [
            *label.split("; "),
            *(spread(measured[name], 1e3) for name in ("side by side", "one by one")),
            spread(measured["ratio"]),
        ]
        for label, measured in laws.items()
    )
    return table(["law, network", "steps", "ms side by side", "ms one by one", "ratio"], rows)


def _million(laws: Results) -> str:
    names = ("side by side", "one by one")
    rows = ([law, *(spread(measured[name]) for name in names)] for law, measured in laws.items())
    return table(["law, network", *(f"hours {name}" for name in names)], rows)


def _side_by_side(measured: Results) -> str:
    ours = [["podusv, all metrics", spread(measured["seconds"]["podusv"], 1e3), ""]]
    others = [
        [name, spread(measured["seconds"][name], 1e3), spread(relative)]
        for name, relative in measured["ratios"].items()
    ]
    return table(["eight runs side by side", "ms a run", "podusv / C"], [*ours, *others])


def _by_steps(measured: Results) -> str:
    rows = (
        [
            name,
            spread(one["seconds"], 1e6),
            _rounded(1.0 / one["seconds"][1]),
            spread(one["faster"]),
        ]
        for name, one in measured.items()
    )
    return table(["", "us a step", "steps a second", "times as many as one by one"], rows)


def _growth(growth: Results) -> list[str]:
    headers = {
        "steps": "steps, every 10th logged",
        "nodes": "nodes, every 10th step logged",
        "log_every": "27 nodes, every n-th step logged",
    }
    return [
        table(
            [headers[name], "ns a step"],
            ([str(number), spread(values, 1e9)] for number, values in series.items()),
        )
        for name, series in growth.items()
    ]


def _plain(plain_engine: Results) -> str:
    rows = ([law, spread(values, 1e6)] for law, values in plain_engine.items())
    return table(["podusv with `simulation.compiled: false`", "us a step"], rows)


def _alternatives(measured: Results) -> str:
    labels = {
        "podusv": "podusv",
        "numpy": "classes, numpy, a loop with RK4",
        "solve_ivp": f"the same classes, scipy's solve_ivp, RK45 with rtol {measured['rtol']:.1g}",
    }
    text = (
        f"The first {measured['span_s']:g} s with adaptive_neural and 27 nodes. RK4 with the usual "
        f"step is off by {measured['rk4_error']:.1g} (m, rad, m/s, rad/s) at the end; RK45 has the "
        "largest tolerance with which it is no further off.\n"
    )
    rows = ([labels[n], spread(q, 1e3)] for n, q in measured["per_simulated_s"].items())
    return text + "\n" + table(["", "ms a simulated second"], rows)


def _commands(commands: Results) -> list[str]:
    rows = (
        [name, *(spread(found[key]) for key in ("seconds", "busy")), f"{found['megabytes'][1]:.0f}"]
        for name, found in commands.items()
    )
    runs = {name: measured["parts"] for name, measured in commands.items() if measured["parts"]}
    parts = list(next(iter(runs.values())))
    where = ([name, *(f"{spent[part]:.3f}" for part in parts)] for name, spent in runs.items())
    return [
        table(["command", "s", "s of processors", "peak memory, MB"], rows),
        "Where the time of a run goes, in s; the rest is Python and its libraries starting.\n",
        table(["", *parts], where),
    ]
