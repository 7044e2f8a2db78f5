"""Figures that show signals over time and nothing else."""

from __future__ import annotations

from podusv_cli.figures.panels import PEAKS, signals_over_time
from podusv_cli.figures.sheet import Sheet, figure


def _grid(
    name: str, place: int, caption: str, *signals: str,
    logarithmic: tuple[str, ...] = (), compressed: bool = False, source: str = "",
) -> Sheet:  # fmt: skip
    family = signals_over_time(*signals, logarithmic=logarithmic, compressed=compressed)
    return figure(name, caption=caption, signals=signals, place=place, source=source)(family)


errors = _grid(
    "errors", 2, "tracking errors (18) over time, the distance on a logarithmic axis",
    "x_e", "y_e", "z_e", "psi_e", logarithmic=("z_e",), source="the paper's figure 4",
)  # fmt: skip
adaptation = _grid(
    "adaptation", 5,
    "norms of the network weights, estimated bounds, network outputs, largest node output" + PEAKS,
    "W_norm_u", "W_norm_r", "b_hat_u", "b_hat_r", "f_hat_u", "f_hat_r", "activation",
    compressed=True,
)  # fmt: skip
velocities = _grid(
    "velocities", 6, "velocities and heading" + PEAKS, "u", "v", "r", "psi", compressed=True
)
