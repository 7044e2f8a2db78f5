"""Tables of bollard tests, commands and thrusts: read from a file, checked, made into curves."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from pydantic import model_validator

from podusv_cli.core.component import Component, value
from podusv_cli.core.kernel import Vector
from podusv_cli.core.phrases import quote
from podusv_cli.core.timed_rows import named_rows
from podusv_cli.core.units import units_allowed_for

NOISE = 0.02  # of the largest thrust: a table that falls by less was measured so
PULSES = (800.0, 2200.0)  # us, within which pulses of servos and speed controllers are
UNIT = re.compile(r"(.*?)\s*(?:[\[(]\s*(.*?)\s*[\])]|_(N|kN|kgf|gf|lbf|us|pct|rpm))")
COMMAND = re.compile(r"pwm|pulse|throttle|command|cmd|esc|n|n_part", re.IGNORECASE)
OF_PULSES = re.compile(r"pwm|pulse|servo|esc", re.IGNORECASE)
FORCE = re.compile(r"thrust|force", re.IGNORECASE)
MICRO = str.maketrans("µμ", "uu")
OF_FORCE = {unit: float(factor) for unit, factor in units_allowed_for("N").items()}
FORCES = {  # by unit in small letters, in N
    **{unit.lower(): factor for unit, factor in OF_FORCE.items()},
    "kg f": OF_FORCE["kgf"],
    "lb f": OF_FORCE["lbf"],
    "gf": 1e-3 * OF_FORCE["kgf"],
}
WEIGHTS = ("kg", "g", "lb", "lbs")


class PwmCommand(Component):
    """Pulses that command a thruster, as autopilots log them."""

    rest: float = value(1500.0, "us", "pulse at which it stands", ge=800, le=2200)
    span: float = value(
        400.0,
        "us",
        "from rest to full speed ahead and, the other way, astern; below 0 where a longer pulse "
        "drives it astern",
        ge=-1000,
        le=1000,
    )
    dead_band: tuple[float, float] | None = value(
        None, "us", "shortest and longest pulse at which it stands, as [1475, 1525]", strict=False
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        """Raises ValueError for a span of 0, and a dead band that is none about rest."""
        if abs(self.span) < 1.0:
            raise ValueError("has a span of 0 us; give that from rest to full speed, as 400")
        if self.dead_band:
            low, high = self.dead_band
            if not (
                self.rest - abs(self.span) < low <= self.rest <= high < self.rest + abs(self.span)
            ):
                raise ValueError(
                    f"has a dead_band from {low:g} to {high:g} us, which must lie about rest "
                    f"({self.rest:g} us) and within span"
                )
        return self

    def dead_ends(self) -> tuple[float, float]:
        """The ends of the dead band ahead and astern, in parts of full speed, both at least 0."""
        low, high = self.dead_band or (self.rest, self.rest)
        ends = sorted((edge - self.rest) / self.span for edge in (low, high))
        return ends[1], -ends[0]


def check_rows(rows: Vector) -> None:
    """Raises ValueError for rows (rows, 2) of n and thrust [N] that no propeller has."""
    n, thrusts = rows.T
    if len(rows) < 2:
        raise ValueError(f"has a table of {len(rows)} rows; it needs that of rest and one ahead")
    for i in range(1, len(rows)):
        if n[i] <= n[i - 1]:
            raise ValueError(
                f"has a table whose row {i + 1} has the command {n[i]:g} after {n[i - 1]:g}; "
                "commands must increase from row to row"
            )
        if thrusts[i] < thrusts[i - 1]:
            raise ValueError(
                f"has a table whose thrust falls from {thrusts[i - 1]:g} to {thrusts[i]:g} N in "
                f"row {i + 1}; thrust must not fall as the command rises, and is below 0 astern"
            )
    if not n[0] <= 0.0 < n[-1]:
        raise ValueError(
            f"has a table from n = {n[0]:g} to {n[-1]:g}; it must begin at rest (0) or astern and "
            "end ahead"
        )
    # Rest need not be a row: it may lie between two
    at_rest = float(np.interp(0.0, n, thrusts))
    if at_rest != 0.0:
        raise ValueError(
            f"has a table with a thrust of {at_rest:g} N at rest; give the row of rest, n = 0 and "
            "thrust 0, or change pwm.rest"
        )
    if not thrusts[-1] > 0.0:
        raise ValueError("has a table without thrust ahead; its last row must be above 0 N")


def curve_of(rows: Vector, side: float) -> Vector:
    """The rows (rows, 2) of one side, 1 ahead or -1 astern, as `thrust_curve` has a curve.

    Shape (1 + 2 count,), from rest on. A side without rows has a curve without thrust.
    """
    inside = rows[side * rows[:, 0] > 0.0][:: int(side)]
    n, thrusts = side * inside.T if len(inside) else np.array([[1.0], [0.0]])
    return np.concatenate([[1.0 + len(n)], [0.0], n, [0.0], thrusts])


def of_file(text: str, given: Collection[str]) -> tuple[dict[str, Any], list[str]]:
    """The keys of a pod that a table's text gives, and remarks for the user.

    `given` are keys that the scenario has for the pod. The first line names the columns, and in
    brackets their units. Raises ValueError.
    """
    read = named_rows(text, "the table")
    names = [_Column.of(name) for name in read.names]
    places = [_place_of(names, COMMAND, "command"), _place_of(names, FORCE, "thrust")]
    command, force = (names[i] for i in places)
    rows, remarks = read.rows[:, places], list[str]()
    if len(rows) > 1 and rows[0, 0] > rows[-1, 0]:  # a test that went down from full speed
        rows = rows[::-1]
    rows[:, 1] *= force.factor_of_force()
    if not force.unit:
        remarks.append("its thrust is taken in N; name another unit, as thrust [kgf]")
    pulses = command.has_pulses(rows[:, 0])
    if not pulses:
        rows[:, 0] *= command.factor_of_command()
    rows[:, 1] = _without_noise(rows[:, 1], remarks)
    values: dict[str, Any] = {"table": tuple(map(tuple, rows.tolist()))}
    if pulses:
        values |= {"table_in": "us"}
        if "pwm" not in given:
            values |= {"pwm": _pulses_of(rows)}
            remarks.append(
                "pwm follows from it: "
                + ", ".join(f"{n} {x:g} us" for n, x in values["pwm"].items())
            )
    return values, remarks


class _Column(NamedTuple):
    """Name and unit of a column, as its cell in the first line has them."""

    cell: str
    name: str
    unit: str

    @classmethod
    def of(cls, cell: str) -> Self:
        """The column of a cell of the header: its name, and behind it its unit, if any."""
        match = UNIT.fullmatch(cell.strip())
        unit = " ".join((match[2] or match[3] or "").split()) if match else ""
        return cls(cell, match[1].strip() if match else cell.strip(), unit)

    def has_pulses(self, commands: Vector) -> bool:
        """Whether it has pulses in us, by its unit or, without one, by name and size."""
        if self.unit:
            return self.unit.lower().translate(MICRO) == "us"
        sized = bool(np.all((commands >= PULSES[0]) & (commands <= PULSES[1])))
        return sized and bool(OF_PULSES.search(self.name))

    def factor_of_command(self) -> float:
        """What a command of 1 in the column's unit is in that of n. Raises ValueError."""
        known = {
            "": 1.0,
            "1": 1.0,
            "%": 0.01,
            "1/s": 1.0,
            "rpm": 1.0 / 60.0,
            "rps": 1.0,
            "pct": 0.01,
        }
        if self.unit.lower() not in known:
            raise ValueError(
                f"has commands in {quote(self.unit)}; allowed: us, {', '.join(filter(None, known))}"
            )
        return known[self.unit.lower()]

    def factor_of_force(self) -> float:
        """What a thrust of 1 in the column's unit is in N. Raises ValueError."""
        factor = FORCES.get(self.unit.lower() or "n")
        if factor is None:
            weight = "; write kgf for the weight of so many kg" if self.unit in WEIGHTS else ""
            raise ValueError(
                f"has thrusts in {quote(self.unit)}{weight} (allowed: N, kN, kgf, gf, lbf)"
            )
        return factor


