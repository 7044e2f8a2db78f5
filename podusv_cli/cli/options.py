"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from podusv_cli.cli import completion

Config = Annotated[
    str, typer.Argument(metavar="CONFIG", help="The scenario, a YAML file or podusv:NAME.yaml.")
]
Assignments = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace a value of the scenario; repeatable.",
        autocompletion=completion.keys,
    ),
]
Plugins = Annotated[
    list[str] | None,
    typer.Option(
        "--plugin", metavar="FILE", help="A Python file with components of your own; repeatable."
    ),
]
Trust = Annotated[bool, typer.Option("--trust", help="Execute code that a folder brings along.")]
Out = Annotated[
    Path | None,
    typer.Option(help="Folder for the results.", show_default="results/<name>/<time>-<digest>"),
]
Force = Annotated[bool, typer.Option("--force", help="Replace finished results.")]
Figures = Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the results.")]
Figure = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        help="What to draw, or `all`; repeatable.",
        show_default="trajectory, errors",
        autocompletion=completion.figures,
    ),
]
Workers = Annotated[
    int, typer.Option(min=0, help="Processes at a time.", show_default="one a core")
]
Scheduler = Annotated[
    str, typer.Option(help="Dask scheduler whose workers compute, as tcp://host:8786.")
]
AllowLarge = Annotated[
    bool, typer.Option("--allow-large", help="Also more than 1e8 steps, a log above 4 GB.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print the results' folder only.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print where the time went.")]
