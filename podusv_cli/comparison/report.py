"""The HTML report of a comparison: one file that needs nothing else."""

from __future__ import annotations

import base64
import inspect
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import pandas as pd

from podusv_cli.comparison import chase, settings, stability
from podusv_cli.comparison.claims import ANSWERS, Verdict
from podusv_cli.comparison.differences import as_text, flat, value_text
from podusv_cli.comparison.table import cells, leaders
from podusv_cli.core.component import Component
from podusv_cli.core.escaping import lines
from podusv_cli.core.finding import Finding
from podusv_cli.core.plugins import Plugins
from podusv_cli.findings.finding import finding_kinds
from podusv_cli.metrics.metric import Metric
from podusv_cli.metrics.table import METRICS
from podusv_cli.scenario.model import Scenario

if TYPE_CHECKING:
    from jinja2 import Environment

POWERS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
BESIDE = 2  # figures beside the answer: trajectory and errors


class Picture(NamedTuple):
    """A figure of the report: what it shows, where one of its kind was published, and its SVG."""

    name: str
    caption: str
    svg: bytes
    source: str = ""

    @property
    def data(self) -> str:
        """The picture as an address; inline markup of several figures would share its names."""
        return f"data:image/svg+xml;base64,{base64.b64encode(self.svg).decode()}"

    @property
    def title(self) -> str:
        """What it shows, in a few words."""
        return self.caption.partition(";")[0].partition(":")[0].partition(",")[0]


@dataclass(frozen=True)
class Story:
    """What a report tells."""

    title: str
    scenario: Scenario
    controllers: Mapping[str, Component]
    endings: Mapping[str, str]  # how each run ended
    differences: Mapping[str, Mapping[str, Any]]
    noticed: Sequence[Finding]
    table: pd.DataFrame
    verdicts: Sequence[Verdict]
    theories: Mapping[str, Mapping[str, Any]]  # theory.json of the runs that have one
    figures: Sequence[Picture]
    provenance: Mapping[str, Any]
    missing: Sequence[str] = ()  # what could not be made, and why
    chase: Mapping[str, Any] = field(default_factory=dict)  # see `chase.chase`
    metrics: Mapping[str, Metric] = field(default_factory=lambda: METRICS)  # of the table


def page(story: Story) -> str:
    """The whole report."""
    from markupsafe import Markup  # with jinja2

    figures = [*enumerate(story.figures, 1)]
    best = leaders(story.table, story.metrics)
    return environment().get_template("report.html.j2").render(
        story=story,
        scenario=story.scenario,
        bad={label: ending for label, ending in story.endings.items() if ending},
        differing=as_text(story.differences),
        answers=_answers(story.verdicts),
        leaders={label: names for label, names in best.items() if names},
        noticed=_by_code(story.noticed, story.scenario.plugged),
        metrics={str(name): story.metrics[str(name)] for name in story.table.index},
        single=len(story.table.columns) == 1,
        cells=cells(story.table, story.metrics),
        stability=(stability.HEAD, [*stability.rows(story.theories)]),
        beside=figures[:BESIDE],
        figures=figures,
        changed=settings.changed(story.scenario),
        laws=settings.laws(story.controllers),
        parts=_parts(story),
        provenance=[(key, value_text(value)) for key, value in flat(story.provenance)],
        chase_json=Markup(chase.as_json(dict(story.chase))),
    )  # fmt: skip


def environment() -> Environment:
    """The templates; whatever they show is text, in which every letter shows."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # slow to import

    made = Environment(
        loader=PackageLoader("podusv_cli.comparison"), autoescape=True, finalize=_shown,
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    made.filters |= {"sentence": _sentence, "raised": _raised}
    return made


def _shown(value: Any) -> Any:
    """What a template shows in place of a value; markup of the template itself as it is."""
    return value if hasattr(value, "__html__") else lines(value)


def _sentence(text: str) -> str:
    """The text with a capital and a full stop; a symbol at the start stays as it is."""
    first = text.partition(" ")[0].rstrip(",;:")
    start = text[:1].upper() if first.isalpha() and first.islower() else text[:1]
    return f"{start}{text[1:]}{'' if text.endswith('.') else '.'}"


def _raised(unit: str) -> str:
    """The unit with its powers raised."""
    return re.sub(r"(?<=[A-Za-z])\d", lambda power: power[0].translate(POWERS), unit)


def _answers(verdicts: Sequence[Verdict]) -> dict[str, list[tuple[int, Verdict]]]:
    """The verdicts with their numbers by answer."""
    numbered = [*enumerate(verdicts, 1)]
    return {
        answer: [(i, verdict) for i, verdict in numbered if verdict.answer == answer]
        for answer in ANSWERS.values()
    }


def _by_code(findings: Sequence[Finding], plugins: Plugins) -> dict[str, tuple[str, list[Finding]]]:
    """The findings of each code, and what the code means."""
    known, told = finding_kinds(plugins), dict[str, tuple[str, list[Finding]]]()
    for finding in findings:
        meaning = getattr(known.get(finding.code), "meaning", "")
        told.setdefault(finding.code, (meaning, []))[1].append(finding)
    return told


def _parts(story: Story) -> list[tuple[str, str, str]]:
    """A row for each part: its name, the first line of what it says of itself, all its values."""
    parts = settings.parts(story.scenario)
    parts |= {f"controller {label}": part for label, part in story.controllers.items()}
    return [
        (
            name,
            (inspect.getdoc(type(part)) or "").partition("\n")[0],
            ", ".join(f"{key} {value_text(value)}" for key, value in flat(part.model_dump())),
        )
        for name, part in parts.items()
    ]