def _place_of(names: Sequence[_Column], known: re.Pattern[str], what: str) -> int:
    """The position of the one among `names` that `known` matches; of two the first has commands.

    `what` it is, command or thrust, is for the message. Raises ValueError.
    """
    if len(names) == 2:
        return ("command", "thrust").index(what)
    places = [i for i, column in enumerate(names) if known.fullmatch(column.name)]
    if len(places) != 1:
        raise ValueError(
            f"has {len(places) or 'no'} columns of a {what} by name; keep two columns, as "
            "'pwm [us],thrust [kgf]'"
        )
    return places[0]


def _without_noise(thrusts: Vector, remarks: list[str]) -> Vector:
    """Thrusts (rows,) [N] without falls, where none is larger than a load cell's noise.

    Other thrusts come back as they are, for `check_rows` to refuse. A change adds to `remarks`.
    """
    level = np.maximum.accumulate(thrusts)
    most, full = float((level - thrusts).max()), float(np.abs(thrusts).max())
    if not 0.0 < most <= NOISE * full:
        return thrusts
    remarks.append(
        f"its thrust falls by up to {most:.2g} N ({most / full:.1%} of full thrust) in "
        f"{int((level > thrusts).sum())} rows, where that of the row before is taken"
    )
    return level


def _pulses_of(rows: Vector) -> dict[str, float]:
    """Rest and span [us] of a table's pulses: the middle of its dead band, its farther end.

    `rows` (rows, 2) are pulses [us] and thrusts [N]. Raises ValueError without a row of rest.
    """
    still = rows[rows[:, 1] == 0.0, 0]
    if not len(still):
        raise ValueError(
            "has no row without thrust; give pwm: {rest: 1500, span: 400}, and that row"
        )
    rest = 0.5 * float(still.min() + still.max())
    return {"rest": rest, "span": float(np.abs(rows[[0, -1], 0] - rest).max())}
