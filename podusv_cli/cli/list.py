"""`podusv list`: the kinds, presets, metrics, figures and findings."""

from __future__ import annotations

from podusv_cli.cli.options import Plugins
from podusv_cli.cli.terminal import echo, echo_entry


def list(plugin: Plugins = None) -> None:
    """List the kinds of components, the presets, the metrics, the figures and the findings.

    `podusv explain NAME` tells more about each.
    """
    from podusv_cli.figures.drawing import figures_with
    from podusv_cli.findings.finding import finding_kinds
    from podusv_cli.metrics.table import metrics_with
    from podusv_cli.scenario.explain import first_sentence, kinds
    from podusv_cli.scenario.plugins import on_hand
    from podusv_cli.scenario.presets import preset_names, preset_text, with_presets

    plugins = on_hand(plugin or ())
    for section, summaries in kinds(plugins).items():
        echo(f"{section}:")
        for kind, summary in summaries.items():
            echo_entry(f"  {kind}", summary)
    for key, (_, presets) in with_presets().items():
        echo(f"{key} (preset, a {presets.noun}):")
        for name in preset_names(presets, plugins):
            echo_entry(f"  {name}", first_sentence(preset_text(presets, name, "source", plugins)))
    echo("metrics:")
    for name, metric in metrics_with(plugins).items():
        echo_entry(f"  {name}", metric.meaning, facts=f"[{metric.unit}]")
    echo("figures:")
    for name, sheet in figures_with(plugins).items():
        echo_entry(f"  {name}", sheet.caption)
    echo("findings (silence):")
    for name, finding in finding_kinds(plugins).items():
        echo_entry(f"  {name}", finding.meaning, facts=f"{finding.when} a run, {finding.about}")
