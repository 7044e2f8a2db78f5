"""The key `tune`: an equal search for good gains of every law of a study."""

from __future__ import annotations

import math
import warnings
from typing import Self

from pydantic import model_validator

from podusv_cli.core.component import OF_SECTION, Component, value

WORDS = tuple[bool | int | float | str, ...]
AROUND = "around"  # in `space`: of every gain that is not named


class Range(Component):
    """What a gain may be: one of the keys says how."""

    log: tuple[float, float] | None = value(
        None, OF_SECTION, "[low, high]: between them, on a logarithmic scale"
    )
    uniform: tuple[float, float] | None = value(
        None, OF_SECTION, "[low, high]: between them, on a linear scale"
    )
    integers: tuple[int, int] | None = value(
        None, OF_SECTION, "[low, high]: whole numbers, both ends included"
    )
    choice: WORDS | None = value(None, OF_SECTION, "values to choose from")
    around: float | None = value(
        None, "", "a factor to either side of the scenario's value, on a logarithmic scale", gt=1
    )
    keep: bool = value(False, "", "true: stays as it is")

    @property
    def given_keys(self) -> list[str]:
        """The keys that are given."""
        return [n for n in type(self).model_fields if getattr(self, n) not in (None, False)]

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        """Raises ValueError unless exactly one range is given, with low < high."""
        if len(self.given_keys) != 1:
            found = " and ".join(self.given_keys) or "none"
            raise ValueError(
                f"must have one of {', '.join(type(self).model_fields)}; found {found}"
            )
        bounds = self.log or self.uniform or self.integers
        if bounds and not (bounds[0] < bounds[1] and math.isfinite(bounds[1] - bounds[0])):
            raise ValueError(f"{self.given_keys[0]}: {bounds[0]:g} is not below {bounds[1]:g}")
        if self.log and self.log[0] <= 0.0:
            raise ValueError(f"log: {self.log[0]:g} is not above 0; write uniform: [low, high]")
        if self.choice is not None and len(set(self.choice)) < 2:
            raise ValueError("choice: needs two different values or more")
        return self


with warnings.catch_warnings(action="ignore", category=UserWarning):
    # pydantic warns because its models have a deprecated method `validate`, which nobody calls.
    class Tune(Component):
        """The same number of simulated runs for every law, to find its gains."""

        budget: int = value(
            2000, "", "simulated runs for each search, pruned ones included", ge=1, le=10**7
        )
        train: int = value(
            16, "", "draws that gains are judged by; a sweep never has them", ge=1, le=10**5
        )
        validate: int = value(  # type: ignore[assignment]
            500, "", "other draws, on which found gains are reported", ge=1, le=10**7
        )
        objective: str = value(
            "median(iae)", "", "what is to be small, as an expression over draws"
        )
        subject_to: tuple[str, ...] = value((), "", "inequalities over draws that have to hold")
        space: dict[str, float | Range] = value(
            {AROUND: 10.0},
            "",
            "what gains may be, by key or law.key; `around: 10` is for all that are not named",
        )
        batch: int = value(8, "", "gains that are tried at a time; part of the result", ge=1, le=64)
        repeats: int = value(
            3,
            "",
            "searches of each law, on each training set, that differ in the tuner's random numbers",
            ge=1,
            le=100,
        )

        training_sets: int = value(
            1,
            "",
            "sets of `train` draws; every law is searched `repeats` times on each",
            ge=1,
            le=100,
        )

        @property
        def searches(self) -> int:
            """The searches of each law; the n-th is on the training set n modulo their number."""
            return self.repeats * self.training_sets

        @model_validator(mode="after")
        def _sound(self) -> Self:
            """Raises ValueError for a search space whose `around` or ranges are no such thing."""
            for name, content in self.space.items():
                if name == AROUND and (not isinstance(content, float) or content <= 1.0):
                    raise ValueError("space.around: must be a number above 1, such as 10.0")
                if name != AROUND and isinstance(content, float):
                    raise ValueError(
                        f"space.{name}: is a number; write {{log: [low, high]}}, or keep: true"
                    )
            return self
