"""The HTML report of a comparison: one file that needs nothing else."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from podusv_cli.comparison import stability
from podusv_cli.comparison.claims import RunsVerdict
from podusv_cli.comparison.differences import as_text
from podusv_cli.comparison.table import MetricRow, MetricTable, leaders, rows, window
from podusv_cli.core.about import MetricAbout, RunAbout, SettingAbout
from podusv_cli.core.finding import Finding
from podusv_cli.core.phrases import value_text
from podusv_cli.expressions.verdict import by_answer
from podusv_cli.figures import chase
from podusv_cli.figures.traces import PIECES
from podusv_cli.metrics.table import CLOCKED, METRICS
from podusv_cli.pages.page import Picture, environment, flat

EQUATION = re.compile(r"\(\d+\)")  # of the first paper
MANY, FEW = 7, 8  # more runs than MANY stand below each other, with FEW numbers in a table
FACTS = 3  # numbers of each run in the answer
BESIDE = 2  # figures beside the answer: trajectory and errors


@dataclass(frozen=True)
class Story:
    """What a report tells."""

    title: str
    abouts: Mapping[str, RunAbout]
    endings: Mapping[str, str]  # how each run ended
    differences: Mapping[str, Mapping[str, Any]]
    noticed: Sequence[Finding]
    table: MetricTable
    verdicts: Sequence[RunsVerdict]
    theories: Mapping[str, Mapping[str, Any]]  # theory.json of the runs that have one
    figures: Sequence[Picture]
    provenance: Mapping[str, Any]
    missing: Sequence[str] = ()  # what could not be made, and why
    chase: Mapping[str, Any] = field(default_factory=dict)  # see `chase.chase`
    traces: Mapping[str, Any] = field(default_factory=dict)  # see `traces.traces`
    metrics: Mapping[str, MetricAbout] = field(default_factory=lambda: METRICS)  # of the table
    unsettled: Sequence[str] = ()  # runs that do not end at their target
    doubts: Sequence[Sequence[str]] = ()  # head and rows of what the verdicts hang on
    meanings: Mapping[str, str] = field(default_factory=dict)  # of the codes of findings


def page(story: Story) -> str:
    """The whole report as HTML."""
    from markupsafe import Markup  # with jinja2

    figures, parts = [*enumerate(story.figures, 1)], _parts(story)
    about = next(iter(story.abouts.values()))
    table = rows(story.table, story.metrics, story.unsettled)
    first = [row for row in table if row.metric.headline] or table
    standings = _standings(story, first)
    return (
        environment("podusv_cli.comparison")
        .get_template("report.html.j2")
        .render(
            title=story.title,
            story=story,
            scenario=about.values,
            seas=[about.section(at)["kind"] for at in about.said if at.startswith("disturbance")],
            bad={label: ending for label, ending in story.endings.items() if ending},
            differing=as_text(story.differences),
            answers=by_answer(story.verdicts),
            standings=standings,
            window=window(story.table),
            ranked=any(standing.names or standing.more for standing in standings.values()),
            noticed=_by_code(story),
            metrics={row.metric.name: row.metric for row in table},
            many=MANY,
            few=FEW,
            single=len(story.table.columns) == 1,
            headlines=first,
            others=table[len(first) :],
            stability=(stability.HEAD, [*stability.rows(story.theories)]),
            beside=figures[:BESIDE],
            figures=figures,
            changed=about.settings,
            laws=laws([about.law for about in story.abouts.values()]),
            parts=parts,
            cited=any(EQUATION.search(said) for _, said, _ in parts),
            provenance=[(key, value_text(value)) for key, value in flat(story.provenance)],
            chase_json=Markup(chase.as_json(dict(story.chase))),
            traces_json=Markup(chase.as_json(dict(story.traces))),
            pieces=PIECES,
        )
    )


class Standing(NamedTuple):
    """A run in the answer: facts, the first metrics in which it is the best, how many others."""

    facts: list[str]
    names: list[str]
    more: int


def _standings(story: Story, rows: Sequence[MetricRow]) -> dict[str, Standing]:
    """What the answer says of every run that finished, by label; `rows` come first in the table."""
    best = leaders(story.table, story.metrics, story.unsettled)
    standings = {}
    for label in itertools.compress(story.table.columns, story.table.finished):
        own = story.table.of(label)
        numbers = ((metric, own[metric.name]) for metric, _ in rows[:FACTS])
        facts = [_fact(metric, number) for metric, number in numbers if metric.name not in CLOCKED]
        names = best.get(label, [])
        first = [name for name in names if story.metrics[name].headline]
        standings[label] = Standing([*filter(None, facts)], first, len(names) - len(first))
    return standings


def _fact(metric: MetricAbout, number: float) -> str:
    """A number in words; empty where there is none."""
    if math.isnan(number):
        return f"{metric.row}: never" if metric.happens else ""
    colon, unit = "" if metric.happens else ":", "" if metric.unit == "1" else f" {metric.unit}"
    return f"{metric.row}{colon} {number:.3g}{unit}"


def _by_code(story: Story) -> dict[str, tuple[str, list[Finding]]]:
    """The findings of each code, and what the code means."""
    by_code = dict[str, tuple[str, list[Finding]]]()
    for finding in story.noticed:
        meaning = story.meanings.get(finding.code, "")
        by_code.setdefault(finding.code, (meaning, []))[1].append(finding)
    return by_code


def laws(
    tables: Sequence[Sequence[SettingAbout]],
) -> list[tuple[SettingAbout, list[SettingAbout | None]]]:
    """Every key that any law sets otherwise than by default: what it is, and what each law has.

    `tables` are the settings of each law; None where a law lacks the key.
    """
    keyed = [{setting.key: setting for setting in table} for table in tables]
    # Reversed, so that the first law that has a key describes it.
    about = {key: setting for table in reversed(keyed) for key, setting in table.items()}
    keys = dict.fromkeys(setting.key for table in tables for setting in table if setting.changed)
    # The kind comes first.
    ordered = sorted(keys, key=lambda key: key != "kind")
    return [(about[key], [table.get(key) for table in keyed]) for key in ordered]


def _parts(story: Story) -> list[tuple[str, str, str]]:
    """Rows for each part: its name, the first line of what it says of itself, all its values.

    Parts besides the laws are those of the first run.
    """
    (first, *_), law = story.abouts.values(), "controller"
    parts = {name: (said, name, first) for name, said in first.said.items() if name != law}
    parts |= {
        f"{law} {label}": (about.said[law], law, about) for label, about in story.abouts.items()
    }
    return [
        (
            name,
            said,
            ", ".join(f"{key} {value_text(value)}" for key, value in flat(about.section(at))),
        )
        for name, (said, at, about) in parts.items()
    ]
