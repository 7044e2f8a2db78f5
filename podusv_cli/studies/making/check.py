"""What is wrong with a scenario's key `sweep`, found before anything is drawn or simulated."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from podusv_cli.core.component import Component
from podusv_cli.core.phrases import describe_found, did_you_mean, unknown_word
from podusv_cli.core.signal import NAME, NAME_IN_WORDS
from podusv_cli.engine.loop.plan import Plan, no_probe
from podusv_cli.expressions.reading import ExpressionError
from podusv_cli.metrics.metric import Metric
from podusv_cli.scenario.address import ValueRefused, content, describe_key, has, is_whole, no_entry
from podusv_cli.scenario.load import Loaded, values
from podusv_cli.scenario.model import PER_RUN, Scenario
from podusv_cli.scenario.sections import CLAIM, CLAIM_IN_WORDS
from podusv_cli.scenario.sweep import Quantity, Sweep
from podusv_cli.scenario.yaml_tree import Route, dotted_key, route
from podusv_cli.studies.counting.claims import parse
from podusv_cli.studies.counting.expressions import parse_success
from podusv_cli.studies.counting.runs import AXES, ENDING, OWN
from podusv_cli.studies.making.draws import draw_scenario

# Shares at which a distribution is tried; its ends and its middle may be rounder than its draws.
TRIED = np.array([0.000871, 0.381966, 0.998713])
# draw other than whole numbers
REAL = ("uniform", "normal", "lognormal", "log_uniform", "triangular", "angle")
MOST_TRIED = 50  # values of a choice
MOST_ROUNDS = 12  # of all pairings of the values of a few quantities
FREE_NAME = "; a quantity with a name of your own needs `keys`, as in keys: [vessel.m, vessel.I_z]"
Faults = Iterator[tuple[Route, str]]


def sweep_faults(loaded: Loaded) -> list[tuple[Route, str]]:
    """Everything that is wrong with `sweep`: the steps to the key, and a message for it."""
    scenario, sweep = loaded.scenario, loaded.scenario.sweep
    if sweep is None:
        return []
    laws = list(_laws(scenario, sweep))
    # What contradicts itself without a draw does so with every one.
    whole = not (loaded.contradictions or loaded.clashes)
    draws = _vary(singles(scenario), loaded.plans, sweep) if whole else ()
    # An unknown law would make every other check fail as well.
    return laws or [
        *_metric_names(scenario),
        *draws,
        *_twice(sweep),
        *_keep(scenario, sweep),
        *_claims(scenario, sweep),
    ]


def unjudged_claims(scenario: Scenario) -> str:
    """A warning that a study does not judge the scenario's claims about single runs, or "".

    None is due where the study has claims or a success of its own: then both are meant, each for
    its command.
    """
    sweep = scenario.sweep
    judges = sweep and (sweep.claims or sweep.success != Sweep().success)
    if judges or not scenario.claims:
        return ""
    return (
        f"claims ({', '.join(scenario.claims)}) are about single runs, which podusv compare "
        "judges; a study judges sweep.claims and sweep.success"
    )


def singles(scenario: Scenario) -> dict[str, Scenario]:
    """The scenario of every law that takes part in the sweep."""
    wanted = scenario.sweep.laws if scenario.sweep else ()
    return {
        n: single for n, single in scenario.singles().items() if n in (wanted or scenario.labels())
    }


def _laws(scenario: Scenario, sweep: Sweep) -> Faults:
    """Laws of the study that the scenario has not, or that are named twice."""
    labels = scenario.labels()
    for place, label in enumerate(sweep.laws):
        if label not in labels:
            yield ("sweep", "laws", place), unknown_word(f"law {label!r}", label, labels)
        if label in sweep.laws[:place]:
            yield ("sweep", "laws", place), f"{label} is named twice"


def _metric_names(scenario: Scenario) -> Faults:
    """Metrics of plug-ins that have the name of something else in the table of runs."""
    for name in scenario.known_metrics():
        if name in {*OWN, *ENDING}:
            yield ("plugins",), f"metric {name}: the table of runs has another column of this name"


def _vary(laws: Mapping[str, Scenario], plans: Mapping[str, Plan], sweep: Sweep) -> Faults:
    """Drawn quantities whose name, key or values no law can take; one fault each if possible.

    `laws` are the scenarios and `plans` the loops, by law.
    """
    # Two loops of one structure march in the same compiled code; probes are no part of it.
    own = {law: replace(plans[law], probe_for=no_probe).structure for law in laws}
    taken = {
        *AXES,
        *ENDING,
        *(name for single in laws.values() for name in gathered_metrics(single)),
    }
    wrong_names = {name: _wrong_name(name, q, taken) for name, q in sweep.vary.items()}
    wrong_keys = {
        name: [text for key in q.targets(name) for text in _key(key, q, laws)]
        for name, q in sweep.vary.items()
    }
    sound = {
        name: q for name, q in sweep.vary.items() if not (wrong_names[name] or wrong_keys[name])
    }
    # One trial of all at once is fast; only if it fails is each quantity tried alone, for a
    # message.
    together = _are_taken_together(sound, laws, own)
    for name, quantity in sweep.vary.items():
        if wrong_names[name]:
            yield ("sweep", "vary", name), wrong_names[name]
            continue
        texts = wrong_keys[name]
        if name in sound and not together:
            texts = list(_wrong_values(name, quantity, laws, own))
        told = [*dict.fromkeys(texts)][: 1 if quantity.rows else None]  # they have many keys
        yield from ((("sweep", "vary", name), text) for text in told)


def _wrong_name(name: str, quantity: Quantity, taken: Collection[str]) -> str:
    """Why a quantity cannot be a column of the table of runs under this name; else empty.

    `taken` has the names of the other columns. A name that is the key itself is always free.
    """
    if name in quantity.targets(name):
        return ""
    if not NAME.fullmatch(name):
        return f"the name of a quantity with `keys` {NAME_IN_WORDS}, as in hull_mass"
    if name in taken:
        return f"{name} is another column of the table of runs; name the quantity {name}_drawn"
    return ""


def _key(key: str, quantity: Quantity, laws: Mapping[str, Scenario]) -> Iterator[str]:
    """What is wrong with a key that a quantity changes; `laws` are the scenarios by law."""
    steps = route(key)
    section = str(steps[0]) if steps else ""
    if section not in PER_RUN and section in Scenario.model_fields:
        yield f"{section} is the same for all runs of a cell; list values of {key} under grid"
        return
    # Laws without the key would get no draw, so that the study would compare unlike runs.
    lacking = [law for law, single in laws.items() if not has(single, key)]
    if len(lacking) == len(laws):
        near = did_you_mean(key, _numbers(laws))
        whys = (why(single, steps) for single in laws.values() for why in (no_entry, no_section))
        beyond = next(filter(None, whys), "")
        free = "" if quantity.keys or len(steps) > 1 else FREE_NAME
        yield beyond or f"unknown key {key!r}{near or free}"
    elif lacking:
        having = ", ".join(label for label in laws if label not in lacking)
        who = f"{key} is no key of {', '.join(lacking)}"
        yield f"{who}; name the laws that have it, {having}, in sweep.laws"
    else:
        yield from (t for single in laws.values() for t in _type(key, quantity, single))


def no_section(scenario: Scenario, steps: Route) -> str:
    """The message for a key inside a section that is null; empty where that is not the reason.

    `steps` lead to the key, such as ("disturbance", "wind", "speed").
    """
    for end in range(1, len(steps)):
        at, inner = dotted_key(steps[:end]), dotted_key(steps[end:])
        if not has(scenario, at):
            return ""
        if content(scenario, steps[:end]) is None and describe_key(scenario, steps[:end]).follow(
            steps[end:]
        ):
            return (
                f"{at} is null, and a draw changes what is there; write this section first, as in "
                f"{at}: {{{inner}: ...}}"
            )
    return ""


def _numbers(laws: Mapping[str, Scenario]) -> list[str]:
    """All keys of numbers that a draw can change, but for those in lists."""
    items = [item for single in laws.values() for item in values(single).items()]
    return [key for key, own in items if route(key)[0] in PER_RUN and _is_number(own)]


def _is_number(own: Any) -> bool:
    return isinstance(own, (int, float)) and not isinstance(own, bool)


def _type(key: str, quantity: Quantity, scenario: Scenario) -> Iterator[str]:
    """What is wrong with the kind of value at `key` for the way in which `quantity` is drawn."""
    steps = route(key)
    own, way = content(scenario, steps), quantity.given_keys[0]
    words = describe_key(scenario, steps).choices or (isinstance(own, bool) and ("true", "false"))
    if steps[-1] in ("kind", "preset"):
        yield f"a draw cannot change {key}; list its values under grid"
    elif quantity.seed and int not in describe_key(scenario, steps).types:
        yield f"{key} cannot be drawn as a seed, since it is not a whole number"
    # `way` then names the distribution, not the operation (set, add, scale).
    elif is_whole(describe_key(scenario, steps)) and (way := _real(quantity)):
        seed = "seed: true or " if steps[-1] == "seed" else ""
        yield f"{key} is a whole number, and {way} draws others; write {seed}integers: [low, high]"
    # A number that is null follows a rule: a draw can set it, and has nothing to add to or scale.
    elif _is_number(own) or (own is None and not quantity.relative):
        return
    elif words and way != "choice":
        yield f"{way} needs a number, and {key} is one of {', '.join(words)}; use choice"
    elif not words:
        what = (
            "a section" if isinstance(own, Component) else describe_found(own, str(own or "null"))
        )
        yield f"{key} is no number but {what}"


def _real(quantity: Quantity) -> str:
    """The way to draw, where it draws other than whole numbers; else empty."""
    return next((way for way in quantity.distribution.given_keys if way in REAL), "")


def _are_taken_together(
    quantities: Mapping[str, Quantity], laws: Mapping[str, Scenario], own: Mapping[str, Any]
) -> bool:
    """Whether every law takes all quantities at once, each at every value that is tried of it.

    `own` has the structure of each law's loop before any draw. A loop is built for each round, not
    for each quantity. A round that fails does not show which quantity is to blame: then each has to
    be tried alone.
    """
    draws = _rounds({name: _values_to_try(quantity) for name, quantity in quantities.items()})
    try:
        return all(
            _structure(draw_scenario(single, quantities, draw)) == own[law]
            for law, single in laws.items()
            for draw in draws
        )
    except ValueRefused:
        return False


def _rounds(values: Mapping[str, list[Any]]) -> list[dict[str, Any]]:
    """Draws that have every value of each quantity at least once.

    They are all pairings where these are few. `values` lists what is tried of each quantity, by
    name. Two values that each agree with the scenario may contradict each other, so they meet in
    more than one order.
    """
    if math.prod(map(len, values.values())) <= MOST_ROUNDS:
        return [dict(zip(values, chosen, strict=True)) for chosen in product(*values.values())]
    ways = [dict.fromkeys(values, 1), {name: (-1) ** i for i, name in enumerate(values)}]
    return [
        {name: v[way[name] * i % len(v)] for name, v in values.items()}
        for way in ways  # all upwards, then every second one downwards
        for i in range(max(map(len, values.values())))
    ]


def _values_to_try(quantity: Quantity) -> list[Any]:
    """Some values of a quantity: all of them where they are few; numbers of rows for a table."""
    if quantity.rows:
        return list(range(len(quantity.lines.rows)))
    if quantity.seed:
        return [1]
    choice = (quantity.distribution.choice or ())[:MOST_TRIED]
    return list(choice) or quantity.distribution.at(TRIED).tolist()


def _wrong_values(
    name: str, quantity: Quantity, laws: Mapping[str, Scenario], own: Mapping[str, Any]
) -> Iterator[str]:
    """What is wrong with the values that are tried of a quantity, a message for each law.

    `own` has the structure of each law's loop before any draw.
    """
    rows = len(quantity.lines.rows) if quantity.rows else 0
    tried = _values_to_try(quantity)
    all_count = rows or quantity.distribution.choice
    for law, single in laws.items():
        answers = [_scenario_or_refusal(name, quantity, single, value) for value in tried]
        refusals = [answer if isinstance(answer, str) else "" for answer in answers]
        # A few refused draws of a distribution are invalid runs of the study, which may be meant.
        if all(refusals) or (all_count and any(refusals)):
            place, refused = next((i, text) for i, text in enumerate(refusals) if text)
            row = f"row {place + 1} of {rows}: " if rows else ""
            yield row + refused.removeprefix(f"sweep.vary.{name}: ")
        yield from (
            "changes how the loop is put together or sampled; list its values under grid"
            for answer in answers
            if not isinstance(answer, str) and _structure(answer) != own[law]
        )


def _scenario_or_refusal(
    name: str, quantity: Quantity, scenario: Scenario, value: Any
) -> Scenario | str:
    """The scenario with this draw, or the sentence that says why it cannot be.

    `value` is the draw of the quantity called `name`.
    """
    try:
        return draw_scenario(scenario, {name: quantity}, {name: value})
    except ValueRefused as error:
        return str(error)


def _structure(scenario: Scenario) -> Any:
    """The structure of a scenario's loop: equal for runs that differ in numbers only."""
    return Plan(scenario.closed_loop(), scenario.time_grid()).structure


