"""`podusv validate`: is a scenario sound, and where does every value come from."""

from __future__ import annotations

from typing import Annotated

import typer

from podusv_cli.cli.options import Assignments, Config


def validate(
    config: Config,
    assign: Assignments = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Show every value and where it comes from.")
    ] = False,
) -> None:
    """Check a scenario and show every fault at once.

    Exit code 0, or 2 with a line for each fault.
    """
    from podusv_cli.comparison.claims import misfits
    from podusv_cli.config.loading import load, values
    from podusv_cli.config.words import as_written

    loaded = load(config, assign or (), checks=(misfits,))
    scenario = loaded.scenario
    laws, steps = ", ".join(scenario.labels()), scenario.time_grid().steps
    typer.echo(f"{config}: ok ({scenario.name}, {laws}, {steps} steps)")
    if verbose:
        for key, content in values(scenario).items():
            typer.echo(f"{key}: {as_written(content)}  # {loaded.origins[key]}")
