"""`podusv export`: a law out of the simulator."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from podusv_cli.cli import options
from podusv_cli.cli.terminal import echo, echo_path

DIFFERS = 3


def export(
    config: Annotated[
        str,
        typer.Argument(
            metavar="CONFIG|FOLDER",
            help="The scenario, a YAML file or podusv:NAME.yaml; with --check, an exported law.",
        ),
    ],
    assign: options.Assignments = None,
    to: Annotated[
        Path | None, typer.Option(help="Folder for the law.", show_default="<config>-law")
    ] = None,
    controller: Annotated[
        str, typer.Option(metavar="NAME", help="Which of `controllers`.", show_default=False)
    ] = "",
    with_c: Annotated[
        bool, typer.Option("--c/--no-c", help="law.h, law.c and object files.")
    ] = True,
    with_fmu: Annotated[
        bool, typer.Option("--fmu/--no-fmu", help="law.fmu, an FMI 2.0 unit for co-simulation.")
    ] = True,
    platform: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="For this platform; repeatable.",
            show_default="all for C, this machine for the FMU",
        ),
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Step an exported law beside podusv's own run.")
    ] = False,
    trust: options.Trust = False,
    force: options.Force = False,
    quiet: options.Quiet = False,
    plugin: options.Plugins = None,
) -> None:
    """Write the law of a scenario as C and as an FMU, to be used without podusv.

    The scenario has to sample its law (`control.period`). check.csv has every sample of a run; with
    --check --trust the law is stepped through it, and exit code 3 says that a bit differs. That
    executes the code in the folder.
    """
    if check:
        _check(Path(config), trusted=trust)
        return
    from podusv_cli.workflows import export as workflow  # heavy imports only when needed
    from podusv_cli.workflows.request import Request

    def say(text: str) -> None:
        if not quiet:
            echo(text, err=True)

    request = Request(
        assign or (),
        to,
        force=force,
        argv=sys.argv,
        plugins=plugin or (),
        trust=trust,
        controller=controller,
        say=say,
    )
    products = workflow.Products(with_c, with_fmu, platform or ())
    done = workflow.export(Path(config), request, products)
    echo_path(done)
    if not quiet:
        echo(f"check it: podusv export --check --trust {done}", err=True)


def _check(folder: Path, *, trusted: bool) -> None:
    """Compare an exported law with its samples, and exit with 0 or `DIFFERS`."""
    from podusv_cli.export.check import check  # heavy imports only when needed

    results = check(folder, trusted=trusted)
    for result in results:
        same = f"{result.samples} samples with the bits of {result.whose}"
        echo(f"{result.what}: {result.differs or same}")
    raise typer.Exit(DIFFERS if any(result.differs for result in results) else 0)
