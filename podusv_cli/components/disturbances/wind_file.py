"""A measured or forecast wind."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Literal, Self

from pydantic import field_validator, model_validator

from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.components.disturbances.flow_rows import (
    NO_FILE,
    flow_between_rows,
    flow_table,
    read_flow,
)
from podusv_cli.components.disturbances.wind import (
    FROM,
    NO_WINDAGE,
    SPEED,
    load_of_wind,
    logarithmic_shear,
    share_of_wind,
)
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

FASTEST = 120.0  # m/s; no wind over the sea was measured faster


class WindFile(Disturbance):
    """Wind as a file says at each time, the same all over the vessel, with the gusts that it has.

    The load is that of the kind `wind`. Speed and direction lie on straight lines between rows,
    and the direction turns the shorter way. Before the first and after the last row the nearest
    row holds.
    """

    kind: Literal["wind_file"] = "wind_file"
    texts_of: ClassVar[dict[str, str]] = {"file": "rows"}
    file: str | None = value(None, "", "CSV file beside the scenario; its text is read into `rows`")
    rows: str = value(
        "",
        "",
        "lines of t [s], speed [m/s], direction [rad] that the wind comes from, 0 north, pi/2 "
        "east; times increasing",
    )
    at: float = value(
        10.0,
        "m",
        "height at which the wind acts on the vessel, where the file's is that 10 m above the sea; "
        "leave it at 10 for a wind that was measured on board",
        gt=0,
        le=1e3,
    )
    drag: float = value(
        0.0026, "", "drag coefficient of the sea's surface, of the profile", gt=0, le=0.1
    )
    density: float = value(1.225, "kg/m3", "density of the air", gt=0)

    @field_validator("rows")
    @classmethod
    def _readable(cls, rows: str) -> str:
        """The text as it is. Raises ValueError where it cannot be read as a flow."""
        read_flow(rows, FASTEST)
        return rows

    @model_validator(mode="after")
    def _check_content(self) -> Self:
        """Raises ValueError where no file is named, or the profile has ended above `at`."""
        if not self.rows:
            raise ValueError(NO_FILE)
        share_of_wind(self.at, logarithmic_shear(self.drag))
        return self

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Speed and direction of the wind, written behind the load."""
        return SPEED, FROM

    def constants_with(self, vessel: Vessel) -> dict[str, float]:
        """What the kernel needs: the share of the file's speed, how many rows, windage.

        Raises ValueError for a vessel without windage.
        """
        if vessel.windage is None:
            raise ValueError(NO_WINDAGE)
        return vessel.windage.constants() | {
            "length": vessel.length,
            "density": self.density,
            "share": share_of_wind(self.at, logarithmic_shear(self.drag)),
            "count": float(len(read_flow(self.rows, FASTEST))),
        }

    def table(self) -> Vector:
        """The times [s], then speed [m/s] and direction [rad] row by row: (3 rows,)."""
        return flow_table(read_flow(self.rows, FASTEST))

    def conflicts(self, vessel: Vessel, step: float) -> Iterator[tuple[str, str]]:
        """A vessel without windage."""
        if vessel.windage is None:
            yield "kind", NO_WINDAGE

    # t [s], x (6) state; table as `flow_table` has it. Writes b (5): the load [N, N, N m], then
    # speed [m/s] and direction [rad].
    @staticmethod
    @kernel
    def evaluate(t: float, x: Vector, k: Any, table: Vector, b: Vector) -> None:
        """The load, the wind's speed and where it comes from."""
        speed, direction = flow_between_rows(t, int(k.count), table)
        c_from, s_from = cos_sin(direction)
        load_of_wind(k.share * speed, c_from, s_from, x, k, b)
        b[3], b[4] = k.share * speed, direction
