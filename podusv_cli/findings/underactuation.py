"""The paper's title claim as a check: two inputs cannot make all three loads."""

from __future__ import annotations

import numpy as np

from podusv_cli.actuators.base import Actuator
from podusv_cli.scenario.model import Scenario


def input_rank(actuator: Actuator) -> int:
    """Rank of the map from small demands to loads (tau_u, tau_v, tau_r), at rest.

    By central differences of the actuator's kernel; below 3 the vessel is underactuated.
    """
    return int(np.linalg.matrix_rank(actuator.input_matrix()))


def argument(scenario: Scenario) -> str:
    """The rank argument in words, for the scenario's vessel and actuator.

    Accelerations follow from loads by M^-1, which is regular, so their rank is that of the loads.
    """
    matrix = scenario.actuator.input_matrix()
    rank = input_rank(scenario.actuator)
    rows = ", ".join("[" + ", ".join(f"{x + 0.0:.4g}" for x in row) + "]" for row in matrix)
    sway = "its sway row is zero (Y_p = 0)" if not matrix[1].any() else "sway comes with the others"
    verdict = "underactuated" if rank < len(matrix) else "fully actuated"
    kind = type(scenario.actuator).model_fields["kind"].default
    return (
        f"{verdict}: from (tau_u, tau_r) asked for to (tau_u, tau_v, tau_r) on the hull, "
        f"{kind} on {scenario.vessel.preset or 'the vessel'} is [{rows}], "
        f"rank {rank} of {len(matrix)}; {sway}"
    )
