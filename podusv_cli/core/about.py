"""What a finished run or study says about itself: all that a reader needs, without its parts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, PositiveInt, model_validator

from podusv_cli.core.component import Component, value
from podusv_cli.core.signal import check_words

# Sections of a scenario on which no run of it depends.
BESIDE_RUNS = ("sweep", "tune", "doubt", "identify")


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
    def undefined_word(self) -> str:
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


class Claim(Component):
    """A sentence, published or somebody's own, and how the runs are to decide on it."""

    says: str = value(..., "", "the claim, in a sentence of your own")
    source: str = value(
        "ours",
        "",
        "where it was published: section, figure, equation; what begins with `ours` "
        "was not published: it holds or fails, where a published claim is reproduced or not",
    )
    expect: str = value(..., "", "the claim as an expression over runs; see podusv docs claims")
    given: str = value(
        "", "", "a condition without which the claim has no meaning: if it fails, cannot tell"
    )
    tolerance: float = value(
        0.05, "", "relative: how near `==` is, and how clear `<` and `>` have to be", ge=0, lt=1
    )
    untestable: str = value(
        "",
        "",
        "why no run at hand can decide it: the verdict is `cannot tell`, and what the runs "
        "show of `expect` stands beside it",
    )
    remark: str = value("", "", "choices made where the source is silent")


class StudyClaim(Component):
    """A sentence about all runs of a study, and how these decide on it."""

    says: str = value(..., "", "the claim, in a sentence of your own")
    source: str = value(
        "ours",
        "",
        "where it was published; what begins with `ours` was not published: it holds "
        "or fails, where a published claim is reproduced or not",
    )
    expect: str = value(
        ..., "", "the claim as an expression over all draws; see podusv docs claims"
    )
    tolerance: float = value(
        0.0,
        "",
        "relative: by how much one number must be smaller than another to count",
        ge=0,
        lt=1,
    )
    remark: str = value("", "", "choices made where the source is silent")


class _PlainJson(BaseModel):
    """Read from JSON; keys that nobody knows are passed over."""

    model_config = ConfigDict(strict=True, frozen=True)


class SweepCall(_PlainJson):
    """How many draws one `podusv sweep run` asked for, and when it began."""

    draws: PositiveInt
    started: str


class QuantityAbout(_PlainJson):
    """A drawn quantity: the keys that it changes, and how it is drawn, in words.

    `is_seed`: a larger number means nothing, as of seeds and of rows of a table.
    """

    keys: tuple[str, ...]
    drawn: str
    is_seed: bool


class StudyIdentity(_PlainJson):
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
        """Raises ValueError where names, laws or cells contradict each other."""
        if wrong := [name for name, about in self.metrics.items() if about.name != name]:
            raise ValueError(f"metrics: {wrong[0]} is called otherwise inside")
        if len({*self.measured} & {*self.metrics}) != len(self.measured):
            raise ValueError("measured: a metric is there twice, or not among the metrics")
        # The identity has dotted keys such as `dsc[0].path.kind`: every law in every cell
        runs = {f"{law}[{cell}]" for law in self.laws for cell in range(len(self.cells))}
        if not runs <= {key.partition("]")[0] + "]" for key in self.identity}:
            raise ValueError("laws and cells: the identity has others")
        return self


PROSE = (".source", ".validity")  # endings of keys that are read by people alone


class SettingAbout(_PlainJson):
    """A key with its value and what this would be without it, as they are shown."""

    key: str
    value: str
    unit: str
    default: str
    meaning: str
    changed: bool


Spans = tuple[tuple[float, float], ...]


class RunAbout(_PlainJson):
    """about.json: a run as whoever reads its log has to know it.

    `values` is the scenario as plain data. `path_end` is where a followed path is over, and
    `path_steady` where its steady window begins, see `Recording.row_at`; empty without an end.
    `metrics` are those that podusv has only with the scenario's plug-ins, windows and radii.
    `limits` are the largest surge force [N], yaw moment [N m] and, of an actuator that takes
    one, sway force [N]; None where none is constant. `outages` are times without samples of
    each of x, y, psi, u, v, r. `polar` says that the law is of the first paper's family,
    `optimum_of` which metric the motion minimises, if it is no law's. `said` is what each part
    says of itself, by the key of its section; `settings` are what the scenario sets itself,
    `law` all keys of the law. `log_columns` and `log_frame` are what a log beside the run calls
    its quantities, as under `identify`.
    """

    values: dict[str, Any]
    metrics: dict[str, MetricAbout]
    length: float  # m, of the vessel
    beam: float  # m
    follows: bool  # whether the path is followed, and so has no target
    waypoints: tuple[tuple[float, float], ...]  # m, north and east
    circles: tuple[tuple[float, float, float], ...]  # m, of the waypoints: centre and radius
    trial: bool  # whether nothing aims at the target: a manoeuvring trial, or recorded commands
    standoff: float  # m, that the law keeps on purpose
    limits: tuple[float | None, ...]
    underactuated: bool
    outages: tuple[Spans, Spans, Spans, Spans, Spans, Spans]  # s
    duration: float  # s
    step: float  # s
    every: int  # steps from one logged instant to the next
    steady_from: float  # s
    settling_radius: float  # m
    polar: bool
    optimum_of: str
    said: dict[str, str]
    settings: tuple[SettingAbout, ...]
    law: tuple[SettingAbout, ...]
    path_end: dict[str, float] = {}  # runs of older versions have neither
    path_steady: dict[str, float] = {}
    log_columns: dict[str, str] = {}
    log_frame: Literal["ned", "enu"] = "ned"

    @property
    def name(self) -> str:
        """The scenario's name."""
        return str(self.values["name"])

    def section(self, key: str) -> Any:
        """The values of a section, or of an entry of one that is a list: `disturbance.0`."""
        name, _, place = key.partition(".")
        return self.values[name][int(place)] if place else self.values[name]

    @model_validator(mode="after")
    def _has_its_parts(self) -> Self:
        """Raises ValueError where a part that readers ask for is missing or is no mapping."""
        try:
            parts = [self.section(key) for key in ("vessel", "path", "controller", *self.said)]
        # They are read from a file, and may be anything
        except (LookupError, TypeError, ValueError):
            parts = [None]
        if "name" not in self.values or not all(isinstance(part, dict) for part in parts):
            raise ValueError("values: a part of the scenario is missing")
        return self

    def at_target(self, numbers: Mapping[str, float]) -> bool:
        """Whether a run with these metrics ends at its target, see `at_target`."""
        return at_target(
            numbers, follows=self.follows, trial=self.trial, radius=self.settling_radius
        )


def at_target(numbers: Mapping[str, float], *, follows: bool, trial: bool, radius: float) -> bool:
    """Whether a run with these metrics ends at its target.

    `numbers` are metrics by name. It does with `e_steady` within the settling `radius` [m], or on a
    path that is followed (`follows`) with all legs done. A manoeuvring trial and recorded commands
    (`trial`) have no target to be at.
    """
    if follows:
        return numbers.get("path_done", 1.0) >= 1.0
    return trial or numbers.get("e_steady", math.nan) <= radius
