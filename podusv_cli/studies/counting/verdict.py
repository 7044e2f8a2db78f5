"""Verdicts on claims about a study: the evidence in words, as plain data and as a table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

from podusv_cli.expressions.verdict import ANSWERS, Verdict
from podusv_cli.studies.counting.samples import Sample
from podusv_cli.studies.counting.statistics import Interval


@dataclass(frozen=True)
class Statistic:
    """A statistic of a claim in one cell, with its interval at this level.

    `unknown` draws lack a number. `both_failed` and `close` are draws without a winner. In `differ`
    draws exactly one of two conditions holds.
    """

    statistic: str
    cell: str
    n: int
    estimate: float
    low: float
    high: float
    level: float
    unknown: int
    both_failed: int
    close: int
    differ: int

    @classmethod
    def of(cls, statistic: str, sample: Sample, level: float) -> Self:
        """The statistic of a sample, with its interval at the confidence `level`.

        `statistic` is its text in the claim.
        """
        estimate, low, high = map(float, sample.interval(level))
        return cls(
            statistic,
            sample.cell,
            sample.n,
            estimate,
            low,
            high,
            level,
            sample.unknown,
            sample.both_failed,
            sample.close,
            sample.differ,
        )

    @property
    def title(self) -> str:
        """Such as `failures(pid) at scale=2`; without a grid the statistic alone."""
        return f"{self.statistic} at {self.cell}" if self.cell else self.statistic

    def in_words(self) -> str:
        """Such as `failures(pid) = 0.01 [0.002, 0.03] in 400 draws`."""
        counts = [f"{self.n} draws" if self.n else "no draw"]
        counts += [f"both failed in {self.both_failed}"] if self.both_failed else []
        counts += [f"{self.close} within the margin"] if self.close else []
        counts += [f"one of both alone in {self.differ}"] if self.differ else []
        counts += [f"a number is missing in {self.unknown}"] if self.unknown else []
        interval = Interval(self.estimate, self.low, self.high)
        return f"{self.title} = {interval:.4g} ({', '.join(counts)})"

    def as_json(self) -> dict[str, object]:
        """Plain data; what is infinite or undefined is None.

        A study without a grid has no `cell`.
        """
        return {k: _plain(v) for k, v in vars(self).items() if v != "" or k != "cell"}


@dataclass(frozen=True, kw_only=True)
class StudyVerdict(Verdict):
    """The verdict on a claim about a study; `level` is that of the claim after Holm's correction.

    `needed` are the draws of a cell that would decide what is open, None where no number would.
    `broken` runs crashed, hung or were invalid; `without_broken` is the answer without their draws.
    """

    level: float
    wanted: int
    parts: Sequence[Statistic]
    by_cell: dict[str, bool | None]
    needed: Sequence[int | None]
    broken: int
    without_broken: bool | None

    @property
    def draws(self) -> int:
        """Draws of the cell that has the fewest."""
        return min((part.n for part in self.parts), default=0)

    @property
    def preliminary(self) -> bool:
        """Whether a cell has fewer draws than were asked for."""
        return self.draws < self.wanted

    @property
    def more(self) -> int | None:
        """Draws of a cell that would decide the claim; None where no number would."""
        counts = [count for count in self.needed if count is not None]
        known = counts and len(counts) == len(self.needed) and not self._disagrees
        return max(counts) if known else None

    @property
    def _disagrees(self) -> bool:
        """Whether it holds in a cell and fails in another, which more draws do not change."""
        return {True, False} <= {*self.by_cell.values()}

    def evidence(self) -> str:
        """The numbers and the reasons, in one line."""
        return "; ".join([*(part.in_words() for part in self.parts), *self.reasons()])

    def reasons(self) -> Iterator[str]:
        """Sentences to read beside the numbers: level, missing draws, open answer, broken runs."""
        yield f"intervals at {100 * self._inside:.4g} %"
        if self.preliminary:
            yield f"preliminary: {self.draws} of {self.wanted} draws"
        if self.answer is None:
            yield self._why_open()
        if self.broken:
            yield f"{self.broken} runs crashed, hung or were invalid, and count as failed"
        if self.without_broken != self.answer:
            other = self.word_for(self.without_broken)
            yield f"these runs decide the verdict: without their draws it would be `{other}`"

    @property
    def _inside(self) -> float:
        return self.parts[0].level if self.parts else self.level

    def _why_open(self) -> str:
        """Why the answer is "cannot tell", and what would change that.

        The reasons come in the order in which they explain: without runs nothing else matters.
        """
        if not self.draws:
            of = self._name_parts([part for part in self.parts if not part.n])
            return f"no draw has runs of all laws in {of or 'the claim'}"
        if self._disagrees:
            cells = (f"{self.word_for(answer)} at {cell}" for cell, answer in self.by_cell.items())
            return f"the cells disagree: {', '.join(cells)}"
        if missing := [part for part in self.parts if part.unknown == part.n]:
            of = self._name_parts(missing)
            return f"no run has a number {f'for {of}' if of else 'that the claim is about'}"
        if any(part.unknown for part in self.parts):
            return "missing numbers leave the answer open"
        # Two shares have no estimate where no draw tells them apart.
        if alike := [part for part in self.parts if math.isnan(part.estimate)]:
            of = self._name_parts(alike)
            return (
                f"{f'for {of}, ' if of else ''}in no draw does exactly one of the two conditions "
                "hold, so the shares do not differ"
            )
        if self.more is None:
            return (
                "the shares found are those asked for, or so near them that no practicable number "
                "of draws decides"
            )
        # The estimate can be what is there already, with which the claim is open.
        count, each = max(self.more, self.draws + 1), " in each cell" * (len(self.by_cell) > 1)
        return f"about {count} draws{each} would decide, if shares stay as they are"

    def _name_parts(self, parts: Sequence[Statistic]) -> str:
        """These parts of the claim by their titles; "" where they are all that it has."""
        return ", ".join(part.title for part in parts) if len(parts) < len(self.parts) else ""

    def as_json(self) -> dict[str, object]:
        """The verdict as plain data."""
        claim = self.claim
        return {
            "claim": self.name,
            "says": claim.says,
            "source": claim.source,
            "expect": claim.expect,
            "tolerance": claim.tolerance,
            "remark": claim.remark,
            "verdict": self.verdict,
            "preliminary": self.preliminary,
            "draws": self.draws,
            "wanted": self.wanted,
            "level": self.level,
            "statistics": [part.as_json() for part in self.parts],
            "needed": self.more if self.answer is None else None,
            "broken": self.broken,
            "without_broken": ANSWERS[self.without_broken],
            "reasons": list(self.reasons()),
        }


def _plain(value: object) -> object:
    """A number that JSON can hold; None for NaN and infinity."""
    return value if not isinstance(value, float) or math.isfinite(value) else None
