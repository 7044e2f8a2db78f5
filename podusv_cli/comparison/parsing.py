"""Claims of a scenario, read before there are runs."""

from __future__ import annotations

import ast

from podusv_cli.comparison.claims import ParsedClaim
from podusv_cli.comparison.expressions import parse
from podusv_cli.core.errors import ScenarioError
from podusv_cli.expressions.reading import ExpressionError
from podusv_cli.scenario import explain
from podusv_cli.scenario.load import Loaded


def parse_claims(loaded: Loaded) -> list[ParsedClaim]:
    """The claims of a scenario. Raises ScenarioError with a line for each invalid one."""
    scenario, claims, faults = loaded.scenario, [], []
    signals = {signal.name: signal for signal in explain.signals(scenario.plugged)}
    metrics = scenario.known_metrics()
    for plan in loaded.plans.values():
        signals |= scenario.about(plan)
    for name, claim in scenario.claims.items():
        trees: dict[str, ast.expr] = {}
        for field, text in (("expect", claim.expect), ("given", claim.given)):
            key = f"claims.{name}.{field}"
            try:
                # An empty `expect` is parsed, too, and refused with the others.
                if text or field == "expect":
                    trees[field] = parse(text, scenario.labels(), signals, metrics)
            except ExpressionError as error:
                faults.append(f"{loaded.origins[key]}: {key}: {error}")
        if "expect" in trees:
            claims.append(ParsedClaim(name, claim, **trees))
    if faults:
        raise ScenarioError(faults)
    return claims
