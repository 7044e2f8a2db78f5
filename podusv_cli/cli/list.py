"""`podusv list`: what there is to choose from."""

from __future__ import annotations

from podusv_cli.cli.terminal import echo, echo_entry


def list() -> None:
    """List the kinds of components, vessels, sets of pods, metrics and findings.

    `podusv explain NAME` tells more about each.
    """
    from podusv_cli.core.finding_codes import CODES
    from podusv_cli.metrics.table import METRICS
    from podusv_cli.scenario.explain import first_sentence, kinds
    from podusv_cli.scenario.presets import pod_names, pod_text, vessel_names, vessel_text

    for section, summaries in kinds().items():
        echo(f"{section}:")
        for kind, summary in summaries.items():
            echo_entry(f"  {kind}", summary)
    echo("vessel:")
    for name in vessel_names():
        echo_entry(f"  {name}", first_sentence(vessel_text(name, "source")))
    echo("pods (actuator.preset):")
    for name in pod_names():
        echo_entry(f"  {name}", first_sentence(pod_text(name, "source")))
    echo("metrics:")
    for name, metric in METRICS.items():
        echo_entry(f"  {name}", metric.meaning, facts=f"[{metric.unit}]")
    echo("findings:")
    for name, code in CODES.items():
        echo_entry(f"  {name}", code.meaning)
