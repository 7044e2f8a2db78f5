"""The scenario: everything that a run depends on, as one frozen value."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from types import GenericAlias
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, SupportsIndex, TypeVar

from pydantic import Discriminator, Field, Tag, create_model

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.components.disturbances.total import Total
from podusv_cli.components.estimators.base import Estimator
from podusv_cli.components.estimators.none import NoEstimator
from podusv_cli.components.facts import Facts
from podusv_cli.components.measurements.base import Measurement
from podusv_cli.components.measurements.exact import Exact
from podusv_cli.components.paths.base import Path
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.about import BESIDE_RUNS, Claim, at_target
from podusv_cli.core.component import Component, value
from podusv_cli.core.earth import PLACE, Plane
from podusv_cli.core.plugins import Plugins, from_file, installed_plugins
from podusv_cli.core.registry import any_of
from podusv_cli.core.signal import Signal, by_name
from podusv_cli.core.steps import whole_steps
from podusv_cli.engine.loop.closed_loop import ClosedLoop, passed_by
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.metrics.metric import Metric
from podusv_cli.metrics.table import Metrics, metrics_probe, metrics_with
from podusv_cli.metrics.windows import NAMED
from podusv_cli.scenario.doubt import Doubt
from podusv_cli.scenario.identify import Identify
from podusv_cli.scenario.sections import (
    NAME,
    Control,
    Log,
    MetricSettings,
    Origin,
    Required,
    Simulation,
    Start,
)
from podusv_cli.scenario.sweep import Sweep
from podusv_cli.scenario.tune import Tune
from podusv_cli.theory import monitor

if TYPE_CHECKING:
    AnyActuator = Actuator
    AnyController = Controller
    AnyDisturbance = Disturbance
    AnyEstimator = Estimator
    AnyMeasurement = Measurement
    AnyPath = Path
else:
    AnyActuator = any_of("podusv_cli.components.actuators", Actuator)
    AnyController = any_of("podusv_cli.components.controllers", Controller)
    AnyDisturbance = any_of("podusv_cli.components.disturbances", Disturbance)
    AnyEstimator = any_of("podusv_cli.components.estimators", Estimator)
    AnyMeasurement = any_of("podusv_cli.components.measurements", Measurement)
    AnyPath = any_of("podusv_cli.components.paths", Path)


Part = TypeVar("Part")
# The tags keep pydantic from telling what is wrong with a part once as a part and once as a list.
Summands = Annotated[
    Annotated[Part, Tag("one")] | Annotated[tuple[Part, ...], Field(strict=False), Tag("several")],
    Discriminator(lambda given: "several" if isinstance(given, (list, tuple)) else "one"),
]
# The sections whose kinds are components, found in the room and in plug-ins called `<section>s`.
BASES: dict[str, type[Component]] = {
    "path": Path,
    "disturbance": Disturbance,
    "actuator": Actuator,
    "measurement": Measurement,
    "estimator": Estimator,
    "controller": Controller,
}
# The sections in which runs of one compiled loop may differ.
PER_RUN = ("vessel", "nominal", "start", *BASES)
DISTURBANCE = "what the sea does; those of a list add up"


class Scenario(Component):
    """A vessel, its surroundings, its task, its controller, and how the run is done.

    `plugged` are the plug-ins that this class has been made with, see `scenario_class`.
    """

    plugged: ClassVar[Plugins] = ()
    name: str = value(..., "", "what the results are filed under", pattern=NAME)
    description: str = value("", "", "what the scenario is for, in a sentence")
    vessel: Vessel = value(..., "", "the vessel that is simulated")
    nominal: Vessel = value(
        ..., "", "the vessel that the controller knows; by default the true one"
    )
    start: Start = value(Start(), "", "state at t = 0")
    origin: Origin | None = value(
        None, "", "where x = y = 0 is on earth, for routes and logs; see podusv docs origin"
    )
    path: AnyPath = value(..., "", "how the target moves")
    disturbance: Summands[AnyDisturbance] = value(..., "", DISTURBANCE)
    actuator: AnyActuator = value(..., "", "from the law's demand to the load on the hull")
    measurement: AnyMeasurement = value(Exact(), "", "what is measured of the vessel's state")
    estimator: AnyEstimator = value(
        NoEstimator(), "", "from measurements to the state that the law works with"
    )
    controller: AnyController = value(..., "", "the law")
    controllers: dict[str, AnyController] = value(
        {},
        "",
        "laws to compare, by name; each starts from those keys of `controller` that it has too; "
        "`name: null` takes out an inherited one",
    )
    claims: dict[str, Claim] = value(
        {}, "", "what `podusv compare` is to judge, by name; null: no inherited one"
    )
    simulation: Simulation = value(Simulation(), "", "integration")
    control: Control = value(Control(), "", "sampling of the law")
    log: Log = value(Log(), "", "logging")
    metrics: MetricSettings = value(MetricSettings(), "", "windows and thresholds of the metrics")
    silence: tuple[str, ...] = value(
        (), "", "codes of findings that are not to be shown; see podusv docs findings", strict=False
    )
    plugins: dict[str, Required] = value(
        {}, "", "files with laws and other components of your own; see podusv docs plugins"
    )

    sweep: Sweep | None = value(
        None, "", "the study that `podusv sweep` makes of this scenario; see podusv docs studies"
    )
    tune: Tune | None = value(
        None, "", "how `podusv tune` searches for gains of the laws; see podusv docs tuning"
    )
    doubt: Doubt | None = value(
        None, "", "what `podusv doubt` moves to see whether verdicts turn; see podusv docs doubt"
    )

    identify: Identify | None = value(
        None, "", "the logs from which `podusv identify` takes the hull; see podusv docs identify"
    )

    def __reduce_ex__(self, protocol: SupportsIndex) -> str | tuple[Any, ...]:
        """Pickle by value where plug-ins made the class, which another process has to make anew."""
        if not any(plugin.text for plugin in self.plugged):
            return super().__reduce_ex__(protocol)
        files = tuple((plugin.path, plugin.text) for plugin in self.plugged if plugin.text)
        return _unpickle, (files, self.as_given(), self.open_choice)

    @property
    def open_choice(self) -> bool:
        """Whether nobody chose `controller`: it is the first of several `controllers` itself."""
        laws = [*self.controllers.values()]
        return len(laws) > 1 and self.controller is laws[0]

    def labels(self) -> tuple[str, ...]:
        """The names of the runs that a comparison of this scenario has."""
        return tuple(self.controllers) or (self.controller.label,)

    def alone(self) -> Scenario:
        """The scenario of one run: `controller` only, without comparison and studies."""
        return self.model_copy(
            update={"controllers": {}, "claims": {}, **dict.fromkeys(BESIDE_RUNS)}
        )

    def singles(self) -> dict[str, Scenario]:
        """A scenario for each run of a comparison, by label, without controllers and claims."""
        laws = self.controllers or {self.controller.label: self.controller}
        return {
            label: self.alone().model_copy(update={"controller": law})
            for label, law in laws.items()
        }

    def plugin_files(self) -> dict[str, str]:
        """The text of each plug-in file, by its name in a run's folder."""
        texts = {plugin.sha256: plugin.text for plugin in self.plugged}
        return {
            name: texts[plugin.sha256]
            for name, plugin in self.plugins.items()
            if name.endswith(".py")
        }

    @property
    def facts(self) -> Facts:
        """What null defaults follow from: the nominal vessel, the actuator, the loop's times."""
        seen = self.measurement
        return Facts(
            self.nominal,
            self.actuator,
            self.control.period,
            seen.age(),
            seen.noise_of_each(),
            self.simulation.duration,
        )

    def in_numbers(self) -> Scenario:
        """The scenario with a number in place of each null that means "from hull and actuator".

        Made once when a scenario is loaded, and again where a draw changes what the facts are of.
        Raises SizingError where no number follows.
        """
        if not self.keys_by_rule():
            return self
        facts = self.facts
        several = {label: law.sized(facts) for label, law in self.controllers.items()}
        # The very object, as `open_choice` tells it by identity.
        law = next(iter(several.values())) if self.open_choice else self.controller.sized(facts)
        seas = tuple(sea.sized(facts) for sea in self.disturbances().values())
        return self.model_copy(
            update={
                "path": self.path.sized(facts),
                "estimator": self.estimator.sized(facts),
                "controller": law,
                "controllers": several,
                "disturbance": seas if isinstance(self.disturbance, tuple) else seas[0],
            }
        )

    def keys_by_rule(self) -> list[tuple[str | int, ...]]:
        """The steps of every key whose number `in_numbers` gave.

        An example is ("controllers", "pid", "K_P").
        """
        seas = self.disturbance
        parts: list[tuple[tuple[str | int, ...], Component]] = [
            (("path",), self.path),
            (("estimator",), self.estimator),
            (("controller",), self.controller),
            *((("controllers", label), self.controllers[label]) for label in self.controllers),
            *(
                ((("disturbance", i), sea) for i, sea in enumerate(seas))
                if isinstance(seas, tuple)
                else [(("disturbance",), seas)]
            ),
        ]
        return [(*at, name) for at, part in parts if part.rules for name in part.by_rule]

    def as_given(self) -> dict[str, Any]:
        """As plain data, with null in place of what `in_numbers` gave."""
        data: dict[str, Any] = self.model_dump()
        for *sections, name in self.keys_by_rule():
            part: Any = data
            for section in sections:
                part = part[section]
            part[name] = None
        return data

    def closed_loop(self) -> ClosedLoop:
        """The closed loop of vessel, path, disturbance, actuator, sensors, estimator and law."""
        start = self.start
        return ClosedLoop(
            vessel=self.vessel,
            nominal=self.nominal,
            path=self.path,
            disturbance=self.sea,
            actuator=self.actuator,
            controller=self.controller,
            measurement=self.measurement,
            estimator=self.estimator,
            start=(start.x, start.y, start.psi, start.u, start.v, start.r),
        )

    @property
    def sea(self) -> Disturbance:
        """The disturbance as one, also where it is a list."""
        parts = self.disturbance
        return Total(parts=parts) if isinstance(parts, tuple) else parts

    @property
    def plane(self) -> Plane | None:
        """The plane of x and y on earth; None where nobody says where they are."""
        return self.origin.plane if self.origin else None

    def time_grid(self) -> TimeGrid:
        """The steps and logged instants of a scenario whose times `conflicts` has checked."""
        step = self.simulation.step
        steps = whole_steps(self.simulation.duration, step) or 0
        # Beyond the last step only the first is logged; machine code knows no larger numbers.
        every = min(self.log.every, steps + 1)
        held, first = whole_steps(self.control.period, step) or 0, self.control.update == "before"
        return TimeGrid(step, steps, every, held, first)

    def plan(self, grid: TimeGrid | None = None) -> Plan:
        """The loop on its grid, or another one, with the probe of all metrics."""
        return Plan(self.closed_loop(), grid or self.time_grid(), self.metrics_of)

    def plans(self) -> dict[str, Plan]:
        """The plan of each run of a comparison, by label."""
        return {label: single.plan() for label, single in self.singles().items()}

    def metrics_of(self, plan: Plan) -> Metrics:
        """The probe that gathers the numbers of all metrics during a run of this plan."""
        return metrics_probe(
            plan,
            known=self.known_metrics(),
            steady_fraction=self.metrics.steady_fraction,
            settling_radius=self.metrics.settling_radius,
        )

    def probe(self, grid: TimeGrid | None = None) -> Metrics:
        """What gathers the numbers of all metrics, over another grid than the run's where given."""
        return self.metrics_of(Plan(self.closed_loop(), grid or self.time_grid()))

    def ready(self, compiling: Callable[[float], None] | None = None) -> None:
        """Make every check of a run before its first step, and have its march compiled and loaded.

        `compiling` is called with the fraction that is compiled, if there is anything to compile.
        Raises LawError.
        """
        from podusv_cli.engine.running.simulate import (
            ready,  # who reads scenarios simulates nothing
        )

        ready(self.plan(), self.simulation.compiled, compiling)

    def known_metrics(self) -> dict[str, Metric]:
        """All metrics by name, with those of plug-ins, and of windows and radii named here."""
        known = metrics_with(self.plugged, self.metrics.windows_and_radii())
        return {name: metric for name, metric in known.items() if NAMED not in name}

    def steady_from(self) -> float:
        """When the part of the run begins that counts as settled [s]."""
        return self.time_grid().last_part(self.metrics.steady_fraction)

    def passed_by(self, share: float) -> dict[str, float]:
        """How far along the path the vessel is when this `share` (0 to 1) of it lies behind.

        Numbers of the path's `places`, by name.
        """
        return passed_by(self.path, self.controller, share)

    def at_target(self, numbers: Mapping[str, float]) -> bool:
        """Whether a run with these metrics ends at its target, see `core.about.at_target`."""
        return at_target(
            numbers,
            follows=self.path.follows,
            trial=not self.controller.aims(),
            radius=self.metrics.settling_radius,
        )

    def disturbances(self) -> dict[str, Disturbance]:
        """The disturbances by their keys: `disturbance`, or `disturbance[0]`, ... of a list."""
        sea = self.disturbance
        if not isinstance(sea, tuple):
            return {"disturbance": sea}
        return {f"disturbance[{i}]": part for i, part in enumerate(sea)}

    def laws(self) -> dict[str, Controller]:
        """All `controllers`, and `controller` where it is none of them, by their keys."""
        several = {f"controllers.{label}": law for label, law in self.controllers.items()}
        if self.controller in several.values():
            return several
        return {"controller": self.controller} | several

    def about(self, plan: Plan) -> dict[str, Signal]:
        """Every signal in the log of this run by name. Raises LawError where two have one name."""
        own = monitor.about(plan) if self.log.monitor else plan.about
        if not self.origin:
            return own
        return by_name(((lambda: "the loop", own.values()), (lambda: "the key `origin`", PLACE)))


