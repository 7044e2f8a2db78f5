"""Whether a vessel is underactuated: its actuator cannot make all three loads independently."""

from __future__ import annotations

import numpy as np

from podusv_cli.actuators.base import Actuator
from podusv_cli.scenario.model import Scenario


def input_rank(actuator: Actuator) -> int:
    """Rank of the map from small demands to loads (tau_u, tau_v, tau_r) at rest.

    Below 3 the vessel is underactuated. The map comes from central differences of the kernel.
    """
    return int(np.linalg.matrix_rank(actuator.input_matrix()))


def argument(scenario: Scenario) -> str:
    """The rank argument for the scenario's vessel and actuator, as a sentence.

    Accelerations are M^-1 times the loads and M is regular, so both have the same rank.
    """
    matrix = scenario.actuator.input_matrix()
    rank = input_rank(scenario.actuator)
    rows = ", ".join("[" + ", ".join(f"{x + 0.0:.4g}" for x in row) + "]" for row in matrix)
    sway = "its sway row is zero (Y_p = 0)" if not matrix[1].any() else "sway comes with the others"
    verdict = "underactuated" if rank < len(matrix) else "fully actuated"
    kind = type(scenario.actuator).model_fields["kind"].default
    return (
        f"{verdict}: the map from demands (tau_u, tau_r) to loads (tau_u, tau_v, tau_r) of "
        f"{kind} on {scenario.vessel.preset or 'the vessel'} is [{rows}], "
        f"rank {rank} of {len(matrix)}; {sway}"
    )
