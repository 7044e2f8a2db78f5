"""What a shell completes after an option or as an argument: keys, kinds, figures, names.

A shell asks at every Tab, so each function imports what it needs itself. What installed packages
and the files after `--plugin` offer is completed too; a scenario's own plug-ins are not, since that
would run them at every Tab.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from collections.abc import Mapping

    from podusv_cli.core.plugins import Plugins

Offered = list[tuple[str, str]]


def starting_points(incomplete: str) -> Offered:
    """Names that `podusv init` takes."""
    from podusv_cli.workflows.init import starting_points

    return _beginning(incomplete, starting_points())


def pages(incomplete: str) -> Offered:
    """Pages of `podusv docs`."""
    from podusv_cli.workflows.docs import contents

    titles = {name: title for part in contents().values() for name, title in part.items()}
    return _beginning(incomplete, titles)


def parts(incomplete: str) -> Offered:
    """What `podusv new` writes."""
    from podusv_cli.workflows.new import PARTS

    return _beginning(incomplete, dict.fromkeys(PARTS, ""))


def keys(context: typer.Context, incomplete: str) -> Offered:
    """`controller.k_ze=` for `--set`; after the equals sign the words that the value may be."""
    from podusv_cli.scenario.explain import assignments

    return _beginning(incomplete, assignments(_plugins(context)))


def exports(incomplete: str) -> Offered:
    """Formats of `podusv sweep export`."""
    return _beginning(incomplete, {"csv": "text", "parquet": "needs pyarrow"})


def laws(context: typer.Context, incomplete: str) -> Offered:
    """The laws of the study that is named before."""
    import json
    from pathlib import Path

    try:
        told = json.loads((Path(context.params["study"]) / "study.json").read_text())
        return _beginning(incomplete, dict.fromkeys(map(str, told["laws"]), ""))
    except (KeyError, TypeError, OSError, ValueError):
        return []  # no study, or none that can be read: there is no place for a message


def figures(context: typer.Context, incomplete: str) -> Offered:
    """Names of figures."""
    from podusv_cli.figures.drawing import figures_with

    known = figures_with(_plugins(context))
    return _beginning(incomplete, {name: sheet.caption for name, sheet in known.items()})


def metrics(context: typer.Context, incomplete: str) -> Offered:
    """Names of metrics."""
    from podusv_cli.metrics.table import metrics_with

    known = metrics_with(_plugins(context))
    return _beginning(incomplete, {name: metric.meaning for name, metric in known.items()})


def listed(context: typer.Context, incomplete: str) -> Offered:
    """Parts of `podusv list`."""
    from podusv_cli.cli.list import parts

    found = (word for part in parts(_plugins(context)) for word in part.words)
    return _beginning(incomplete, dict.fromkeys(found, ""))


def names(context: typer.Context, incomplete: str) -> Offered:
    """What `podusv explain` explains: keys, kinds, signals, presets, metrics, findings."""
    from podusv_cli.findings.finding import finding_kinds
    from podusv_cli.metrics.table import metrics_with
    from podusv_cli.scenario.explain import names

    plugins = _plugins(context)
    found = dict.fromkeys(names(plugins), "")
    found |= {name: metric.meaning for name, metric in metrics_with(plugins).items()}
    found |= {name: finding.meaning for name, finding in finding_kinds(plugins).items()}
    return _beginning(incomplete, found)


def _plugins(context: typer.Context) -> Plugins:
    """Those on the line and installed ones; none where one of them cannot be loaded.

    A shell has no place for a message; the command itself will tell.
    """
    from podusv_cli.core.errors import PodusvError
    from podusv_cli.scenario.model import scenario_class
    from podusv_cli.scenario.plugins import on_hand

    try:
        plugins = on_hand(context.params.get("plugin") or ())
        scenario_class(plugins)
    except PodusvError:
        return ()
    return plugins


def _beginning(incomplete: str, known: Mapping[str, str]) -> Offered:
    return [item for item in known.items() if item[0].startswith(incomplete)]
