"""Verdicts on claims: the answer in words, and a table of all of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

from podusv_cli.core.escaping import markdown, markdown_cell, markdown_code

Answer = Literal["reproduced", "not reproduced", "cannot tell"]
ANSWERS: dict[bool | None, Answer] = {
    True: "reproduced", False: "not reproduced", None: "cannot tell",
}  # fmt: skip


@dataclass(frozen=True)
class Verdict(ABC):
    """The verdict on a claim as it stands in a scenario; the answer is None where none is known."""

    name: str
    claim: Any
    answer: bool | None

    @property
    def verdict(self) -> Answer:
        """The answer in words."""
        return ANSWERS[self.answer]

    @property
    def preliminary(self) -> bool:
        """Whether it may change, as runs are still missing."""
        return False

    @abstractmethod
    def evidence(self) -> str:
        """The numbers and the reasons, in one line."""

    def row(self) -> str:
        """The verdict as a row of a table in Markdown."""
        claim, given = self.claim, getattr(self.claim, "given", "")
        premise = f", given {markdown_code(given)}" if given else ""
        return (
            f"| {markdown_cell(self.name)} | "
            f"{markdown_cell(claim.says)} ({markdown_cell(claim.source)}) | "
            f"**{self.verdict}**{', preliminary' if self.preliminary else ''} | "
            f"{markdown_code(claim.expect)}{premise}, tolerance {claim.tolerance:g} | "
            f"{markdown_cell(self.evidence())} |"
        )


AnyVerdict = TypeVar("AnyVerdict", bound=Verdict)


def as_markdown(verdicts: Sequence[Verdict], further: Sequence[str] = ()) -> str:
    """The verdicts as a table, followed by the claims' remarks and further ones."""
    head = ["| | claim | verdict | put as | numbers |", "|---|---|---|---|---|"]
    remarks = [
        f"- {markdown(v.name)}: {markdown(v.claim.remark)}" for v in verdicts if v.claim.remark
    ]
    below = [*remarks, *further]
    return "\n".join([*head, *(v.row() for v in verdicts), *(["", *below] if below else []), ""])


def by_answer(verdicts: Sequence[AnyVerdict]) -> dict[Answer, list[tuple[int, AnyVerdict]]]:
    """The verdicts with their numbers, by answer."""
    numbered = [*enumerate(verdicts, 1)]
    return {word: [one for one in numbered if one[1].verdict == word] for word in ANSWERS.values()}
