"""`podusv explain`: the meaning of keys, signals, metrics, presets and findings."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli.completion import names
from podusv_cli.cli.options import Plugins
from podusv_cli.cli.terminal import echo, echo_entry

if TYPE_CHECKING:
    from podusv_cli.core.finding import FindingKind
    from podusv_cli.core.plugins import Plugins as Known
    from podusv_cli.scenario.explain import ExplainRow

BEGIN = (
    "to begin with: podusv explain vessel, path, disturbance, actuator or controller; "
    "then controller.pid, and controller.K_Pu"
)
EQUATION = re.compile(r"\(\d+\)")


def explain(
    key: Annotated[
        str | None,
        typer.Argument(
            metavar="KEY",
            help="A section (controller), a kind (controller.pid), a key (controller.k_ze or k_ze) "
            "a signal (z_e), a metric (iae), a preset (otter), a finding (near-target) or a figure "
            "(errors).",
            show_default=False,
            autocompletion=names,
        ),
    ] = None,
    plugin: Plugins = None,
) -> None:
    """Explain keys, kinds, signals, metrics, presets, findings and figures in words.

    Without a key: the sections of a scenario.
    """
    from podusv_cli.findings.finding import finding_kinds
    from podusv_cli.metrics.table import metrics_with
    from podusv_cli.metrics.windows import find
    from podusv_cli.scenario.explain import UnknownKeyError
    from podusv_cli.scenario.explain import explain as rows
    from podusv_cli.scenario.plugins import on_hand

    plugins = on_hand(plugin or ())
    findings, metrics = finding_kinds(plugins), metrics_with(plugins)
    if key in findings:
        _echo_finding(findings[key])
    elif metric := find(key or "", metrics):
        window = "up to the end of a path that has one" if metric.ends_with_path else ""
        echo_entry(key or "", metric.meaning, window, facts=f"metric [{metric.unit}]")
    else:
        try:
            explained = rows(key, (*findings, *metrics), plugins)
        # Figures come last, as matplotlib is slow to import.
        except UnknownKeyError:
            if not _echo_figure(key, plugins):
                raise
            return
        if key is None:
            echo(BEGIN)
        for row in explained:
            _echo(row)
        if any(EQUATION.search(row.meaning) for row in explained):
            echo("", "(n) is equation n of the paper that podusv docs model cites")


def _echo_figure(name: str | None, plugins: Known) -> bool:
    """Explain the figure of this name; False if there is none."""
    from podusv_cli.figures.drawing import figures_with  # slow, and hardly anybody asks for one

    sheet = figures_with(plugins).get(name or "")
    if sheet:
        echo_entry(sheet.name, sheet.caption, f"shows {', '.join(sheet.signals)}", facts="figure")
    return sheet is not None


def _echo_finding(kind: FindingKind) -> None:
    """Print what a finding says, when it does, and what to do."""
    condition = f"condition: {kind.condition}" if kind.condition else ""
    remedy = f"remedy: {kind.remedy}" if kind.remedy else ""
    facts = f"finding {kind.when} a run, {kind.about}"
    echo_entry(kind.name, kind.meaning, condition, remedy, facts=facts)


def _echo(row: ExplainRow) -> None:
    """Print a key's row: meaning, type, unit, range and default, or the keys in it."""
    where = f"in {', '.join(row.kinds)}" if row.kinds else ""
    if row.type in ("keys", "kinds"):
        inside = f"{row.type}: {', '.join(row.choices)}" if row.choices else ""
        echo_entry(row.key, row.meaning, inside, where)
        return
    default = row.default if row.default in ("", "required") else f"default {row.default}"
    echo_entry(row.key, row.meaning, where, facts=", ".join(filter(None, (row.value, default))))
