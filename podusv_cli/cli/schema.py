"""`podusv schema`: the JSON schema of a scenario file."""

from __future__ import annotations

import typer


def schema() -> None:
    """Print the JSON schema of scenarios, for editors."""
    from podusv_cli.findings.finding import finding_kinds
    from podusv_cli.scenario.schema import schema_text

    typer.echo(schema_text(tuple(finding_kinds())), nl=False)
