"""`podusv widest`: which of several finished runs was farthest east or west."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import podusv


def widest(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Folders of runs.")],
) -> None:
    """Say which of finished runs got farthest east or west."""
    reached = {folder: podusv.open_run(folder).metrics["largest_east"] for folder in runs}
    folder = max(reached, key=lambda each: reached[each])
    typer.echo(f"{folder}: {reached[folder]:.3f} m")
