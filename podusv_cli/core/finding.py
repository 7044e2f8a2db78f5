"""Findings: warnings about a scenario before a run, or about the run afterwards.

Each kind of finding is one function, decorated with `warn_before_run` or `warn_after_run`, in a
module of `findings` or in the file of the component that it is about. It yields one sentence per
finding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from podusv_cli.core.errors import in_a_line
from podusv_cli.core.recording import Recording, blocks

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Finding:
    """One warning: the code of its kind, the scenario key that it is about, and a sentence.

    `runs` are labels of the runs that it is about; empty for all runs of a comparison.
    """

    code: str
    where: str
    text: str
    runs: tuple[str, ...] = ()

    def __str__(self) -> str:
        """One line, as a command shows it."""
        return f"warning[{self.code}]: {self.place}: {self.text}"

    @property
    def place(self) -> str:
        """Runs and key, as `dsc, pid: actuator`; the key alone without `runs`."""
        return ": ".join(filter(None, (", ".join(self.runs), self.where)))

    def as_json(self) -> dict[str, str]:
        """As in metrics.json and in the output of `--json`."""
        return {"code": self.code, "where": self.where, "text": self.text}


def merge_findings(findings: Mapping[str, Sequence[Finding]]) -> list[Finding]:
    """Findings of several runs (by label), each once, with its runs unless all runs have it.

    Equal findings are those with the same code, key and sentence.
    """
    alike: dict[Finding, list[str]] = {}
    for label, several in findings.items():
        for finding in dict.fromkeys(several):
            alike.setdefault(finding, []).append(label)
    return [
        replace(finding, runs=() if len(labels) == len(findings) else tuple(labels))
        for finding, labels in alike.items()
    ]


class At(NamedTuple):
    """A sentence about another key than the finding's own."""

    where: str
    text: str


Sentences = Iterator[str | At]


@dataclass(frozen=True)
class FindingKind:
    """A kind of finding: its code, the key that it is about, what it means, before or after a run.

    `search` yields the sentences. It is called for laws of the class `law` only, and after a run
    only where all signals in `needs` were logged. `condition` is the threshold in words, `remedy`
    what the user can change.
    """

    name: str
    about: str
    meaning: str
    when: Literal["before", "after"]
    search: Callable[..., Sentences]
    law: type[Any]
    condition: str = ""
    remedy: str = ""
    needs: tuple[str, ...] = ()

    def findings(self, controller: object, *seen: object) -> Iterator[Finding]:
        """All findings of this kind; the arguments `seen` are passed on to `search`."""
        if not isinstance(controller, self.law) or not self._has_all(*seen):
            return
        try:
            for sentence in self.search(*seen):
                at = sentence if isinstance(sentence, At) else At(self.about, sentence)
                yield Finding(self.name, at.where, at.text)
        except Exception as error:  # of a plug-in, which costs neither a run nor other findings
            if self.search.__module__.startswith("podusv_cli."):
                raise
            text = f"could not be looked for: {in_a_line(error)}"
            yield Finding(self.name, self.about, text)

    def _has_all(self, *seen: Any) -> bool:
        """Whether the log, the last of `seen`, has all signals that the search needs."""
        return all(name in seen[-1] for name in self.needs)


Decorator = Callable[[Callable[..., Sentences]], FindingKind]


def _decorator(when: Literal["before", "after"]) -> Callable[..., Decorator]:
    """The decorator for findings that are looked for before or after a run."""

    def kind_of(
        name: str,
        *,
        about: str,
        meaning: str,
        condition: str = "",
        remedy: str = "",
        law: type[Any] = object,
        needs: tuple[str, ...] = (),
    ) -> Decorator:
        """A decorator that makes a kind of finding of a function.

        The arguments are the fields of `FindingKind`. `before` a run the function takes a `Case`,
        `after` a run the scenario and its recording.
        """
        return lambda search: FindingKind(
            name, about, meaning, when, search, law, condition, remedy, needs
        )

    return kind_of


warn_before_run, warn_after_run = _decorator("before"), _decorator("after")


def rows_where(log: Recording, test: Callable[[Recording], Mask]) -> Mask:
    """Which rows pass a test (rows,); it is applied block by block, as logs may exceed memory."""
    return np.concatenate([test(log.part(rows)) for rows in blocks(len(log["time"]))])


def times_of(log: Recording, mask: Mask) -> str:
    """`at 3.1 s`, `from 3.1 s to 4 s`, `3 times between 3.1 s and 80 s`; `mask` is (rows,)."""
    # Spans of True begin at even changes and end just before odd ones
    changes = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    begins, ends = changes[::2], changes[1::2] - 1
    first, last = log["time"][begins[0]], log["time"][ends[-1]]
    if first == last:
        return f"at {first:.6g} s"
    if len(begins) == 1:
        return f"from {first:.6g} s to {last:.6g} s"
    return f"{len(begins)} times between {first:.6g} s and {last:.6g} s"
