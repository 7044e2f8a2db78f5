"""`podusv margins`: phase, gain and delay margins of a scenario's laws."""

from __future__ import annotations

import math
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli import options
from podusv_cli.cli.terminal import Warnings, echo, echo_entry, echo_json, echo_table

if TYPE_CHECKING:
    from podusv_cli.theory.loop_margins import LoopMargins
    from podusv_cli.workflows.margins import MarginsOfLaws

SOME_FAILED = 3
STILL = 1e-12  # m/s, rad/s; what is slower is rounding
FLAT = 1e-6  # of a pole's magnitude; an imaginary part up to this is rounding
HEAD = [
    "law",
    "loop",
    "crossover [rad/s]",
    "phase [rad]",
    "gain",
    "reduction",
    "delay [s]",
    "peak |S|",
    "peak |T|",
]


def margins(
    config: options.Config,
    assign: options.Assignments = None,
    at: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            min=0.0,
            help="When the steady motion begins.",
            show_default="the last time on a straight line, or on a circle",
        ),
    ] = None,
    controller: Annotated[
        str, typer.Option(metavar="NAME", help="Only this of `controllers`.", show_default=False)
    ] = "",
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for margins, poles and figure.", show_default="none is written"),
    ] = None,
    force: options.Force = False,
    form: Annotated[
        str, typer.Option("--format", help="Of the figure: png, pdf, svg; several with commas.")
    ] = "png",
    as_json: options.AsJson = False,
    trust: options.Trust = False,
    plugin: options.Plugins = None,
) -> None:
    """Tell how much phase, gain and delay the loops of a scenario's laws can take.

    The closed loop is linearised about its steady motion on the path, and opened at the plant's
    input in surge, in sway where the law asks for a force there, and in yaw. Exit code 3 when some
    laws have no margins, or none of one has a steady motion.
    """
    from podusv_cli.workflows import margins as workflow  # heavy imports only when needed
    from podusv_cli.workflows.request import Request

    formats = [name.strip() for name in form.split(",")]
    request = Request(
        assign or (),
        out,
        force=force,
        argv=sys.argv,
        plugins=plugin or (),
        trust=trust,
        controller=controller,
        formats=formats,
        warn=Warnings(),
    )
    result = workflow.margins(Path(config), request, at)
    if as_json:
        echo_json(result.as_json())
    else:
        _report(result)
    for label, why in result.failed.items():
        echo(f"{label}: {why}", err=True)
    raise typer.Exit(SOME_FAILED if result.failed else 0)


def _report(result: MarginsOfLaws) -> None:
    """Print the motion, poles and margins of each law."""
    for label, law in result.laws.items():
        echo_entry(label, _motion(law), *_remarks(law), f"poles [1/s]: {_poles(law)}")
    echo_table(HEAD, [row for label, law in result.laws.items() for row in _rows(label, law)])
    if result.folder:
        echo(f"written to {result.folder}")


def _motion(law: LoopMargins) -> str:
    """The steady motion about which the loop is linear, in one line with units."""
    linear, course = law.linear, law.linear.course
    u, v, r = (x if abs(x) > STILL else 0.0 for x in linear.motion)
    b_u, b_v, b_r = linear.load
    way = f"turning at {course.turn:.4g} rad/s" if course.turn else "straight on"
    going = f"{way} at {course.speed:.4g} m/s" if course.speed else "staying"
    return (
        f"{going} from t = {course.time:.4g} s on; u {u:.4g} m/s, "
        f"v {v:.4g} m/s, r {r:.4g} rad/s, z_e {linear.distance:.4g} m; held load {b_u:.4g} N, "
        f"{b_v:.4g} N, {b_r:.4g} N m"
    )


def _remarks(law: LoopMargins) -> list[str]:
    """What was left out, where the loop is open or singular, and whether it is unstable."""
    said = [f"without {what}" for what in law.left_out]
    said += [f"the {axis} loop is open: the load does not answer the motion" for axis in law.open]
    if law.linear.singular:
        said.append(
            f"the target is {law.linear.distance:.2g} m away, and its direction singular at 0: the "
            f"margins hold for moves of {law.linear.reach:g} m or less"
        )
    return said if law.stable else [*said, "unstable, so there are no margins"]


def _poles(law: LoopMargins) -> str:
    """Poles, the slowest first; conjugate ones once, equal ones with their number."""
    words = Counter(
        f"{pole.real:.4g}" + (f" +- {pole.imag:.4g}j" if pole.imag > FLAT * abs(pole) else "")
        for pole in law.poles
        if pole.imag >= -FLAT * abs(pole)
    )
    return ", ".join(
        f"{pole} ({count} times)" if count > 1 else pole for pole, count in words.items()
    )


def _rows(label: str, law: LoopMargins) -> list[list[str]]:
    """Table rows of a law: margins of each load's loop, then those of all loops together."""
    from podusv_cli.theory.loop_margins import NUMBERS

    rows = []
    for axis, loop in law.loops.items():
        crossed = ", ".join(f"{omega:.4g}" for omega in loop.crossovers) or "-"
        phase = f"{loop.phase_margin:.4g} ({math.degrees(loop.phase_margin):.1f} deg)"
        known = phase if math.isfinite(loop.phase_margin) else _format_margin(loop.phase_margin)
        # The phase is the first of them, and printed in degrees as well.
        numbers = [_format_margin(getattr(loop, name)) for name in NUMBERS[1:]]
        rows.append([label, f"{axis} load", crossed, known, *numbers])
    every = "both" if len(law.loops) == 2 else "all"
    together = {f"{every} demands": law.delay_margin, f"{every} loads": law.delay_margin_loads}
    more = [
        [label, what, *[""] * 4, _format_margin(delay), "", ""] for what, delay in together.items()
    ]
    return [*rows, *more]


def _format_margin(number: float) -> str:
    """A margin; - where the loop has none."""
    return "-" if math.isnan(number) else f"{number:.4g}"
