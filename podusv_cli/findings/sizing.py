"""Findings about gains of a law that belong to a hull or an actuator of another size."""

from __future__ import annotations

from contextlib import suppress

from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.facts import Facts
from podusv_cli.core.component import unit_of
from podusv_cli.core.errors import SizingError
from podusv_cli.core.finding import At, Sentences, warn_before_run
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.reference import median

# Of the rule's number, what a number of the scenario's own may be at least and at most.
USUAL = {"U": (0.5, 2.0), "N_m": (0.3, 3.0), "k_psi": (0.2, 100.0)}
AMPLE = 1.5  # of the path's speed, a U that catches up with it
BEARABLE = 2.0  # times c/T_r, the largest k_psi
AGILE = 0.8  # of the path's speed over the length, the least gain of the heading


def other_numbers(law: Controller, facts: Facts) -> dict[str, tuple[float, float, str]]:
    """Given values of U, N_m and k_psi that are far from the default rule.

    By name: (number, the rule's number, why it matters). `facts` are of hull and actuator.
    """
    own = [name for name in USUAL if name in law.rules and name not in law.by_rule]
    far: dict[str, tuple[float, float, str]] = {}
    with suppress(SizingError):  # where nothing follows, nothing is far from it
        for name in own:
            number, rule = getattr(law, name), law.by_default(name, facts)
            if why := _why(name, number, rule, facts):
                far[name] = number, rule, why
    return far


def _why(name: str, number: float, rule: float, facts: Facts) -> str:
    """What comes of a `number` that is far too small or large beside the `rule`; else empty."""
    low, high = USUAL[name]
    if name == "k_psi" and facts.T_r > 0.0:
        # The bound on k_psi [1/s] follows from the loop's delay T_r [s]; divided by the rule, as
        # USUAL is.
        high = BEARABLE * facts.c / facts.T_r / rule
    consequences = {
        "U": ("the law never asks for the speed that there is", "surge is always limited"),
        "N_m": (
            "surge yields to yaw at moments that the hull hardly feels",
            "surge does not yield to yaw when the moment runs out",
        ),
        "k_psi": (
            "the hull turns as if it were a far larger one",
            f"the loop is late by {facts.T_r:.2g} s and swings",
        ),
    }
    small, large = consequences[name]
    return small if number < low * rule else large if number > high * rule else ""


@warn_before_run(
    "gains-for-another-hull",
    about="controller",
    meaning="a gain belongs to another hull",
    condition=f"U outside {USUAL['U'][0]:g} to {USUAL['U'][1]:g} times (a small one only below "
    f"{AMPLE:g} times the path's speed), N_m outside {USUAL['N_m'][0]:g} to {USUAL['N_m'][1]:g} "
    f"times what follows from hull and actuator, or k_psi below {USUAL['k_psi'][0]:g} times that "
    f"or above {BEARABLE:g} c/T_r",
    remedy="leave the key out, or write null: it then follows from hull and actuator",
)
def gains_for_another_hull(case: Case) -> Sentences:
    """Speed, moment or pace are not those of this hull with this actuator."""
    law, asked = case.scenario.controller, float(case.reference.speed.max())
    for name, (number, rule, why) in other_numbers(law, case.facts).items():
        # Less than the hull can do is no fault as long as it suffices for this path.
        if name == "U" and AMPLE * asked <= number < rule:
            continue
        unit = unit_of(type(law).model_fields[name])
        yield At(
            f"controller.{name}",
            f"{number:g} {unit}, while hull and actuator make it {rule:.3g} {unit}: {why}; leave "
            f"{name} out, or write null",
        )


@warn_before_run(
    "slow-steering",
    about="controller",
    meaning="the hull is faster than the law steers it",
    condition=f"the gain of the heading times the length, over the path's speed, is below {AGILE}",
    remedy="slow the target down, shorten the actuator's lag or the period, or take a larger gain",
)
def slow_steering(case: Case) -> Sentences:
    """A hull goes more than its length while the law turns it."""
    key, gain = case.scenario.controller.steering()
    length, speed = case.scenario.nominal.length, median(case.reference.speed)
    if key and gain * length < AGILE * speed:
        yield At(
            f"controller.{key}",
            f"the law turns the hull at {gain:.3g} 1/s, and at {speed:.3g} m/s it goes "
            f"{speed / gain / length:.2g} lengths in that time: corners are cut wide; slow the "
            f"target down to {gain * length / AGILE:.2g} m/s, or shorten the actuator's lag and "
            "the period",
        )