def _twice(sweep: Sweep) -> Faults:
    """Keys that two quantities draw, or that the grid sets as well."""
    keys = [(name, key) for name, q in sweep.vary.items() for key in q.targets(name)]
    counts, of_rows = Counter(key for _, key in keys), set[str]()
    for name, key in keys:
        # A table of rows has many keys: one message is enough.
        if name in of_rows:
            continue
        others = [other for other, same in keys if same == key and other != name]
        if sweep.vary[name].rows and (counts[key] > 1 or key in sweep.grid):
            of_rows.add(name)  # one of its many keys is enough
        if counts[key] > 1:
            yield ("sweep", "vary", name), f"{key} is drawn twice{_by(others)}"
        if key in sweep.grid:
            yield ("sweep", "vary", name), f"{key} is under grid, too; leave one of them out"


def _by(others: list[str]) -> str:
    return f", by {' and '.join(others)} too" if others else ""


def gathered_metrics(scenario: Scenario) -> dict[str, Metric]:
    """The metrics that are accumulated during a run, without any log.

    Metrics of the target are left out where the path leads beside the vessel.
    """
    return {
        name: metric
        for name, metric in scenario.known_metrics().items()
        if metric.accumulator and not (scenario.path.goes_beside and metric.accumulator.of_target)
    }


