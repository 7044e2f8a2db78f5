"""The HTML report of a comparison: one file that needs nothing else."""

from __future__ import annotations

import base64
import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from podusv_cli.comparison import stability
from podusv_cli.comparison.claims import Verdict
from podusv_cli.comparison.differences import as_text, flat, value_text
from podusv_cli.comparison.table import cells
from podusv_cli.core.component import Component
from podusv_cli.core.escaping import lines
from podusv_cli.core.finding import Finding
from podusv_cli.scenario.model import Scenario

if TYPE_CHECKING:
    from jinja2 import Environment

SECTIONS = ("vessel", "start", "path", "disturbance", "actuator", "simulation", "control")


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
    figures: Sequence[tuple[str, str, bytes]]  # name, caption, SVG
    provenance: Mapping[str, Any]
    missing: Sequence[str] = ()  # what could not be made, and why


def page(story: Story) -> str:
    """The whole report."""
    return (
        environment()
        .get_template("report.html.j2")
        .render(
            story=story,
            bad={label: ending for label, ending in story.endings.items() if ending},
            differing=as_text(story.differences),
            cells=cells(story.table),
            stability=(stability.HEAD, [*stability.rows(story.theories)]),
            figures=[_figure(*figure) for figure in story.figures],
            scenario=_scenario(story),
            provenance=[(key, value_text(value)) for key, value in flat(story.provenance)],
        )
    )


def environment() -> Environment:
    """The templates; whatever they show is text, in which every letter shows."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # slow to import

    return Environment(
        loader=PackageLoader("podusv_cli.comparison"), autoescape=True, finalize=_shown,
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip


def _shown(value: Any) -> Any:
    """What a template shows in place of a value; markup of the template itself as it is."""
    return value if hasattr(value, "__html__") else lines(value)


def _figure(name: str, caption: str, svg: bytes) -> tuple[str, str, str]:
    # As data rather than inline markup: the figures' internal names would collide in one page.
    return name, caption, base64.b64encode(svg).decode()


def _scenario(story: Story) -> list[tuple[str, list[str], str]]:
    """A row for each part: its name, what it is, its values."""
    parts: dict[str, Component] = {name: getattr(story.scenario, name) for name in SECTIONS}
    parts |= {f"controller {label}": part for label, part in story.controllers.items()}
    return [(name, _said(part), _values(part)) for name, part in parts.items()]


def _said(part: Component) -> list[str]:
    """The first line of what the part says of itself; every second piece is code."""
    return (inspect.getdoc(type(part)) or "").partition("\n")[0].split("`")


def _values(part: Component) -> str:
    return ", ".join(f"{key} {value_text(value)}" for key, value in flat(part.model_dump()))
