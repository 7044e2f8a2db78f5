"""What contradicts itself in a scenario whose values are right one by one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from podusv_cli.components.estimators.none import NoEstimator
from podusv_cli.core.component import describe, wrong_default
from podusv_cli.core.errors import LawError, in_a_line
from podusv_cli.core.signal import Signal
from podusv_cli.core.steps import misfit, nearest_hint, whole_steps
from podusv_cli.core.system import name_refused
from podusv_cli.engine.loop.closed_loop import unmet
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.sections import CLAIM, CLAIM_IN_WORDS, LABEL, LABEL_IN_WORDS

Conflicts = Iterator[tuple[str, str]]  # key and message
NO_ESTIMATOR = NoEstimator()
MOST_INSTANTS = 2**53  # that are distinct numbers
TIMED = ("simulation", "control", "actuator", "controller", "controllers")  # sections with times


def contradictions(scenario: Scenario) -> list[tuple[str, str]]:
    """Key and message for every pair of values that contradict each other; plans no loop.

    The second group of checks asks parts that the first has found sound.
    """
    parts = [*_defaults(scenario), *_conflicts_of_laws(scenario), *_summands(scenario)]
    return parts or [
        *_conflicts_of_commands(scenario),
        *_unmet(scenario),
        *of_numbers(scenario),
        *_names(scenario),
        *scenario.metrics.conflicts(),
    ]


def clashes(scenario: Scenario, plans: Mapping[str, Plan]) -> Conflicts:
    """Laws of which two signals of a run would have one name.

    It takes the plans of a load; a finished run has passed this check.
    """
    for label, plan in plans.items():
        try:
            scenario.about(plan)
        except LawError as error:
            yield f"controllers.{label}" if scenario.controllers else "controller", str(error)


def of_numbers(scenario: Scenario, sound: Scenario | None = None) -> Conflicts:
    """Conflicts that other numbers can bring into a scenario that has none, as draws do.

    `sound` is a scenario known to have none. Its sections are compared by identity, so that the
    times of unchanged ones are not checked for every draw.
    """
    if sound is None or any(getattr(scenario, n) is not getattr(sound, n) for n in TIMED):
        yield from _of_times(scenario)
    yield from _seeing(scenario)


def _of_times(scenario: Scenario) -> Conflicts:
    """Periods [s] of laws, trials and the control loop that are no whole number of steps."""
    laws = scenario.laws()
    sampled = {
        f"{at}.{law.period_key}".rstrip("."): law.sample_period() for at, law in laws.items()
    }
    trials = {f"{at}.execute": trial.execute for at, law in laws.items() if (trial := law.trial())}
    yield from _times(scenario, sampled | trials)
    yield from _samples(scenario.control.period, sampled)


def _defaults(scenario: Scenario) -> Conflicts:
    """Parts whose classes have a default that they do not allow themselves."""
    others = {
        "path": scenario.path,
        "actuator": scenario.actuator,
        "measurement": scenario.measurement,
        "estimator": scenario.estimator,
        **scenario.disturbances(),
    }
    for key, part in {**others, **scenario.laws()}.items():
        if fault := wrong_default(part):
            yield key, f"{describe(part)}: {fault}"


def _summands(scenario: Scenario) -> Conflicts:
    """An empty list of disturbances, and two of them that log the same signals."""
    parts = scenario.disturbances()
    if not parts:
        yield "disturbance", "is an empty list; for calm water write {kind: none}"
    first: dict[Signal, str] = {}
    for key, part in parts.items():
        taken = [first.setdefault(signal, key) for signal in part.signals]
        if taken and taken[0] != key and not part.adds_up:
            text = (
                f"logs {part.signals[0].name}, as {taken[0]} does; keep one of them (waves may be "
                "given several times)"
            )
            yield key, text


def _conflicts_of_commands(scenario: Scenario) -> Conflicts:
    """Commands over time that the actuator does not take."""
    for key, law in scenario.laws().items():
        if recorded := law.commands():
            try:
                scenario.actuator.commands(recorded)
            except ValueError as error:
                yield f"{key}.rows", str(error)


def _conflicts_of_laws(scenario: Scenario) -> Conflicts:
    """Laws that fail when they are asked what they declare: their own fault, whatever it is."""
    for key, law in scenario.laws().items():
        try:
            # Code of a plug-in, which may raise anything.
            law.sample_period(), law.declared()
        except Exception as error:
            yield key, f"{describe(law)}: asked what it logs, {in_a_line(error)}"


def _times(scenario: Scenario, of_laws: Mapping[str, float]) -> Conflicts:
    """Times [s] that are no whole number of steps.

    `of_laws` are those of the laws, by their keys.
    """
    step = scenario.simulation.step
    times = {
        "simulation.duration": scenario.simulation.duration,
        "control.period": scenario.control.period,
        "actuator.command.delay": scenario.actuator.delay(),
        **of_laws,
    }
    if max(times.values()) / step > MOST_INSTANTS:
        key, time = max(times.items(), key=lambda item: item[1])
        # A duration may be long, or the step small: the message is put at what is unusual.
        key = scenario.simulation.outlier if key == "simulation.duration" else key
        count = f"{time:g} s in steps of {step:g} s are {time / step:.3g} steps"
        yield key, f"{count}; no more than {MOST_INSTANTS:.2g} have times of their own"
        return
    for key, time in times.items():
        if time and (fault := misfit(time, step)):
            yield key, fault


def _samples(period: float, sampled: Mapping[str, float]) -> Conflicts:
    """Laws whose own samples lie between those of the control, `period` [s] apart."""
    for key, sample in sampled.items():
        if period and sample and not whole_steps(sample, period):
            text = f"{sample:g} s is no whole number of control periods of {period:g} s"
            yield key, text + nearest_hint(sample, period)


def _seeing(scenario: Scenario) -> Conflicts:
    """Sensors and disturbances that do not fit step or vessel, and estimators that lack a part."""
    step = scenario.simulation.step
    for at, part in scenario.disturbances().items():
        yield from ((f"{at}.{key}", text) for key, text in part.conflicts(scenario.vessel, step))
    for key, text in scenario.measurement.conflicts(step):
        yield f"measurement.{key}", text
    if scenario.measurement.is_exact and scenario.estimator != NO_ESTIMATOR:
        text = "has nothing to estimate where the law sees the true state"
        yield "estimator", f"{text}; add `measurement: {{kind: sensors}}`"
    if lacking := scenario.estimator.lacking(scenario.measurement.measured()):
        yield "estimator", lacking


def _unmet(scenario: Scenario) -> Conflicts:
    """Sentences on what laws need that path, actuator or estimator lack, each once."""
    laws, path, actuator = scenario.laws().values(), scenario.path, scenario.actuator
    # The place of the load in an estimator's memory; 0 where none estimates it.
    load_at = 0 if scenario.measurement.is_exact else scenario.estimator.load_at
    found = (text for law in laws for text in unmet(law, path, actuator, load_at))
    yield from dict.fromkeys(found)


def _names(scenario: Scenario) -> Conflicts:
    """Labels of laws and names of claims that cannot become names of folders and columns."""
    for label in scenario.controllers:
        if not LABEL.fullmatch(label):
            yield f"controllers.{label}", LABEL_IN_WORDS
        elif label == "figures":
            yield (f"controllers.{label}", "is the folder of the figures; take another name")
        elif refused := name_refused(label):
            yield f"controllers.{label}", refused
    if refused := name_refused(scenario.name):
        yield "name", refused
    for name in scenario.claims:
        if not CLAIM.fullmatch(name):
            yield f"claims.{name}", CLAIM_IN_WORDS
