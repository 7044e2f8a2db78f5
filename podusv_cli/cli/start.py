"""`podusv start`: a scenario for a boat that is known by its dimensions."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from podusv_cli.cli.terminal import echo

ASKED = {
    "length": "Length [m]",
    "beam": "Beam over all [m]",
    "mass": "Mass with all that is on board [kg]",
    "thrusters": "Thrusters, as 2x180N@1.0: number, largest thrust, distance from the centre line",
}


def start(
    name: Annotated[str, typer.Argument(help="What the boat is called; the file is NAME.yaml.")],
    length: Annotated[
        str, typer.Option(help="Length, as 4.9 or 16ft.", show_default="asked for")
    ] = "",
    beam: Annotated[str, typer.Option(help="Beam over all.", show_default="asked for")] = "",
    mass: Annotated[
        str, typer.Option(help="Mass, as 180 or 400lb.", show_default="asked for")
    ] = "",
    thrusters: Annotated[
        str,
        typer.Option(
            metavar="NxFORCE@LEVER",
            help="As 2x180N@1.0: number, largest thrust of each, distance from the centre line.",
            show_default="asked for",
        ),
    ] = "",
    hulls: Annotated[
        int | None,
        typer.Option(min=1, max=2, help="1, or 2 of a catamaran.", show_default="1, or asked for"),
    ] = None,
    hull_beam: Annotated[
        str,
        typer.Option(help="Beam of one hull of a catamaran.", show_default="a tenth of the length"),
    ] = "",
    speed: Annotated[
        str,
        typer.Option(help="Top speed at full thrust, as 5kn.", show_default="Froude number 0.4"),
    ] = "",
    turn: Annotated[
        str, typer.Option(help="How far thrusters turn, as 35deg.", show_default="they are fixed")
    ] = "",
    preset: Annotated[
        str, typer.Option(metavar="NAME", help="A vessel of podusv in place of dimensions.")
    ] = "",
    route: Annotated[
        str,
        typer.Option(
            metavar="FILE",
            help="Waypoints: .plan, .waypoints, GPX, KML, GeoJSON, MOOS points, CSV of lat,lon.",
            show_default="four, at right angles",
        ),
    ] = "",
    out: Annotated[
        Path | None, typer.Option(help="File to write.", show_default="NAME.yaml in this folder")
    ] = None,
) -> None:
    """Write a scenario for your boat: hull, thrusters, legs, two laws, and what is not known.

    Inertia and damping are estimated from length, beam and mass by published formulas, and marked
    so; `podusv sweep run` and `podusv doubt` vary them by the errors that the formulas have. What
    is not given is asked for on a terminal.
    """
    from podusv_cli.core.errors import UsageError
    from podusv_cli.workflows import start as workflow  # heavy imports only when needed

    file = out or Path(f"{name.removesuffix('.yaml')}.yaml")
    given = {"length": length, "beam": beam, "mass": mass, "thrusters": thrusters}
    if preset:
        if any((*given.values(), hulls, hull_beam, speed, turn)):
            raise UsageError("--preset has hull and thrusters; leave the dimensions out")
        written = workflow.start_from(preset, file, route)
    else:
        lacking = [f"--{option}" for option, text in given.items() if not text]
        if lacking and not sys.stdin.isatty():
            raise UsageError(f"give {', '.join(lacking)}, or --preset")
        asked = {option: text or typer.prompt(ASKED[option]) for option, text in given.items()}
        if lacking and hulls is None:
            hulls = typer.prompt("Hulls: 1, or 2 of a catamaran", default=1, type=int)
        boat = workflow.Boat(**asked, hulls=hulls or 1, hull_beam=hull_beam, speed=speed, turn=turn)
        written = workflow.start(boat, file, route)
    echo(f"wrote {written}")
    echo(f"next: podusv compare {written}")
    if not preset:
        echo(f"then: podusv sweep run {written} (how much depends on the estimates)")
