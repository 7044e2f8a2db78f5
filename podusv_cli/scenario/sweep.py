"""The key `sweep`: many runs of every law, whose numbers are drawn."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, ClassVar, Literal, Self

from pydantic import field_validator, model_validator

from podusv_cli.core.about import Keep, StudyClaim
from podusv_cli.core.component import OF_SECTION, Component, value
from podusv_cli.core.timed_rows import NamedRows, named_rows
from podusv_cli.scenario.distributions import WAYS, Distribution
from podusv_cli.scenario.yaml_tree import bracketed_key

POSTERIOR = "posterior.csv"  # hulls that logs leave possible, in a folder of `podusv identify`


@lru_cache(maxsize=16)  # a study asks for it at every draw
def _lines(text: str) -> NamedRows:
    return named_rows(text, "`rows`")


class Quantity(Distribution):
    """A drawn quantity: how it is drawn, and what becomes of the scenario's own value."""

    folders_of: ClassVar[dict[str, tuple[str, str]]] = {"identified": ("rows", POSTERIOR)}
    keys: tuple[str, ...] = value(
        (), "", "keys that all get the same draw; where left out, the quantity's name is the key"
    )
    times: Distribution | None = value(None, "", "a factor on the scenario's own value")
    plus: Distribution | None = value(None, OF_SECTION, "a summand to the scenario's own value")
    seed: bool = value(False, "", "true: a whole number from 0 to 2^53 - 1, as seed of something")
    identified: str | None = value(
        None,
        "",
        "folder of `podusv identify`, beside the scenario; the hulls that its logs leave "
        "possible (posterior.csv) are read into `rows`",
    )
    rows: str = value(
        "",
        "",
        "lines of numbers with commas, the first of names: a draw takes one line, and each "
        "key below the quantity (or below each of `keys`) its number there",
    )

    @field_validator("keys")
    @classmethod
    def _in_one_form(cls, keys: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(map(bracketed_key, keys))

    @property
    def given_keys(self) -> list[str]:
        """The keys that say how to draw."""
        return [name for name in (*WAYS, "times", "plus", "seed", "rows") if self._says(name)]

    def _says(self, name: str) -> bool:
        content = getattr(self, name)
        return content not in (None, False, "")

    @property
    def distribution(self) -> Distribution:
        """What is drawn from; not for seeds. Of rows it is which of them."""
        if self.rows:
            return Distribution(integers=(0, len(self.lines.rows) - 1))
        return self.times or self.plus or self

    @property
    def lines(self) -> NamedRows:
        """The numbers of `rows`, under the names of keys. Raises ValueError."""
        return _lines(self.rows)

    @property
    def is_label(self) -> bool:
        """Whether a larger number drawn means nothing, as of seeds and of rows."""
        return self.seed or bool(self.rows)

    @property
    def relative(self) -> bool:
        """Whether the scenario's own value matters."""
        return bool(self.times or self.plus)

    def value(self, own: Any, drawn: Any, place: int = 0) -> Any:
        """The value of a key, from the scenario's `own` value and what was `drawn`.

        A factor or a summand applies to the own value; other draws replace it. `place` is the key's
        position in `targets`; for rows, `drawn` is the number of the row.
        """
        if self.rows:
            numbers = self.lines.rows[drawn]
            # `targets` has all columns for each of the keys, one key after the other.
            return float(numbers[place % len(numbers)])
        if self.times:
            return own * drawn
        return own + drawn if self.plus else drawn

    def targets(self, name: str) -> tuple[str, ...]:
        """The keys that the quantity called `name` changes; for rows, a key for each column."""
        keys = self.keys or (name,)
        if self.rows:
            return tuple(f"{key}.{column}" for key in keys for column in self.lines.names)
        return keys

    @model_validator(mode="after")
    def _readable(self) -> Self:
        """Raises ValueError for a file of rows with one line, from which nothing can be drawn."""
        if self.rows and len(self.lines.rows) < 2:
            raise ValueError("rows: has a single line of numbers; nothing can be drawn from it")
        return self

    @model_validator(mode="after")
    def _of_numbers(self) -> Self:
        """Raises ValueError for a relative quantity that chooses among words."""
        words = [word for word in self.distribution.choice or () if isinstance(word, (str, bool))]
        if self.relative and words:
            raise ValueError(f"{self.given_keys[0]}: needs numbers, choice has {words[0]!r}")
        return self


class Sweep(Component):
    """Many runs of every law with numbers that are drawn, as one answer."""

    seed: int = value(
        1, "", "a draw depends on the seed, the quantity's name and its index alone", ge=0, lt=2**63
    )
    draws: int = value(1000, "", "draws for each cell; all laws get the same ones", ge=1, le=10**9)
    design: Literal["random", "sobol"] = value(
        "random", "", "independent draws, or Sobol' points, which are for sensitivities only"
    )
    laws: tuple[str, ...] = value(
        (), "", "names of `controllers` that take part; all where left out"
    )
    vary: dict[str, Quantity] = value(
        {}, "", "what is drawn, by key; `name: null` takes out an inherited one"
    )
    grid: dict[str, tuple[Any, ...]] = value(
        {}, "", "lists of values by key: each combination is a cell, with all draws"
    )
    success: str = value(
        "finished", "", "when a run counts as a success; all others are the worst of all"
    )
    level: float = value(0.95, "", "confidence of all intervals", gt=0.5, lt=1)
    keep: Keep = value(Keep(), "", "runs that get a full run folder")
    claims: dict[str, StudyClaim] = value({}, "", "what the study is to judge, by name")

    @property
    def independent(self) -> bool:
        """Whether draws are independent, which all intervals need."""
        return self.design == "random"
