"""Margins of a closed loop at the plant's input: of surge, sway and yaw, and of all together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from podusv_cli.core.errors import LawError
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.theory.course import course
from podusv_cli.theory.margins import Complex, Cut, Margins, delay_margin, margins, poles, stable
from podusv_cli.theory.steady import Linear, linearise

AXES = {"surge": "u", "sway": "v", "yaw": "r"}  # with the letters that their numbers end in
NUMBERS = ("phase_margin", "gain_margin", "gain_reduction", "delay_margin", "peak_S", "peak_T")


@dataclass(frozen=True)
class LoopMargins:
    """Margins of the loops of surge, of sway where the law asks for a force there, and of yaw.

    Each loop is opened at the plant's input while the others are closed. `delay_margin` [s] is for
    one delay of all of the law's demands, as `actuator.command.delay` is, `delay_margin_loads` [s]
    for one of all loads, behind the actuator. `left_out` says what of the scenario the loop is
    without.
    """

    linear: Linear
    loops: dict[str, Margins]
    delay_margin: float
    delay_margin_loads: float
    left_out: tuple[str, ...]

    @property
    def poles(self) -> Complex:
        """The poles of the closed loop [1/s], the slowest to decay first."""
        return poles(self.linear.A)

    @property
    def stable(self) -> bool:
        """Whether the closed loop comes back to its steady motion."""
        return stable(self.linear.A)

    @property
    def decay_rate(self) -> float:
        """The distance of the slowest pole from the imaginary axis [1/s]; negative if unstable."""
        return -float(self.poles.real.max())

    @property
    def open(self) -> tuple[str, ...]:
        """The loops that are open: what acts on the hull does not answer its motion."""
        rows = zip(self.loops, self.linear.C, strict=True)
        return tuple(axis for axis, row in rows if not row.any())

    def numbers(self) -> dict[str, float]:
        """The margins by the names that claims have for them (`metrics.margins`)."""
        by_name = {
            f"{name}_{AXES[axis]}": float(getattr(loop, name))
            for axis, loop in self.loops.items()
            for name in NUMBERS
        }
        together = ("delay_margin", "delay_margin_loads", "decay_rate")
        return by_name | {name: float(getattr(self, name)) for name in together}


def loop_margins(
    loop: ClosedLoop, grid: TimeGrid, at: float | None = None, *, compiled: bool = True
) -> LoopMargins:
    """The margins of a loop about its steady motion at a time [s] of a run over this grid.

    Without a time, at the last one at which the target goes straight on or in a circle. Raises
    LawError for a law that takes samples, and NotConvergedError where there is no steady motion.
    """
    law = loop.controller
    if law.takes_samples():
        raise LawError(
            f"{law.noun} {law.label}: it takes samples, and margins are those of a law that acts "
            "continuously; set controller.rate=analytic and controller.hold_below=0 where it has "
            "these keys, or choose another law"
        )
    if law.keeps_path_time():
        raise LawError(
            f"{law.noun} {law.label}: its target moves as the law wants, and margins are those of "
            "a law that follows a target with a timetable; choose pose_backstepping"
        )
    if loop.path.follows:
        raise LawError(
            f"{loop.path.noun} {loop.path.label}: its target moves with the vessel, and margins "
            "are those of a law that follows a target with a timetable; take one, as with "
            f"--set path.kind={'hold' if loop.path.heads else 'line'}"
        )
    along = course(loop.path, grid.steps * grid.step, at)
    if along.turn and law.wants_heading():
        raise LawError(
            f"{law.noun} {law.label}: its target goes in a circle, and margins of a law that wants "
            "a heading are those of a pose that stays; take one, as with --set path.kind=hold"
        )
    linear = linearise(loop, along, grid.step, compiled=compiled)
    axes = [axis for axis, letter in AXES.items() if f"tau_{letter}" in linear.loads]
    # One loop is cut while the others are closed: a column of B and a row of C
    cuts = {axis: Cut(linear.A, linear.B[:, [i]], linear.C[[i]]) for i, axis in enumerate(axes)}
    return LoopMargins(
        linear,
        {axis: margins(cut) for axis, cut in cuts.items()},
        delay_margin(Cut(linear.A, linear.B_command, linear.C_command)),
        delay_margin(Cut(linear.A, linear.B, linear.C)),
        tuple(_left_out(loop, grid, linear)),
    )


def _left_out(loop: ClosedLoop, grid: TimeGrid, linear: Linear) -> Iterator[str]:
    """What of the loop its linear model leaves out, in words for the user."""
    if loop.measured:
        yield "measurement and estimator"
    if loop.controller.wants_load_estimate():
        yield "the feedforward of the estimated load"
    if grid.hold_every:
        yield f"the sampling of the law every {grid.hold_every * grid.step:g} s"
    if loop.actuator.delay():
        yield f"the command's delay of {loop.actuator.delay():g} s"
    if linear.course.turn and not loop.disturbance.of_time:
        yield "what the load does as the vessel turns with the circle"
