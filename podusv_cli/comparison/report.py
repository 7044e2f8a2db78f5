"""The HTML report of a comparison: one file that needs nothing else."""

from __future__ import annotations

import base64
import inspect
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import pandas as pd

from podusv_cli.comparison import stability
from podusv_cli.comparison.claims import Verdict
from podusv_cli.comparison.differences import flat, in_short, in_words
from podusv_cli.comparison.table import cells
from podusv_cli.core.component import Component
from podusv_cli.core.escaping import html
from podusv_cli.core.finding import Finding
from podusv_cli.scenario.model import Scenario

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem;
       color: #1a1a1a; background: #fff; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
table { border-collapse: collapse; font-size: 0.85rem; } .wide { overflow-x: auto; }
th, td { padding: 0.25rem 0.7rem; border-bottom: 1px solid #ddd; text-align: left;
         vertical-align: top; }
.number { text-align: right !important; font-variant-numeric: tabular-nums; white-space: nowrap; }
th { border-bottom: 2px solid #444; } code { font-size: 0.82rem; }
.reproduced { color: #00694e; } .not { color: #a33c00; } .cannot { color: #555; }
.warning { border-left: 4px solid #d55e00; padding: 0.4rem 1rem; background: #fdf3ec; }
figure { margin: 1.2rem 0; } img { width: 100%; max-width: 56rem; }
figcaption { font-size: 0.85rem; color: #444; }
small { color: #555; }
"""
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
    title = html(story.title)
    body = "\n".join(
        part
        for part in (
            f"<h1>{title}</h1>",
            f"<p>{html(story.scenario.description)}</p>",
            _endings(story),
            _missing(story),
            _differences(story),
            "<h2>Comparison</h2>",
            _numbers(story.table),
            _claims(story.verdicts),
            _noticed(story.noticed),
            _stability(story.theories),
            "<h2>Figures</h2>" if story.figures else "",
            *(_figure(*figure) for figure in story.figures),
            "<h2>Scenario</h2>",
            _scenario(story),
            "<h2>Provenance</h2>",
            _rows(("", ""), flat(story.provenance)),
        )
        if part
    )
    head = f'<meta charset="utf-8"><title>{title}</title><style>{STYLE}</style>'
    viewport = '<meta name="viewport" content="width=device-width">'
    whole = f'<html lang="en"><head>{viewport}{head}</head>\n<body>{body}</body></html>'
    return f"<!doctype html>\n{whole}\n"


def _table(
    head: Iterable[str], rows: Iterable[Iterable[str]], *, numeric_from: float = math.inf
) -> str:
    """Rows of markup under a head of text; from column `numeric_from` on they are numbers."""

    def line(tag: str, row: Iterable[str]) -> str:
        kinds = (" class=number" if i >= numeric_from else "" for i in count())
        cells_ = (f"<{tag}{kind}>{cell}</{tag}>" for kind, cell in zip(kinds, row, strict=False))
        return f"<tr>{''.join(cells_)}</tr>"

    top = line("th", map(html, head))
    return (
        f"<div class=wide><table>{top}"
        + "\n".join(line("td", row) for row in rows)
        + "</table></div>"
    )


def _rows(head: tuple[str, str], pairs: Iterable[tuple[str, Any]]) -> str:
    return _table(head, ((html(key), html(in_short(value))) for key, value in pairs))


def _endings(story: Story) -> str:
    bad = {label: ending for label, ending in story.endings.items() if ending}
    lines = (f"<li><b>{html(label)}</b>: {html(text)}</li>" for label, text in bad.items())
    return (
        f"<div class=warning>Not all runs finished:<ul>{''.join(lines)}</ul></div>" if bad else ""
    )


def _missing(story: Story) -> str:
    lines = (f"<li>{html(text)}</li>" for text in story.missing)
    listed = f"<div class=warning>Not all could be made:<ul>{''.join(lines)}</ul></div>"
    return listed if story.missing else ""


def _differences(story: Story) -> str:
    if not story.differences:
        return ""
    labels = list(next(iter(story.differences.values())))
    rows = (
        map(html, [key, *(values[label] for label in labels)])
        for key, values in in_words(story.differences).items()
    )
    text = "These runs differ in more than the controller:"
    return f"<div class=warning><p>{text}</p>{_table(['key', *labels], rows)}</div>"


def _numbers(frame: pd.DataFrame) -> str:
    rows = (
        [f"<b>{html(cell.replace('*', ''))}</b>" if "*" in cell else html(cell) for cell in row]
        for row in cells(frame)
    )
    note = (
        "<p><small>Bold: smallest of its row. In brackets: ratio to the first run. A dash: not "
        "defined, or the run did not finish.</small></p>"
    )
    return _table(["metric", "unit", *map(str, frame.columns)], rows, numeric_from=2) + note


def _claims(verdicts: Sequence[Verdict]) -> str:
    if not verdicts:
        return ""
    rows = []
    for v in verdicts:
        remark = f"<br><small>{html(v.claim.remark)}</small>" if v.claim.remark else ""
        says = f"{html(v.claim.says)} <small>({html(v.claim.source)})</small>{remark}"
        mark = f"<b class='{v.answer.split()[0]}'>{v.answer}</b>"
        put = f"<code>{html(v.claim.expect)}</code>, tolerance {v.claim.tolerance:g}"
        rows.append([html(v.name), says, mark, f"{put}<br>{html(v.shown())}"])
    return "<h2>Claims</h2>" + _table(("", "claim", "verdict", "put as, and the numbers"), rows)


def _noticed(findings: Sequence[Finding]) -> str:
    if not findings:
        return ""
    note = (
        "<p><small>About the runs that this comparison made, before and after them: what to know, "
        "no errors. No run is named where it is true of all.</small></p>"
    )
    rows = ([f"<code>{f.code}</code>", *map(html, (f.place, f.text))] for f in findings)
    return "<h2>Noticed</h2>" + _table(("code", "where", "finding"), rows) + note


def _stability(theories: Mapping[str, Mapping[str, Any]]) -> str:
    if not theories:
        return ""
    note = (
        "<p><small>V' &le; -2 lambda V + Delta, so V ends below Delta/(2 lambda), the bound; its "
        "constants are the largest of this very run, so it is no prediction. None: lambda is not "
        "positive, or control is sampled. Term by term: theory.json.</small></p>"
    )
    rows = (map(html, row) for row in stability.rows(theories))
    return "<h2>Stability (46)-(49)</h2>" + _table(stability.HEAD, rows) + note


def _figure(name: str, caption: str, svg: bytes) -> str:
    # As data rather than inline markup: the figures' internal names would collide in one page.
    data = base64.b64encode(svg).decode()
    text = html(f"{name}: {caption}")
    image = f'<img alt="{html(name)}" src="data:image/svg+xml;base64,{data}">'
    return f"<figure>{image}<figcaption>{text}</figcaption></figure>"


def _scenario(story: Story) -> str:
    parts: dict[str, Component] = {name: getattr(story.scenario, name) for name in SECTIONS}
    parts |= {f"controller {label}": part for label, part in story.controllers.items()}
    rows = ([f"<b>{html(name)}</b>", _in_words(part)] for name, part in parts.items())
    return _table(("", ""), rows)


def _in_words(part: Component) -> str:
    said = (inspect.getdoc(type(part)) or "").partition("\n")[0]
    values = ", ".join(f"{key} {in_short(value)}" for key, value in flat(part.model_dump()))
    told = re.sub(r"`([^`]+)`", r"<code>\1</code>", html(said))
    return f"{told}<br><small>{html(values)}</small>"