def scenario_class(plugins: Plugins) -> type[Scenario]:
    """The class of scenarios that know the components of these plug-ins, too.

    Raises LawError where two components have one kind.
    """
    # Plug-ins of equal texts are equal, but provenance names the place of each.
    return _class(plugins, tuple(plugin.path for plugin in plugins)) if plugins else Scenario


@cache
def _class(plugins: Plugins, _places: tuple[str, ...]) -> type[Scenario]:
    """The class Scenario whose kinds of parts include those of these plug-ins.

    `_places` is no part of the result: it keeps plug-ins of one content from different files apart.
    """
    kinds: dict[str, Any] = {
        name: any_of(f"podusv_cli.components.{name}s", base, plugins)
        for name, base in BASES.items()
    }
    sea: Any = kinds["disturbance"]
    # Types that are made at run time, which mypy cannot follow.
    annotations = kinds | {
        "disturbance": Summands[sea],  # type: ignore[misc]
        "controllers": GenericAlias(dict, (str, kinds["controller"])),
    }
    fields: dict[str, Any] = {
        name: (annotation, Scenario.model_fields[name]) for name, annotation in annotations.items()
    }
    # The field of the class above also has the tags of its own summands.
    fields["disturbance"] = (annotations["disturbance"], value(..., "", DISTURBANCE))
    made = create_model("Scenario", __base__=Scenario, __doc__=Scenario.__doc__, **fields)
    made.plugged = plugins
    return made


def _unpickle(
    files: Iterable[tuple[str, str]], data: dict[str, Any], open_choice: bool
) -> Scenario:
    """The scenario that another process pickled.

    `files` are path and text of plug-ins, `data` the scenario as given. `open_choice` says that
    `controller` is the first of several laws itself, not an equal one.
    """
    made = scenario_class((*(from_file(*one) for one in files), *installed_plugins()))(
        **data
    ).in_numbers()
    if open_choice:
        made = made.model_copy(update={"controller": next(iter(made.controllers.values()))})
    return made
