"""What a shell completes after an option or as an argument: keys, kinds, figures, names.

A shell asks at every Tab, so each function imports what it needs itself.
"""

from __future__ import annotations


def starting_points(incomplete: str) -> list[tuple[str, str]]:
    """Names that `podusv init` takes."""
    from podusv_cli.workflows.init import starting_points

    return [item for item in starting_points().items() if item[0].startswith(incomplete)]


def keys(incomplete: str) -> list[tuple[str, str]]:
    """`controller.k_ze=` for `--set`; after the equals sign the words that the value may be."""
    from podusv_cli.scenario.explain import assignments

    return [item for item in assignments().items() if item[0].startswith(incomplete)]


def figures(incomplete: str) -> list[tuple[str, str]]:
    """Names of figures."""
    from podusv_cli.figures.drawing import FIGURES

    return [(n, sheet.caption) for n, sheet in FIGURES.items() if n.startswith(incomplete)]


def names(incomplete: str) -> list[tuple[str, str]]:
    """What `podusv explain` explains: keys, kinds, signals, presets, metrics, findings."""
    from podusv_cli.findings.finding import finding_kinds
    from podusv_cli.metrics.table import METRICS
    from podusv_cli.scenario.explain import names

    found = dict.fromkeys(names(), "")
    found |= {name: metric.meaning for name, metric in METRICS.items()}
    found |= {name: finding.meaning for name, finding in finding_kinds().items()}
    return [item for item in found.items() if item[0].startswith(incomplete)]
