"""Claims about a study: parsed once, checked and evaluated by one walk, judged by intervals.

    share(adaptive_neural.iae < pid.iae) >= 0.95
    failures(adaptive_neural) <= 0.01 and not failures(pid) <= 0.01
    quantile(adaptive_neural.z_e_steady, 0.99) <= 0.6
    median(adaptive_neural.iae / full_backstepping.iae) <= 1.0
    failures(adaptive_neural) < failures(pid)

docs/claims.md describes the language.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from podusv_cli.core.about import MetricAbout, StudyClaim
from podusv_cli.core.kernel import Vector
from podusv_cli.expressions.margins import SIGNS
from podusv_cli.expressions.reading import function, known_name, number, refuse, syntax_tree
from podusv_cli.expressions.walk import Condition, Logic, all_of
from podusv_cli.studies.counting.expressions import OverLaws
from podusv_cli.studies.counting.runs import Mask, StudyRuns
from podusv_cli.studies.counting.samples import ALONE, FAILURES, SAMPLERS, SHARE, STATISTICS, Sample
from podusv_cli.studies.counting.statistics import holm
from podusv_cli.studies.counting.verdict import Statistic, StudyVerdict

EXAMPLE = "share(a.iae < b.iae) >= 0.95"
# of a number on the left of a comparison
MIRRORED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.Gt,
    ast.LtE: ast.GtE,
    ast.Gt: ast.Lt,
    ast.GtE: ast.LtE,
}
SHARES = {SHARE, FAILURES}
COMPARED = (
    "compare a statistic with a number, or two shares with each other: failures(a) < failures(b); "
    "for two laws, write share(a.iae < b.iae) or median(a.iae / b.iae) on the left"
)
Samples = list[Sample]  # of a statistic, one for each cell


class Link(NamedTuple):
    """A statistic, by its text, compared with a number."""

    text: str
    call: ast.Call
    sign: ast.cmpop
    bound: float


@dataclass(frozen=True)
class Parsed:
    """The syntax tree of a claim, its comparisons of statistics, and the laws that it is about."""

    tree: ast.expr
    links: tuple[Link, ...] = ()
    laws: tuple[str, ...] = ()

    @cached_property
    def statistics(self) -> int:
        """How many different statistics the claim has."""
        # As long as it is parsed, the claim has none.
        return len({link.text for link in self.links}) or 1


@dataclass(frozen=True)
class ParsedStudyClaim:
    """A claim of a study with its name."""

    name: str
    claim: StudyClaim
    parsed: Parsed


@dataclass(frozen=True)
class _ExampleStudy:
    """A study with a single draw in which every law has every metric; to check a claim."""

    laws: Sequence[str]
    metrics: Sequence[str]
    cells = ("",)
    wanted = 1

    def metric(self, law: str, name: str) -> Vector:
        return np.ones((1, 1))

    def done(self, law: str) -> Mask:
        return np.ones((1, 1), bool)

    finished = success = done

    def broken(self, law: str) -> Mask:
        return np.zeros((1, 1), bool)


def parse(text: str, laws: Sequence[str], metrics: Mapping[str, MetricAbout]) -> Parsed:
    """A claim (`text`) about these laws and metrics, checked and taken apart.

    Raises ExpressionError.
    """
    tree = syntax_tree(text, EXAMPLE)
    # A trial on one draw of ones finds every mistake that the judge would find, by the same walk.
    tried = _Evaluation(_ExampleStudy(laws, list(metrics)), Parsed(tree), metrics)
    tried.condition(tree)
    return Parsed(tree, tuple(tried.links), tuple(dict.fromkeys(tried.laws)))


def judge(
    claims: Sequence[ParsedStudyClaim],
    runs: StudyRuns,
    level: float,
    metrics: Mapping[str, MetricAbout],
) -> list[StudyVerdict]:
    """A verdict on every claim; the probability that any is wrong is at most 1 - level.

    `level` is the confidence of all verdicts together (0.95): Holm's procedure gives each its own.
    """
    tried = [_Evaluation(runs, c.parsed, metrics, c.claim.tolerance) for c in claims]
    levels = holm(lambda i, level: tried[i].at(level).answer is not None, len(tried), level)
    return [_verdict(c, claim.at(at)) for c, claim, at in zip(claims, tried, levels, strict=True)]


@dataclass
class _Evaluation(Logic):
    """The evaluation of one claim, in all cells, by intervals of which several share the level.

    `samples` are those of each statistic, by its text: computed once for all levels. `whole` is
    False to leave out all draws in which a run crashed, hung or was invalid.
    """

    runs: StudyRuns
    parsed: Parsed
    metrics: Mapping[str, MetricAbout]
    tolerance: float = 0.0
    level: float = 0.5
    whole: bool = True
    samples: dict[str, Samples] = field(default_factory=dict)
    laws: list[str] = field(default_factory=list)
    links: list[Link] = field(default_factory=list)

    def at(self, level: float) -> Self:
        """The same at another level."""
        return replace(self, level=level)

    @property
    def inside(self) -> float:
        """The confidence of each interval, by Bonferroni.

        The statistics of the claim share 1 - level equally.
        """
        return 1.0 - (1.0 - self.level) / self.parsed.statistics

    @property
    def answers(self) -> list[bool | None]:
        """Whether the claim holds in each cell."""
        return self.condition(self.parsed.tree).answers()

    @property
    def answer(self) -> bool | None:
        """Whether the claim holds: True if in all cells, False if in none, else None."""
        answers = set(self.answers)
        return answers.pop() if len(answers) == 1 else None

    def property(self, node: ast.expr) -> Condition:
        """There are none."""
        names = ", ".join(STATISTICS)
        refuse(node, f"not a condition; compare one of {names} with a number")

    def comparison(self, node: ast.Compare) -> Condition:
        """Statistics compared with numbers, in each cell."""
        links = list(_compared_statistics(node))
        self.links += links
        return all_of([Condition.of(self._hold_link(link)) for link in links])

    def _hold_link(self, link: Link) -> Iterator[bool | None]:
        """Whether a comparison holds, cell by cell; None where the draws do not decide."""
        if link.text not in self.samples:
            self.samples[link.text] = self._sample_statistic(link.call)
        for sample in self.samples[link.text]:
            yield sample.holds(link.sign, link.bound, self.tolerance, self.inside)

    def _sample_statistic(self, call: ast.Call) -> Samples:
        """The samples of the statistic that `call` names, one for each cell.

        Only draws count that all laws of the statistic have been through. The names of these laws
        are noted. Raises ExpressionError where `call` names no law.
        """
        walk = OverLaws(self.metrics, self.tolerance, runs=self.runs)
        sample = SAMPLERS[function(call)](call, walk)
        if not walk.names:
            refuse(call, "names no law; write law.metric, as in a.iae")
        self.laws += walk.names
        used = np.logical_and.reduce([self._used_draws(law) for law in set(walk.names)])
        return [sample(label, i, used[i]) for i, label in enumerate(self.runs.cells)]

    def _used_draws(self, law: str) -> Mask:
        """The draws of a law that count, True in a mask (cells, draws).

        All that are made count, or, unless `whole`, only those whose run is not broken.
        """
        done = self.runs.done(law)
        return done if self.whole else done & ~self.runs.broken(law)

    def draws_needed(self) -> list[int | None]:
        """The draws that would decide the claim, for every comparison and cell that is still open.

        None where no number of draws would. Call it after `answers`, which makes the samples.
        """
        return [
            sample.draws_needed(link.sign, link.bound, self.tolerance, self.inside)
            for link in self.parsed.links
            for sample in self.samples[link.text]
            if sample.holds(link.sign, link.bound, self.tolerance, self.inside) is None
        ]


def _compared_statistics(node: ast.Compare) -> Iterator[Link]:
    """Every comparison of a chain a < b < c as a statistic on the left and a number on the right.

    Two shares compared with each other become one statistic, `alone`: the share of the first among
    draws where only one of both holds, compared with one half. Raises ExpressionError.
    """
    sides = [node.left, *node.comparators]
    for left, sign, right in zip(sides, node.ops, sides[1:], strict=False):
        calls = [side for side in (left, right) if not _is_number(side)]
        if {_name(side) for side in calls} <= SHARES and len(calls) == 2:
            text = f"{ast.unparse(left)} alone, not {ast.unparse(right)}"
            toward, bound, call = sign, 0.5, ast.Call(ast.Name(ALONE), calls, [])
        elif len(calls) == 1:
            first = calls[0] is left
            call, bound = _statistic(calls[0]), number(right if first else left)
            text = ast.unparse(call)
            # An unknown sign has no mirror image; it is refused below.
            toward = sign if first else MIRRORED.get(type(sign), type(sign))()
        else:
            refuse(node, COMPARED)
        if type(sign) not in SIGNS:
            refuse(node, "compare with <, <=, >, >=")
        _check_bound(call, bound)
        yield Link(text, ast.copy_location(call, node), toward, bound)


def _name(node: ast.expr) -> str:
    """Of a function that is called; "" where none is."""
    return function(node) if isinstance(node, ast.Call) else ""


def _is_number(node: ast.expr) -> bool:
    """Whether a side of a comparison is made of numbers alone, without a name in it."""
    return not any(isinstance(part, (ast.Name, ast.Attribute)) for part in ast.walk(node))


def _statistic(node: ast.expr) -> ast.Call:
    """The call of a statistic over all draws. Raises ExpressionError for anything else."""
    if not isinstance(node, ast.Call):
        refuse(node, f"no statistic of all draws; write one of {', '.join(STATISTICS)}")
    known_name(function(node), STATISTICS, "statistic")
    return node


def _check_bound(call: ast.Call, bound: float) -> None:
    """Refuse a bound that no share can have, or that only a percentage could."""
    if function(call) in SHARES and not 0.0 <= bound <= 1.0:
        refuse(call, f"is a share between 0 and 1, and cannot be compared with {bound:g}")


def _verdict(parsed: ParsedStudyClaim, tried: _Evaluation) -> StudyVerdict:
    """A claim's verdict with its numbers, and what it would be without the broken runs.

    `tried` is the evaluation at the level that Holm's procedure gave this claim.
    """
    runs, answers = tried.runs, tried.answers
    broken = sum(int(np.sum(runs.broken(law) & runs.done(law))) for law in parsed.parsed.laws)
    # The samples that are there count the broken runs' draws.
    others = replace(tried, whole=False, samples={}) if broken else tried
    return StudyVerdict(
        name=parsed.name,
        claim=parsed.claim,
        answer=tried.answer,
        level=tried.level,
        wanted=runs.wanted,
        parts=[
            Statistic.of(text, sample, tried.inside)
            for text, samples in tried.samples.items()
            for sample in samples
        ],
        by_cell=dict(zip(runs.cells, answers, strict=True)),
        needed=tried.draws_needed(),
        broken=broken,
        without_broken=others.answer,
    )
