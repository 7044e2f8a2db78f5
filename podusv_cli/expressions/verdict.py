"""Verdicts on claims: the answer in words, and a table of all of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, Literal, NamedTuple, TypeVar

from podusv_cli.core.escaping import markdown, markdown_cell, markdown_code

Answer = Literal["reproduced", "not reproduced", "cannot tell"]
# In JSON, and in words on claims that were published
ANSWERS: dict[bool | None, Answer] = {
    True: "reproduced",
    False: "not reproduced",
    None: "cannot tell",
}
# In words on somebody's own claims
OF_OWN: dict[bool | None, str] = {True: "holds", False: "fails", None: "cannot tell"}
OWN = "ours"  # begins the source of a claim that was not published


def is_published(source: str) -> bool:
    """Whether this is the source of a claim that runs can reproduce, and not somebody's own."""
    return not source.startswith(OWN)


def words(answer: bool | None, *, published: bool) -> str:
    """An answer as readers see it."""
    return (ANSWERS if published else OF_OWN)[answer]


@dataclass(frozen=True)
class Verdict(ABC):
    """The verdict on a claim as it stands in a scenario; the answer is None where none is known."""

    name: str
    claim: Any
    answer: bool | None

    @property
    def verdict(self) -> Answer:
        """The answer as JSON has it, the same words for all claims."""
        return ANSWERS[self.answer]

    @property
    def in_words(self) -> str:
        """The answer as readers see it."""
        return self.word_for(self.answer)

    @property
    def published(self) -> bool:
        """Whether the claim has a published source, which runs can reproduce."""
        return is_published(self.claim.source)

    def word_for(self, answer: bool | None) -> str:
        """An answer on this claim as readers see it."""
        return words(answer, published=self.published)

    @property
    def preliminary(self) -> bool:
        """Whether it may change, as runs are still missing."""
        return False

    @abstractmethod
    def evidence(self) -> str:
        """The numbers and the reasons, in one line."""

    @abstractmethod
    def as_json(self) -> dict[str, object]:
        """The verdict as plain data, what is infinite or undefined as None."""

    def row(self) -> str:
        """The verdict as a row of a table in Markdown."""
        claim, given = self.claim, getattr(self.claim, "given", "")
        # Only some claims have a premise, those on single runs; a study's have no `given`.
        premise = f", given {markdown_code(given)}" if given else ""
        return (
            f"| {markdown_cell(self.name)} | "
            f"{markdown_cell(claim.says)} ({markdown_cell(claim.source)}) | "
            f"**{self.in_words}**{', preliminary' if self.preliminary else ''} | "
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


class Answered(NamedTuple, Generic[AnyVerdict]):
    """The verdicts with one answer, by their numbers, and its word."""

    answer: bool | None
    words: str
    verdicts: list[tuple[int, AnyVerdict]]


def by_answer(verdicts: Sequence[AnyVerdict]) -> list[Answered[AnyVerdict]]:
    """The verdicts with their numbers by answer, an answer that nobody got included.

    Published claims come first. Open answers of both kinds stand together, last.
    """
    numbered = [*enumerate(verdicts, 1)]
    kinds = [kind for kind in (True, False) if kind in {v.published for v in verdicts}]
    groups = [
        Answered(
            answer,
            words(answer, published=kind),
            [row for row in numbered if (row[1].answer, row[1].published) == (answer, kind)],
        )
        for kind in kinds
        for answer in (True, False)
    ]
    open_ = [row for row in numbered if row[1].answer is None]
    return [*groups, Answered(None, ANSWERS[None], open_)]
