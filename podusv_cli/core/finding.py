"""Findings: what is noticed about a scenario before a run, and about a run after it.

A finding is one function, decorated with `before` or `after`, in a module of `findings` or in the
file of the component that it is about. It yields a sentence for each case that it finds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from podusv_cli.core.recording import Recording, blocks

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Finding:
    """Something that a user should know: a code, a scenario key, a sentence.

    `runs` are labels of the runs that it is about, where the comparison has others as well.
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
        """Runs and key: `dsc, pid: actuator`; the key alone where no run is named."""
        return ": ".join(filter(None, (", ".join(self.runs), self.where)))

    def as_json(self) -> dict[str, str]:
        """What `--json` prints of a run and metrics.json holds."""
        return {"code": self.code, "where": self.where, "text": self.text}


class At(NamedTuple):
    """A sentence about another key than the finding's own."""

    where: str
    text: str


Sentences = Iterator[str | At]


@dataclass(frozen=True)
class Notice:
    """A kind of finding: its code, the key that it is about, what it means, when it can be told.

    `look` is asked about runs whose law is a `law`.
    """

    name: str
    about: str
    meaning: str
    when: Literal["before", "after"]
    look: Callable[..., Sentences]
    law: type[Any]

    def findings(self, controller: object, *seen: object) -> Iterator[Finding]:
        """What there is to tell of a run with this law."""
        for told in self.look(*seen) if isinstance(controller, self.law) else ():
            said = told if isinstance(told, At) else At(self.about, told)
            yield Finding(self.name, said.where, said.text)


Decorator = Callable[[Callable[..., Sentences]], Notice]


def before(name: str, *, about: str, meaning: str, law: type[Any] = object) -> Decorator:
    """Register a function of a `findings.Case`, which tells of a scenario before it runs."""
    return lambda look: Notice(name, about, meaning, "before", look, law)


def after(name: str, *, about: str, meaning: str, law: type[Any] = object) -> Decorator:
    """Register a function of a scenario and its recording, which tells of a run that is over."""
    return lambda look: Notice(name, about, meaning, "after", look, law)


def rows_where(log: Recording, test: Callable[[Recording], Mask]) -> Mask:
    """In which rows a test comes true; it is asked of some of them at a time."""
    return np.concatenate([test(log.part(rows)) for rows in blocks(len(log["time"]))])


def times_of(log: Recording, mask: Mask) -> str:
    """`at 3.1 s`, `from 3.1 s to 4 s`, `3 times between 3.1 s and 80 s`."""
    changes = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    begins, ends = changes[::2], changes[1::2] - 1
    first, last = log["time"][begins[0]], log["time"][ends[-1]]
    if first == last:
        return f"at {first:.6g} s"
    if len(begins) == 1:
        return f"from {first:.6g} s to {last:.6g} s"
    return f"{len(begins)} times between {first:.6g} s and {last:.6g} s"
