"""A measured or forecast current."""

from __future__ import annotations

from typing import Any, ClassVar, Literal, Self

from pydantic import field_validator, model_validator

from podusv_cli.components.disturbances.base import FLOW, Disturbance
from podusv_cli.components.disturbances.current import load_of_flow
from podusv_cli.components.disturbances.flow_rows import (
    NO_FILE,
    flow_between_rows,
    flow_table,
    read_flow,
)
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

FASTEST = 20.0  # m/s; no water flows faster


class CurrentFile(Disturbance):
    """Water that flows everywhere as a file says at each time; the hull moves through it.

    The load is that of the kind `current`. Speed and direction lie on straight lines between rows,
    and the direction turns the shorter way. Before the first and after the last row the nearest
    row holds. The water's own acceleration is left out.
    """

    kind: Literal["current_file"] = "current_file"
    texts_of: ClassVar[dict[str, str]] = {"file": "rows"}
    file: str | None = value(None, "", "CSV file beside the scenario; its text is read into `rows`")
    rows: str = value(
        "",
        "",
        "lines of t [s], speed [m/s], direction [rad] that it flows to, from north to east; times "
        "increasing",
    )
    form: Literal["irrotational", "no_acceleration"] = value(
        "irrotational",
        "",
        "no_acceleration leaves out M nu_c', as some papers do; then a hull that turns feels the "
        "ground",
    )

    @field_validator("rows")
    @classmethod
    def _readable(cls, rows: str) -> str:
        """The text as it is. Raises ValueError where it cannot be read as a flow."""
        read_flow(rows, FASTEST)
        return rows

    @model_validator(mode="after")
    def _check_content(self) -> Self:
        """Raises ValueError where no file is named."""
        if not self.rows:
            raise ValueError(NO_FILE)
        return self

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Speed and direction of the flow, written behind the load."""
        return FLOW

    def constants_with(self, vessel: Vessel) -> dict[str, float]:
        """How many rows there are, the form, and the coefficients of the hull."""
        count = len(read_flow(self.rows, FASTEST))
        return vessel.constants() | self.constants() | {"count": float(count)}

    def table(self) -> Vector:
        """The times [s], then speed [m/s] and direction [rad] row by row: (3 rows,)."""
        return flow_table(read_flow(self.rows, FASTEST))

    # t [s], x (6) state; table as `flow_table` has it. Writes b (5): the load [N, N, N m], then
    # speed [m/s] and direction [rad] of the flow.
    @staticmethod
    @kernel
    def evaluate(t: float, x: Vector, k: Any, table: Vector, b: Vector) -> None:
        """The load of the flow between two rows."""
        V_c, beta_c = flow_between_rows(t, int(k.count), table)
        load_of_flow(V_c, beta_c, x, k, b)
        b[3], b[4] = V_c, beta_c
