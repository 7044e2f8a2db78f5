"""about.json: what a run says about itself, from its scenario to whoever reads its log."""

from __future__ import annotations

import inspect
import math
from typing import Any

from podusv_cli.components.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.core.about import BESIDE_RUNS, RunAbout
from podusv_cli.core.component import Component
from podusv_cli.core.earth import Plane
from podusv_cli.core.errors import LawError, in_a_line
from podusv_cli.metrics.table import METRICS
from podusv_cli.scenario.identify import Identify
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.sections import Origin
from podusv_cli.scenario.settings import changed_settings, parts, settings


def about_of(scenario: Scenario, identify: Identify | None = None) -> RunAbout:
    """What the run of a scenario with one law says about itself, for about.json.

    `identify` says what a log beside the run calls its quantities; the scenario of one run has no
    such section. Raises LawError where a component of a plug-in fails when it is asked.
    """
    try:
        return _told_by(scenario, identify or Identify())
    except Exception as error:  # a plug-in's method may raise anything
        what = f"what {scenario.name} says about itself (hull, path, limits, standoff)"
        raise LawError(f"{what} cannot be computed: {in_a_line(error)}") from error


def identify_of(about: RunAbout | None) -> Identify | None:
    """The columns and frame of a log beside a finished run; None where the run does not say.

    `about` is None for a folder that an older podusv wrote.
    """
    if about is None or not about.log_columns:
        return None
    return Identify(columns=about.log_columns, frame=about.log_frame)


def plane_of(about: RunAbout) -> Plane | None:
    """Where on earth a run's x = y = 0 is; None where its scenario does not say."""
    origin = about.values.get("origin")
    return Origin.model_validate(origin).plane if origin else None


def _told_by(scenario: Scenario, identify: Identify) -> RunAbout:
    """What readers need of one run's scenario; `identify` gives the frame of measured logs."""
    law, approach = scenario.controller, scenario.controller.approach()
    return RunAbout(
        **_of_parts(scenario),
        values=_values(scenario),
        metrics={n: m.about for n, m in scenario.known_metrics().items() if n not in METRICS},
        path_end=scenario.passed_by(1.0),
        path_steady=scenario.passed_by(1.0 - scenario.metrics.steady_fraction),
        trial=not law.aims(),
        standoff=approach.standoff if approach else 0.0,
        polar=isinstance(law, PolarBackstepping),
        optimum_of=law.optimum_of(),
        duration=scenario.simulation.duration,
        step=scenario.simulation.step,
        every=scenario.time_grid().log_every,
        steady_from=scenario.steady_from(),
        settling_radius=scenario.metrics.settling_radius,
        said={
            name: _describe_part(part)
            for name, part in (parts(scenario) | {"controller": law}).items()
        },
        settings=tuple(changed_settings(scenario)),
        law=tuple(settings(law, scenario.facts)),
        log_columns=identify.columns,
        log_frame=identify.frame,
    )


def _values(scenario: Scenario) -> dict[str, Any]:
    """The scenario as JSON has it, without the sections that it does not have."""
    values = scenario.model_dump(mode="json", exclude={*BESIDE_RUNS})
    return {key: content for key, content in values.items() if content is not None}


def _of_parts(scenario: Scenario) -> dict[str, Any]:
    """What figures and claims need of hull, path, actuator and sensors.

    Lengths, waypoints and circles are in [m], outages in [s].
    """
    vessel, path, actuator = scenario.vessel, scenario.path, scenario.actuator
    return {
        "length": vessel.length,
        "beam": vessel.beam,
        "follows": path.follows,
        "waypoints": tuple(map(tuple, path.waypoints())),
        "circles": tuple(map(tuple, path.circles())),
        # JSON knows no infinity: None is a demand without limit.
        "limits": tuple(x if math.isfinite(x) else None for x in actuator.limits()),
        # Three demands, surge, sway and yaw, need a rank of three.
        "underactuated": actuator.input_rank() < 3,
        "outages": scenario.measurement.outages_of_each(),
    }


def _describe_part(part: Component) -> str:
    return (inspect.getdoc(type(part)) or "").partition("\n")[0]
