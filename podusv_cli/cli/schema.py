"""`podusv schema`: the JSON schema of a scenario file."""

from __future__ import annotations

import typer

from podusv_cli.cli.options import Plugins


def schema(plugin: Plugins = None) -> None:
    """Print the JSON schema of scenarios, for editors.

    Components of installed packages are in it, and those of plug-in files that are given.
    """
    from podusv_cli.findings.finding import finding_kinds
    from podusv_cli.scenario.plugins import on_hand
    from podusv_cli.scenario.schema import schema_text

    plugins = on_hand(plugin or ())
    typer.echo(schema_text(tuple(finding_kinds(plugins)), plugins), nl=False)
