"""Which figures there are, and drawing them into files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from podusv_cli.figures.controls import controls
from podusv_cli.figures.panels import Family, signals_over_time
from podusv_cli.figures.style import LOOKS, Shown, house_style, image
from podusv_cli.figures.trajectory import trajectory
from podusv_cli.recording import Recording

FIGURES: dict[str, Family] = {
    "trajectory": trajectory,
    "errors": signals_over_time("x_e", "y_e", "z_e", "psi_e", logarithmic=("z_e",)),
    "controls": controls,
    "filters": signals_over_time("alpha_u", "beta_u", "alpha_r", "beta_r"),
    "adaptation": signals_over_time(
        "W_norm_u", "W_norm_r", "b_hat_u", "b_hat_r", "f_hat_u", "f_hat_r", "activation"
    ),
    "velocities": signals_over_time("u", "v", "r", "psi"),
    "loads": signals_over_time("b_u", "b_v", "b_r", "saturated"),
}


def dressed(
    runs: Sequence[tuple[str, Recording]], *, length: float, beam: float, steady_fraction: float
) -> list[Shown]:
    """Recordings with their looks, in order."""
    return [
        Shown(
            label, recording, *LOOKS[i % len(LOOKS)], length=length, beam=beam,
            steady_from=(1.0 - steady_fraction) * float(recording["time"][-1]),
        )
        for i, (label, recording) in enumerate(runs)
    ]  # fmt: skip


def draw(
    runs: Sequence[Shown], names: Iterable[str], formats: Iterable[str], columns: int = 2
) -> Iterator[tuple[str, bytes]]:
    """File name and content of each figure in each format."""
    formats = tuple(formats)
    with house_style():
        for name in names:
            figure = FIGURES[name](runs, columns)
            for form in formats:
                yield f"{name}.{form}", image(figure, form)