def _keep(scenario: Scenario, sweep: Sweep) -> Faults:
    """Kept runs by a metric or a draw that does not exist."""
    metrics = gathered_metrics(scenario)
    for name in sweep.keep.worst:
        if name not in metrics:
            yield (
                ("sweep", "keep", "worst", name),
                unknown_word(f"metric {name!r}", name, metrics, "podusv list"),
            )
    for place, draw in enumerate(sweep.keep.draws):
        if not 0 <= draw < sweep.draws:
            text = f"there is no draw {draw}; they are 0 to {sweep.draws - 1}"
            yield ("sweep", "keep", "draws", place), text


def _claims(scenario: Scenario, sweep: Sweep) -> Faults:
    """What is wrong with claims and success: unreadable, or not to be judged in this design."""
    if sweep.claims and not sweep.independent:
        remedy = f"`claims: {{{next(iter(sweep.claims))}: null}}`"
        yield (
            ("sweep", "design"),
            "Sobol' points are not independent, so the intervals that judge claims do not hold for "
            f"them; write design: random, or take out each claim, as in {remedy}",
        )
    metrics, laws = gathered_metrics(scenario), tuple(singles(scenario))
    try:
        parse_success(sweep.success, metrics)
    except ExpressionError as error:
        yield ("sweep", "success"), str(error)
    for name, claim in sweep.claims.items():
        if not CLAIM.fullmatch(name):
            yield ("sweep", "claims", name), CLAIM_IN_WORDS
        try:
            parse(claim.expect, laws, metrics)
        except ExpressionError as error:
            yield ("sweep", "claims", name, "expect"), str(error)
