"""What a person may move in a scenario: numbers with a range to slide in, and choices of words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from podusv_cli.core.component import Component
from podusv_cli.core.phrases import as_yaml
from podusv_cli.scenario.address import is_whole
from podusv_cli.scenario.explain import choices_of
from podusv_cli.scenario.keys import NO_DEFAULT, Key, keys_of, limits
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.yaml_tree import Route, dotted_key, route

REACH = 30.0  # from its number, a logarithmic slider reaches so many times up and down
WIDE = 3.0  # a linear one so many times the number's size
# The size of a number that is 0 and has no default, by its unit; in metres the hull's length.
SIZES = {"m/s": 1.0, "rad": math.pi, "rad/s": 1.0, "s": 1.0, "N": 10.0, "N m": 10.0}
AFTER = (
    "vessel",
    "actuator",
    "disturbance",
    "path",
    "start",
    "measurement",
    "estimator",
    "control",
    "simulation",
)
# How a loop dies: these stand together, before all others.
LOOP = "sampling, delay and noise"
LINK = ("command", "delay")  # of an actuator; a scenario may lack the section
FIRST = ("control.period", "actuator.command.delay", "measurement.kind")
OF_SENSORS = ("delay", "noise")
PLACES = ("path", "points")
MOST_PLACES = 24  # waypoints that may be moved one by one
MOST_LATE = 100  # steps to which the slider of a time that is 0 reaches
STEPPED = ("period", "delay", "duration")  # names of times that are whole numbers of steps


@dataclass(frozen=True)
class Knob:
    """A value at a key: its meaning, and a slider from `low` to `high` or the words it may be.

    `log`: the slider is even in the number's logarithm. `quantum` is what it is a multiple of.
    """

    key: str
    part: str
    name: str
    meaning: str
    value: Any
    default: str
    unit: str = ""
    range: str = ""
    by_rule: bool = False
    low: float = 0.0
    high: float = 0.0
    log: bool = False
    quantum: float = 0.0
    choices: tuple[str, ...] = ()


def controls(scenario: Scenario, laws: Sequence[str]) -> list[Knob]:
    """The knobs of a loop's timing, then of these laws, then of the sections AFTER.

    `laws` are keys such as `controller` or `controllers.pid`.
    """
    ruled = {*scenario.keys_by_rule()}
    seas = list(scenario.disturbances())
    names = [n for name in AFTER for n in (seas if name == "disturbance" else [name])]
    found = [
        control
        for part in (*laws, *names)
        for control in _of_part(scenario, part, route(part), ruled)
    ]
    first = [_put_first(control) for control in found if _is_of_loop(control)]
    # Keys that are not in FIRST come behind those, in their own order.
    first.sort(key=lambda control: [*FIRST, control.key].index(control.key))
    return [*first, *(control for control in found if not _is_of_loop(control))]


def _is_of_loop(control: Knob) -> bool:
    """Whether it is a time or a noise between the vessel and its law."""
    of_sensor = control.part.startswith("measurement.") and control.name in OF_SENSORS
    return control.key in FIRST or of_sensor


def _put_first(control: Knob) -> Knob:
    """The control under the heading LOOP, with the sensor's name before its own, if it has one."""
    sensor = control.part.partition(".")[2] if control.part.startswith("measurement.") else ""
    return replace(control, part=LOOP, name=f"{sensor} {control.name}".strip())


def _of_part(scenario: Scenario, part: str, at: Route, ruled: set[Route]) -> Iterator[Knob]:
    """The controls of the part at route `at`, shown under the heading `part`, and of parts in it.

    `ruled` are the routes of values that a rule made of other values, not the user.
    """
    component: Any = scenario
    way: Route = ()
    for step in at:
        inside = isinstance(component, (dict, tuple))
        component = component[step] if inside else getattr(component, str(step))
        kind = getattr(component, "kind", "")
        way = (*way, step, kind) if kind else (*way, step)
    key, *_ = keys_of(type(scenario)).follow(way)  # a kind before a key of its name
    own = vars(type(component)).get("__annotations__", {})  # what the kind adds stands first
    for name, content in sorted(dict(component).items(), key=lambda entry: entry[0] not in own):
        if isinstance(content, Component):
            yield from _of_part(scenario, f"{part}.{name}", (*at, name), ruled)
        elif found := _control(scenario, part, (*at, name), key.keys[name], content):
            yield Knob(**found, by_rule=(*at, name) in ruled)
        elif (*at, name) == PLACES and 0 < len(content or ()) <= MOST_PLACES:
            yield from _waypoint_knobs((*at, name), content)
        # An actuator without the section `command` has no delay yet, and may be given one.
        elif name == LINK[0] and part == "actuator" and content is None:
            delay = key.keys[name].keys[LINK[1]]
            if found := _control(scenario, part, (*at, *LINK), delay, delay.default):
                yield Knob(**found)


