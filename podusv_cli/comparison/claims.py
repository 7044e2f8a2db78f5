"""Claims about runs: judged, and written as JSON and Markdown."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

from podusv_cli.comparison.curves import ClaimedRun
from podusv_cli.comparison.expressions import Evaluation, with_labels
from podusv_cli.core.about import Claim, MetricAbout
from podusv_cli.core.escaping import markdown
from podusv_cli.expressions.verdict import Verdict, as_markdown
from podusv_cli.metrics.table import CLOCKED, METRICS


@dataclass(frozen=True)
class ParsedClaim:
    """A claim with the syntax trees of its expressions; `given` is None where it has no premise."""

    name: str
    claim: Claim
    expect: ast.expr
    given: ast.expr | None = None

    def with_labels(self, labels: Mapping[str, str]) -> Self:
        """The claim with labels in place of its own names for runs; `labels` are by these names."""
        if all(name == label for name, label in labels.items()):
            return self
        expect = with_labels(self.expect, labels)
        given = self.given and with_labels(self.given, labels)
        texts = {"expect": ast.unparse(expect), "given": ast.unparse(given) if given else ""}
        return replace(self, claim=self.claim.model_copy(update=texts), expect=expect, given=given)


@dataclass(frozen=True)
class RunsVerdict(Verdict):
    """The verdict on a claim about runs.

    `numbers` are those that were compared, by their text, NaN where missing; `reason` says why the
    answer is "cannot tell", else it is empty.
    """

    numbers: dict[str, float]
    reason: str = ""

    @property
    def timed(self) -> bool:
        """Whether the claim is about measured times, which are different in every comparison."""
        return is_timed(self.claim)

    def evidence(self) -> str:
        """The claim's numbers and the reason of the verdict, in one line."""
        numbers = (
            # An infinite number is a time that never comes; NaN is a number that is unknown.
            f"{text} = {number:.4g}" if math.isfinite(number) else f"{text}: never"
            for text, number in self.numbers.items()
            if not math.isnan(number)
        )
        return "; ".join(part for part in (", ".join(numbers), self.reason) if part)

    def as_json(self) -> dict[str, object]:
        """The verdict as plain data, undefined numbers as None."""
        numbers = {text: v if math.isfinite(v) else None for text, v in self.numbers.items()}
        return {
            "claim": self.name,
            **self.claim.model_dump(),
            "verdict": self.verdict,
            "numbers": numbers,
            "reason": self.reason,
        }


def is_timed(claim: Claim) -> bool:
    """Whether a claim is about measured times, which are different in every comparison."""
    return any(f".{name}" in claim.expect for name in CLOCKED)


def peaks(claims: Sequence[ParsedClaim]) -> dict[str, float]:
    """The sizes that claims say signals become, by signal: `max(abs(run.signal)) == number`."""
    sizes = {}
    for node in (node for parsed in claims for node in ast.walk(parsed.expect)):
        match node:
            case ast.Compare(
                left=ast.Call(
                    func=ast.Name(id="max"),
                    args=[ast.Call(func=ast.Name(id="abs"), args=[ast.Attribute(attr=name)]), *_],
                ),
                ops=[ast.Eq()],
                comparators=[ast.Constant(value=int() | float() as number)],
            ):
                sizes[name] = float(number)
    return sizes


def judge(
    claims: Sequence[ParsedClaim],
    runs: Mapping[str, ClaimedRun],
    metrics: Mapping[str, MetricAbout] = METRICS,
) -> list[RunsVerdict]:
    """A verdict on every claim, in the order of `claims`.

    `runs` are by label; `metrics` are those that claims may name.
    """
    return [_verdict(parsed, runs, metrics) for parsed in claims]


def _verdict(
    parsed: ParsedClaim, runs: Mapping[str, ClaimedRun], metrics: Mapping[str, MetricAbout]
) -> RunsVerdict:
    """A claim's verdict: its premise first; an untestable one gets no answer, only numbers.

    `runs` are by label.
    """
    evaluation = Evaluation(runs, parsed.claim.tolerance, metrics)
    if parsed.given and (given := evaluation.holds(parsed.given)) is not True:
        doubts = "; ".join(dict.fromkeys(evaluation.doubts))
        unknown = f"whether the premise holds is unknown: {doubts}"
        reason = unknown if given is None else f"the premise does not hold: {parsed.claim.given}"
        return RunsVerdict(parsed.name, parsed.claim, None, evaluation.numbers, reason)
    # Anew: numbers and doubts of the premise are no evidence of what follows from it.
    evaluation = Evaluation(runs, parsed.claim.tolerance, metrics)
    answer = evaluation.holds(parsed.expect)
    reason = "; ".join(dict.fromkeys(evaluation.doubts)) if answer is None else ""
    verdict = RunsVerdict(parsed.name, parsed.claim, answer, evaluation.numbers, reason)
    if not parsed.claim.untestable:
        return verdict
    shown = f"what these runs show: {verdict.in_words}"
    reasons = (f"not testable: {parsed.claim.untestable}", shown, reason)
    return replace(verdict, answer=None, reason="; ".join(filter(None, reasons)))


def with_timed(verdicts: Sequence[RunsVerdict], timed: Sequence[RunsVerdict], place: str) -> str:
    """The verdicts in Markdown; those on `timed` claims are in another place."""
    elsewhere = f"judged by times, which never repeat; see {place}"
    return as_markdown(verdicts, [f"- {markdown(v.name)}: {elsewhere}" for v in timed])
