"""Figures of `podusv doubt`. Import this module where a figure is drawn: matplotlib is slow."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import groupby

import numpy as np
from matplotlib.figure import Figure

from podusv_cli.core import escaping
from podusv_cli.core.kernel import Vector
from podusv_cli.doubt.alone import TriedChoice, ends
from podusv_cli.doubt.answer import DoubtAnswer, DoubtReport, describe_turn
from podusv_cli.doubt.judged import Judged
from podusv_cli.doubt.together import count_turns
from podusv_cli.figures.looks import nth_style
from podusv_cli.figures.sketch import COLUMNS, Sketch
from podusv_cli.figures.style import legend, new_figure

TURNED, RANGE = nth_style(1)[0], "#BBBBBB"
MARKS = ((nth_style(0)[0], "."), (TURNED, "."), ("#444444", "x"))  # kept, turned, cannot tell
LANES = 8  # the most choices below a curve
ROW, LANE = 0.3, 0.3  # inches
SMALL = 6.5  # points; 8 pixels on a phone
WIDE = 34  # letters of an axis' name on a line


def sketches(report: DoubtReport) -> Iterator[Sketch]:
    """For every claim the specification curve, and a row for each choice that turns it."""
    for answer in report.answers:
        name = answer.verdict.name
        acting = [
            a for a in report.tried.alone if a.choice.range and a.acts(name, report.tried.base)
        ]
        turning = {turn.choice.name for turn in (*answer.turns, *answer.neighbours)}
        rows = [alone for alone in acting if alone.choice.name in turning]
        if acting and math.isfinite(answer.spread[1]):
            yield Sketch(
                f"specification-{name}",
                f"{name}: its number in all draws, sorted, and what was drawn: each column is one "
                "draw, a mark's height in its lane is where the value is in its range",
                partial(specification, report, answer, acting),
            )
        if rows:
            yield Sketch(
                f"ranges-{name}",
                f"{name}: the ranges of the values that turn it, one at a time, each with the "
                "scenario's own below its name; orange from the first to the last of neighbouring "
                "values that were tried and turn it "
                f"({len(acting) - len(rows)} more numbers change its number, and never the "
                "verdict)",
                partial(ranges, report, answer, rows),
            )


def specification(
    report: DoubtReport, answer: DoubtAnswer, acting: Sequence[TriedChoice]
) -> Figure:
    """A claim's number over the draws, sorted, with what was drawn below.

    `acting` are the choices that change the number; LANES of them are shown.
    """
    tried, name = report.tried, answer.verdict.name
    number = answer.number
    numbers = np.array([number.of(world.numbers.get(name, {})) for world in tried.worlds])
    turned, known = count_turns(name, tried.worlds, tried.base)
    order = [i for i in np.argsort(numbers) if np.isfinite(numbers[i])]
    lanes = _lanes(report, answer, {a.choice.name for a in acting}, numbers[order], order)
    # The upper panel is 2.2 inches high.
    figure = new_figure(COLUMNS, 2.2 + LANE * len(lanes))
    top, below = figure.subplots(
        2, 1, sharex=True, gridspec_kw={"height_ratios": [2.2, LANE * len(lanes)]}
    )
    told = "can tell" if answer.verdict.answer is None else "kept"
    kinds = {told: known & ~turned, "turned": turned, "cannot tell": ~known}
    for (label, mask), (colour, mark) in zip(kinds.items(), MARKS, strict=True):
        at = [x for x, i in enumerate(order) if mask[i]]
        if not at:
            continue
        top.plot(at, numbers[[order[x] for x in at]], mark, color=colour, ms=3.0, label=label)
        for lane, column in enumerate(lanes):
            # A lane is 1 high: shares 0 to 1 of its range fill 0.8 of it, so that lanes stay apart.
            heights = lane + 0.1 + 0.8 * tried.draws.shares[[order[x] for x in at], column]
            below.plot(at, heights, mark, color=colour, ms=1.6)
    own = number.of(answer.numbers)
    if math.isfinite(own):
        top.axhline(own, color="black", lw=0.8, ls=":", label="the scenario's own")
    for place_, edge in enumerate(number.edges):
        top.axhline(edge, color="black", lw=0.8, label=None if place_ else "limit")
    top.set_ylabel(textwrap.fill(escaping.figure(number.text), WIDE), fontsize=6)
    names = [escaping.figure(tried.draws.choices[column].name) for column in lanes]
    below.set_yticks([lane + 0.5 for lane in range(len(lanes))], names, fontsize=5.5)
    below.set(xlabel="draws, sorted by the number", ylim=(0.0, len(lanes)))
    legend(figure)
    return figure


def _lanes(
    report: DoubtReport,
    answer: DoubtAnswer,
    acting: set[str],
    numbers: Vector,
    order: Sequence[int],
) -> list[int]:
    """The columns of the draws to show.

    First those that explain the turns, then those that the number follows. `numbers` and `order`
    are (draws,): the claim's number, and the draws from its least to its largest. `acting` are
    names of choices.
    """
    draws = report.tried.draws
    # By rank a number that lies far out weighs no more than the others
    ranks = np.argsort(np.argsort(numbers))

    def follows(column: int) -> float:
        """How closely the order of draws goes with a choice; the most negative is the closest."""
        with np.errstate(all="ignore"):
            correlation = np.corrcoef(ranks, draws.shares[order, column])[0, 1]
        return -abs(float(np.nan_to_num(correlation)))

    first = [draws.choices.index(turn.choice) for turn in answer.explained]
    others = [i for i, choice in enumerate(draws.choices) if choice.name in acting]
    return list(dict.fromkeys([*first, *sorted(others, key=follows)]))[:LANES]


def ranges(report: DoubtReport, answer: DoubtAnswer, rows: Sequence[TriedChoice]) -> Figure:
    """The range of each choice, from its own value to both ends, and where the verdict turns.

    Every range is drawn from -1 to 1 with the own value at 0, whatever its numbers.
    """
    turns = {
        (t.choice.name, t.value > t.choice.own): t for t in (*answer.turns, *answer.neighbours)
    }
    figure = new_figure(COLUMNS, 0.7 + ROW * len(rows))
    axes = figure.add_subplot()
    for row, shown in enumerate(rows):
        axes.plot([-1.0, 1.0], [row, row], color=RANGE, lw=3.0, solid_capstyle="butt")
        for end in ends(shown.choice):
            side = math.copysign(1.0, end - shown.choice.own)
            turn = turns.get((shown.choice.name, end > shown.choice.own))
            if turn:
                for span in turned_spans(shown, end, answer.verdict.name, report.tried.base):
                    axes.plot(
                        span,
                        [row, row],
                        "|-",
                        color=TURNED,
                        lw=3.0,
                        solid_capstyle="butt",
                        ms=4.0,
                        mew=1.2,
                    )
                axes.annotate(
                    escaping.figure(describe_turn(turn)),
                    (side, row),
                    (0, 3),
                    fontsize=SMALL,
                    textcoords="offset points",
                    va="bottom",
                    ha="right" if side > 0 else "left",
                )
    axes.axvline(0.0, color="black", lw=0.8)
    words = [(c.name, f"{c.own:.3g} {c.unit}".rstrip()) for c in (row.choice for row in rows)]
    names = ["\n".join(map(escaping.figure, lines)) for lines in words]
    axes.set_yticks(range(len(rows)), names, fontsize=SMALL)
    axes.set(xlim=(-1.1, 1.1), ylim=(len(rows) - 0.5, -0.7))
    axes.grid(visible=False)
    axes.set_xticks([-1.0, 0.0, 1.0], ["lower end", "own value", "upper end"])
    return figure


def turned_spans(
    shown: TriedChoice, end: float, claim: str, base: Judged
) -> Iterator[tuple[float, float]]:
    """First and last of neighbouring tried values that turn a claim, as parts of the way to `end`.

    `end` is one of the range's ends, `base` the claims on the scenario as it is. The parts have the
    sign of the side; a value alone is both.
    """
    own = shown.choice.own
    side = [t for t in shown.trials if (t.value > own) == (end > own)]
    places = sorted((abs(t.value - own), t.judged.contradicts(claim, base)) for t in side)
    for turned, run in groupby(places, key=lambda place: place[1]):
        if turned:
            at = [distance / abs(end - own) for distance, _ in run]
            yield math.copysign(at[0], end - own), math.copysign(at[-1], end - own)
