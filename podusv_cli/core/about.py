"""What a finished study says about itself: all that a reader needs, without scenario or parts."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, PositiveInt, model_validator

from podusv_cli.core.component import Component, value
from podusv_cli.core.signal import check_words


@dataclass(frozen=True)
class MetricAbout:
    """What a metric is called, and how a table shows it; see `metrics.metric.Metric`."""

    name: str
    unit: str
    meaning: str
    _: KW_ONLY
    place: int = 100
    happens: bool = False
    counts_standoff: bool = False
    margin: bool = False
    symbol: str = ""
    words: str = ""
    headline: bool = False

    def __post_init__(self) -> None:
        """Check the words. Raises ValueError."""
        check_words("metric", self.name, self.unit, self.meaning, self.symbol, self.words)

    @property
    def row(self) -> str:
        """What a table calls it."""
        return self.words or self.meaning

    @property
    def undefined(self) -> str:
        """What a table has for a run that finished without the number."""
        return "never" if self.happens else "-"

    @property
    def infinite(self) -> str:
        """What it means that a number of many runs is infinite."""
        return "never" if self.happens else "failed"

    @property
    def clocked(self) -> bool:
        """Whether it is a measured time, which never repeats."""
        return self.unit == "ns"


class Keep(Component):
    """Which runs are made again as full run folders, with log and figures."""

    failed: int = value(0, "", "so many runs of every law that diverged or were no success", ge=0)
    worst: dict[str, int] = value(
        {}, "", "by metric: so many runs of every law, the worst that succeeded"
    )
    draws: tuple[int, ...] = value((), "", "these draws, of every law; the first is 0")


class StudyClaim(Component):
    """A sentence about all runs of a study, and how these decide on it."""

    says: str = value(..., "", "the claim, in a sentence of your own")
    source: str = value(
        "ours", "", "where it was published; what begins with `ours` was not published: it holds "
        "or fails, where a published claim is reproduced or not",
    )  # fmt: skip
    expect: str = value(
        ..., "", "the claim as an expression over all draws; see podusv docs study_claims"
    )
    tolerance: float = value(
        0.0,
        "",
        "relative: by how much one number must be smaller than another to count",
        ge=0,
        lt=1,
    )
    remark: str = value("", "", "choices made where the source is silent")


class _Plain(BaseModel):
    """Read from JSON; keys that nobody knows are passed over."""

    model_config = ConfigDict(strict=True, frozen=True)


class SweepCall(_Plain):
    """How many draws one `podusv sweep run` asked for, and when it began."""

    draws: PositiveInt
    started: str


class QuantityAbout(_Plain):
    """A drawn quantity: the keys that it changes, and how it is drawn, in words."""

    keys: tuple[str, ...]
    drawn: str
    is_seed: bool


class StudyIdentity(_Plain):
    """What the numbers of a study depend on, by dotted keys, and what was asked for."""

    draws: PositiveInt
    identity: dict[str, Any]
    history: tuple[SweepCall, ...]


class StudyAbout(StudyIdentity):
    """study.json: a study as whoever reads its runs has to know it.

    `cells` are labels, `grid` has its values as they stand in YAML, `parts` the kinds of path,
    disturbance and actuator. `metrics` are those that laws may have, `measured` the names of those
    that the runs have. `plugins` are the files of plug-ins with their digests.
    """

    name: str
    description: str
    duration: float  # s
    steady_fraction: float
    settling_radius: float  # m
    parts: dict[str, str]
    plugins: dict[str, str]
    laws: tuple[str, ...]
    cells: tuple[str, ...]
    grid: dict[str, tuple[str, ...]]
    seed: int
    design: str
    success: str
    level: float
    keep: Keep
    claims: dict[str, StudyClaim]
    quantities: dict[str, QuantityAbout]
    metrics: dict[str, MetricAbout]
    measured: tuple[str, ...]

    @property
    def independent(self) -> bool:
        """Whether draws are independent, which all intervals need."""
        return self.design == "random"

    @model_validator(mode="after")
    def _of_one_study(self) -> Self:
        if wrong := [name for name, about in self.metrics.items() if about.name != name]:
            raise ValueError(f"metrics: {wrong[0]} is called otherwise inside")
        if len({*self.measured} & {*self.metrics}) != len(self.measured):
            raise ValueError("measured: a metric is there twice, or not among the metrics")
        runs = {f"{law}[{cell}]" for law in self.laws for cell in range(len(self.cells))}
        if not runs <= {key.partition("]")[0] + "]" for key in self.identity}:
            raise ValueError("laws and cells: the identity has others")
        return self