def _waypoint_knobs(at: Route, points: Sequence[Sequence[float]]) -> Iterator[Knob]:
    """A knob for north and for east [m] of each point, which reaches as far as the points extend.

    `points` are (n, 2), `at` the steps to the list.
    """
    # A single point has no extent: it moves by 1 m.
    reach = max(max(axis) - min(axis) for axis in zip(*points, strict=True)) or 1.0
    for row, point in enumerate(points):
        for column, (name, now) in enumerate(zip(("north", "east"), point, strict=True)):
            yield Knob(
                key=dotted_key((*at, row, column)),
                part="waypoints",
                name=f"waypoint {row + 1} {name}",
                meaning="",
                value=now,
                default="",
                unit="m",
                low=now - reach,
                high=now + reach,
            )


def _control(
    scenario: Scenario, part: str, at: Route, key: Key, content: Any
) -> dict[str, Any] | None:
    """The fields of a `Knob` for one key, or None for content that no slider or list can set.

    `at` are the steps to the key, `part` is the heading, `content` the value now.
    """
    place, default, section = dotted_key(at), key.default, str(at[0]).removesuffix("s")
    words = {
        "key": place,
        "part": part,
        "name": key.name,
        "value": content,
        "unit": key.unit,
        "range": key.range,
        "meaning": (key.field and key.field.description) or f"which {section} it is",
        "default": "" if default is NO_DEFAULT else as_yaml(default),
    }
    choices = choices_of(key) or (("true", "false") if bool in key.types else ())
    if choices and key.name != "preset":
        shown = str(content).lower() if isinstance(content, bool) else content
        return {**words, "value": shown, "choices": choices}
    if isinstance(content, (int, float)) and not isinstance(content, bool):
        usual = default if isinstance(default, (int, float)) else 0.0
        is_stepped = key.name in STEPPED and key.unit == "s"
        quantum = scenario.simulation.step if is_stepped else float(is_whole(key))
        length = scenario.vessel.length if key.unit == "m" else 0.0
        span = _span(key, float(content), float(usual), length)
        # No period or delay lies between 0 and a step.
        if is_stepped and span.get("log"):
            span["low"] = max(span["low"], quantum)
        elif is_stepped:
            span["high"] = max(float(content), MOST_LATE * quantum)
        return {**words, **span, "quantum": quantum}
    return None


def _span(key: Key, now: float, usual: float, length: float) -> dict[str, Any]:
    """The slider's ends: the key's own where it has both, else around the number `now`.

    `usual` is the default; `length` [m] that of the hull for keys in m, else 0. The reach is a
    factor for numbers above 0, and a width for those of either sign.
    """
    bounds = limits(key.field)
    low = bounds.get("gt", bounds.get("ge"))
    high = bounds.get("lt", bounds.get("le"))
    size = abs(now) or abs(usual) or length or SIZES.get(key.unit, 1.0)
    if low is not None and high is not None:
        return {"low": min(low, now), "high": max(high, now)}
    if low is not None and low >= 0.0 and now > 0.0:
        return {"low": max(now / REACH, low), "high": now * REACH, "log": True}
    # A number that is 0 has no logarithm.
    if low is not None and low >= 0.0:
        return {"low": low, "high": 10.0 * size}
    if key.unit == "rad":
        return {"low": -max(math.pi, abs(now)), "high": max(math.pi, abs(now))}
    if (
        key.path[0] == "vessel" and key.unit != "m" and now
    ):  # as published: negative where it brakes
        ends = sorted((now / REACH, now * REACH))
        return {"low": ends[0], "high": ends[1], "log": True}
    if key.path[0] == "vessel" and key.unit == "m":
        size /= 2.0 * WIDE  # of a point within the hull
    return {
        "low": max(now - WIDE * size, low if low is not None else -math.inf),
        "high": min(now + WIDE * size, high if high is not None else math.inf),
    }
