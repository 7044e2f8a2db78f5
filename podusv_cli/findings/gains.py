"""The gain conditions of the paper's stability proof, in words, before any run."""

from __future__ import annotations

from collections.abc import Iterator

from podusv_cli.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.scenario.model import Scenario
from podusv_cli.theory.bounds import Condition, ultimate_bound


def conditions(scenario: Scenario) -> Iterator[str]:
    """A line for each law that the proof covers: lambda of (49), and which conditions fail."""
    for label, single in scenario.singles().items():
        law = single.controller.lyapunov()
        if law is not None:
            yield f"{label}, conditions of the stability proof: {_summary(law, single)}"


def _summary(law: PolarBackstepping, scenario: Scenario) -> str:
    bound = ultimate_bound(law, scenario.vessel)
    failed = [_short(condition) for condition in bound.conditions if not condition.holds]
    printed = [condition.name for condition in bound.conditions if not condition.holds_printed]
    return (
        f"{'; '.join(failed) or 'all hold'}; lambda at most {bound.corrected.lambda_:.3g} 1/s "
        f"(as printed: {', '.join(printed) + ' fail' if printed else 'all hold'}, "
        f"{bound.printed.lambda_:.3g} 1/s)"
    )


def _short(condition: Condition) -> str:
    return f"{condition.name} = {condition.value:g} fails: it must exceed {condition.limit:.3g}"
