"""What is made of a finished simulation: none of it is worth the simulation's loss."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

from podusv_cli.core.errors import StorageError, in_a_line
from podusv_cli.process.interrupts import interrupts_caught, interrupts_heard

Result = TypeVar("Result")


@dataclass(frozen=True)
class Missing:
    """A part of a result that could not be made: why, in a line, and the traceback."""

    what: str
    why: str
    trace: str = ""

    def __str__(self) -> str:
        """The sentence for the user."""
        return f"{self.what} could not be made: {self.why}"


class Extras:
    """Work on a finished simulation.

    What fails is noted in `missing` and the rest goes on. Only StorageError is raised: what cannot
    be stored is lost anyway. For use while interrupts are held.
    """

    def __init__(self, interrupted: bool = False) -> None:
        """`interrupted`: leave out everything that an interrupt may leave out."""
        self.interrupted = interrupted
        self.missing: list[Missing] = []

    def made(self, what: str, work: Callable[[], Result]) -> Result | None:
        """What the work returns, or None where it fails; `what` names it in the message."""
        try:
            return work()
        except Exception as error:
            self._note(what, error)
        return None

    def attempt(self, what: str, work: Callable[[], Result]) -> Result | None:
        """The same for work that is not worth waiting for: an interrupt ends it or leaves it out.

        None then, too, and nothing is noted.
        """
        if self.interrupted:
            return None
        with interrupts_caught() as here:
            try:
                with interrupts_heard():
                    return work()
            except KeyboardInterrupt:
                self.interrupted = True
            except Exception as error:
                self.interrupted = here.number > 0
                if not self.interrupted:  # machine code may turn one into another exception
                    self._note(what, error)
        return None

    def as_json(self) -> dict[str, Any]:
        """What missing.json holds."""
        return {"format": 1, "missing": [asdict(part) for part in self.missing]}

    def _note(self, what: str, error: Exception) -> None:
        if isinstance(error, StorageError):
            raise error
        trace = "".join(traceback.format_exception(error))
        self.missing.append(Missing(what, in_a_line(error), trace))
