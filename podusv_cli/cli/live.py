"""`podusv live`: a page in the browser whose sliders move a scenario's values."""

from __future__ import annotations

import gc
import sys
from functools import partial
from typing import Annotated

import typer

from podusv_cli.cli import options
from podusv_cli.cli.demo import SCENARIO
from podusv_cli.cli.terminal import echo
from podusv_cli.core.system import has_display


def live(
    config: Annotated[
        str, typer.Argument(metavar="CONFIG", help="The scenario; without it, that of the demo.")
    ] = SCENARIO,
    assign: options.Assignments = None,
    controller: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Of `controllers`, to be shown; repeatable."),
    ] = None,
    trust: options.Trust = False,
    plugin: options.Plugins = None,
    port: Annotated[int, typer.Option(min=0, help="Port; 0: any that is free.")] = 0,
    browser: Annotated[
        bool, typer.Option("--open/--no-open", help="Open the page in a browser.")
    ] = True,
) -> None:
    """Move gains, hull, sea and start on a page that simulates as you move; Ctrl-C ends it.

    Only this machine can reach the page, and only with the address that is printed.
    """
    from podusv_cli.comparison.live_page import live_page
    from podusv_cli.process.local_page import serve
    from podusv_cli.workflows.live import Live

    shown = Live(config, assign or (), controller or (), trust, plugin or ())
    shown.frame({}, (), rest=True, wanted=True)  # errors are for the terminal, and code is compiled

    # A command is over before its garbage counts; this one stays, and looks through none of what is
    # imported.
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000)

    def print_address(address: str) -> None:
        """Print the page's address, and open it where there is a display."""
        import webbrowser

        opened = browser and has_display() and webbrowser.open(address)
        echo(f"{'opened' if opened else 'open in a browser:'} {address}", "Ctrl-C ends it")
        sys.stdout.flush()

    serve(partial(live_page, config), shown.answer, print_address, port)
