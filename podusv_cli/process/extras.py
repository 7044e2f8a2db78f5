"""Work after a simulation (metrics, figures, ...), whose failure must not lose its log."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

from podusv_cli.core.errors import StorageError, in_a_line
from podusv_cli.process.interrupts import interrupts_caught, interrupts_enabled

Result = TypeVar("Result")


@dataclass(frozen=True)
class Failure:
    """A part of a result that could not be made or has another problem: why, and the traceback."""

    what: str
    why: str
    trace: str = ""
    problem: str = "could not be made"

    def __str__(self) -> str:
        """The sentence for the user."""
        return f"{self.what} {self.problem}: {self.why}"

    @property
    def sentence_with_trace(self) -> str:
        """The sentence, and where the traceback is if there is one."""
        return f"{self}; missing.json in the folder has the traceback" if self.trace else str(self)


class Extras:
    """Work after a simulation.

    A failure is added to `missing`, and the other work goes on. Only StorageError is raised. Use it
    while interrupts are deferred.
    """

    def __init__(self, interrupted: bool = False) -> None:
        """With `interrupted`, `attempt` does nothing."""
        self.interrupted = interrupted
        self.missing: list[Failure] = []

    def make_or_record(self, what: str, work: Callable[[], Result]) -> Result | None:
        """What the work returns, or None where it fails; `what` names it in the message."""
        try:
            return work()
        except Exception as error:
            self.note(what, error)
        return None

    def attempt(self, what: str, work: Callable[[], Result]) -> Result | None:
        """As `make_or_record`, for work that an interrupt may end: then None, without a failure.

        After an interrupt no further work is begun.
        """
        if self.interrupted:
            return None
        with interrupts_caught() as here:
            try:
                with interrupts_enabled():
                    return work()
            except KeyboardInterrupt:
                self.interrupted = True
            except Exception as error:
                self.interrupted = here.number > 0
                if not self.interrupted:  # compiled code may turn an interrupt into any exception
                    self.note(what, error)
        return None

    def as_json(self) -> dict[str, Any]:
        """What missing.json holds."""
        return {"format": 1, "missing": [asdict(part) for part in self.missing]}

    def note(self, what: str, error: Exception) -> None:
        """Add a failure to `missing`. Raises StorageError if it is one."""
        if isinstance(error, StorageError):
            raise error
        trace = "".join(traceback.format_exception(error))
        self.missing.append(Failure(what, in_a_line(error), trace))
