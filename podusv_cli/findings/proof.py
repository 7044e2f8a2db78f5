"""What the paper's proof is about, in words, before any run: underactuation, and its gains."""

from __future__ import annotations

from collections.abc import Iterator

from podusv_cli.components.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.scenario.model import Scenario
from podusv_cli.theory.bounds import GainCondition, ultimate_bound


def argument(scenario: Scenario) -> str:
    """The rank argument for the scenario's vessel and actuator, as a sentence.

    Accelerations are M^-1 times the loads and M is regular, so both have the same rank.
    """
    matrix = scenario.actuator.input_matrix()
    rank = scenario.actuator.input_rank()
    # Adding 0.0 turns -0.0 into 0.
    rows = ", ".join("[" + ", ".join(f"{x + 0.0:.4g}" for x in row) + "]" for row in matrix)
    demands = ", ".join(("tau_u", "tau_r", "tau_v")[: matrix.shape[1]])
    sway = "its sway row is zero (Y_p = 0)" if not matrix[1].any() else "sway comes with the others"
    if scenario.actuator.takes_sway:
        sway = "sway is asked for by itself"
    verdict = "underactuated" if rank < len(matrix) else "fully actuated"
    kind = type(scenario.actuator).model_fields["kind"].default
    return (
        f"{verdict}: the map from demands ({demands}) to loads (tau_u, tau_v, tau_r) of "
        f"{kind} on {scenario.vessel.preset or 'the vessel'} is [{rows}], "
        f"rank {rank} of {len(matrix)}; {sway}"
    )


def conditions(scenario: Scenario) -> Iterator[str]:
    """A line for each law that the proof covers: lambda of (49), and which conditions fail."""
    for label, single in scenario.singles().items():
        law = single.closed_loop().lyapunov()
        if law is not None:
            yield f"{label}, conditions of the stability proof: {_summary(law, single)}"


def _summary(law: PolarBackstepping, scenario: Scenario) -> str:
    """Which conditions of the proof fail, and the rate lambda, corrected and as printed."""
    bound = ultimate_bound(law, scenario.vessel)
    failed = [_short(condition) for condition in bound.conditions if not condition.holds]
    printed = [condition.name for condition in bound.conditions if not condition.holds_printed]
    return (
        f"{'; '.join(failed) or 'all hold'}; lambda at most {bound.corrected.lambda_:.3g} 1/s "
        f"(as printed: {', '.join(printed) + ' fail' if printed else 'all hold'}, "
        f"{bound.printed.lambda_:.3g} 1/s)"
    )


def _short(condition: GainCondition) -> str:
    """A condition that fails, with value and limit."""
    return f"{condition.name} = {condition.value:g} fails: it must exceed {condition.limit:.3g}"
