"""What every registered component promises, asked of each by being registered."""

import inspect
import math
from collections import Counter
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR, PACKAGE, ROOMS, VESSELS, corrected, example, kinds, situations
from pydantic import BaseModel, ValidationError

from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.controllers.manoeuvre import Manoeuvre
from podusv_cli.components.controllers.schedule import Schedule
from podusv_cli.components.measurements.exact import Exact
from podusv_cli.components.paths.base import TARGET
from podusv_cli.components.vessels.vessel import COEFFICIENTS, Vessel
from podusv_cli.core import registry
from podusv_cli.core.kernel import Vector, bundle, call, is_kernel
from podusv_cli.engine.loop.columns import names
from podusv_cli.scenario.explain import signals

EVERY = [(room, name, kind) for room in ROOMS for name, kind in kinds(room).items()]
every_kind = pytest.mark.parametrize(
    ("room", "kind"), [(r, k) for r, _, k in EVERY], ids=[f"{r}-{n}" for r, n, _ in EVERY]
)
KERNELS = {
    "paths": "evaluate",
    "disturbances": "evaluate",
    "actuators": "drive",
    "controllers": "law",
    "measurements": "sense",
    "estimators": "follow",
}

POD_VECTORS = ("n", "delta", "n_cmd", "delta_cmd", "thrust", "power")


def parts(kind: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """A component's class and those of the components in its fields."""
    yield kind
    for field in kind.model_fields.values():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            yield from parts(inner)


class Call:
    """A kernel's arguments at a random instant: what it reads, and what it must fill."""

    def __init__(self, room: str, component: Any, seed: int) -> None:
        random = np.random.default_rng(seed)
        law = component if room == "controllers" else kinds("controllers")["pid"]()
        at = next(situations(law, 1, seed))
        self.t = float(random.uniform(0, 300))
        self.reads, sizes = self._shape(room, component, at, random)
        self.writes = {name: np.full(size, np.nan) for name, size in sizes.items()}
        self.kernel: Callable[..., None] = getattr(component, KERNELS[room])

    def _shape(
        self, room: str, component: Any, at: Any, random: Any
    ) -> tuple[dict[str, Any], dict[str, int]]:
        if room == "disturbances":
            k, table = component.constants_with(NONLINEAR), component.table_for(NONLINEAR, 300.0)
            reads = {"x": at.x, "k": bundle(k), "table": table, "again": 0.0, "stage": 0.0}
            return reads, {"b": 3 + len(component.signals)}
        if room == "estimators":
            k, state = bundle(component.constants_with(NONLINEAR)), component.start(at.x, NONLINEAR)
            seen = np.concatenate([at.x + random.normal(0, 0.1, 6), np.ones(12)])
            tau, table = random.normal(0, 5, 3), component.table()
            reads = {"seen": seen, "tau": tau, "state": state, "k": k, "table": table}
            return reads, {"rate": len(state)}
        k, table = bundle(component.constants()), component.table()
        if room == "paths":
            return {"k": k, "table": table}, {"target": 6}
        if room == "actuators":
            count = len(component.states)
            state = component.rest() + random.normal(0, 0.1, count)
            demand = random.normal(0, 5, 2)
            reads = {"x": at.x, "state": state, "demand": demand, "k": k, "table": table}
            return reads, {"tau": 3, "rate": count, "signals": len(component.signals)}
        k = bundle(component.constants_with(NONLINEAR))
        reads = {"x": at.x, "memory": at.memory, "target": at.target, "k": k, "table": table}
        sizes = {"tau": 2, "rate": len(at.memory), "signals": len(component.signals)}
        return reads, sizes | {"work": component.workspace()}

    def __call__(self) -> list[Vector]:
        """Fresh outputs, without the scratch."""
        written = {name: vector.copy() for name, vector in self.writes.items()}
        call(self.kernel, t=self.t, **self.reads, **written)
        return [vector for name, vector in written.items() if name != "work"]


# What a measurement writes is its memory too; tests/test_testing_seeing.py asks it.
WRITING = [(room, kind) for room, _, kind in EVERY if room != "measurements"]


@pytest.mark.parametrize(("room", "kind"), WRITING)
def test_every_output_is_written_and_nothing_is_remembered_or_changed(room, kind):
    asked = [Call(room, example(kind), seed) for seed in range(50)]
    before = [[np.array(argument) for argument in one.reads.values()] for one in asked]
    first = [one() for one in asked]
    assert all(np.isfinite(out).all() for written in first for out in written)
    again = [one() for one in reversed(asked)][::-1]
    after = [[np.array(argument) for argument in one.reads.values()] for one in asked]
    for one, other in zip(first + before, again + after, strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)


@every_kind
def test_the_kernels_are_marked_for_the_compiler(room, kind):
    component = example(kind)
    if component == Exact():  # nothing is called
        return
    assert is_kernel(getattr(kind, KERNELS[room]))
    if isinstance(component, Controller) and component.takes_samples():
        assert is_kernel(component.sample)


@every_kind
def test_a_component_is_a_frozen_value_without_surprises(room, kind):
    component = example(kind)
    assert component == example(kind)
    hash(component)
    for name in kind.model_fields:
        with pytest.raises(ValidationError):
            setattr(component, name, getattr(component, name))
    with pytest.raises(ValidationError):
        example(kind, no_such_field=1.0)


@every_kind
def test_a_component_survives_being_written_out(room, kind):
    component = example(kind)
    assert kind.model_validate(component.model_dump()) == component
    assert kind.model_validate_json(component.model_dump_json()) == component


@every_kind
def test_numbers_that_are_none_are_refused(room, kind):
    for part in parts(kind):
        for name, field in part.model_fields.items():
            if field.annotation is float:
                for wrong in (math.nan, math.inf, "1.0", True):
                    given = (
                        {name: wrong}
                        if part is not kind
                        else example(kind).model_dump() | {name: wrong}
                    )
                    with pytest.raises(ValidationError, match=name):
                        part.model_validate(given)


@every_kind
def test_constants_are_numbers_under_names_that_kernels_can_read(room, kind):
    constants = example(kind).constants()
    assert all(name.isidentifier() and isinstance(n, float) for name, n in constants.items())
    table = example(kind).table()
    assert table.dtype == np.float64
    assert table.ndim == 1
    assert len(table) > 0


def test_kinds_and_class_names_are_unique():
    classes = [
        thing
        for room, base in ROOMS.items()
        for path in (PACKAGE / "components" / room).glob("*.py")
        for thing in vars(import_module(f"podusv_cli.components.{room}.{path.stem}")).values()
        if isinstance(thing, type) and issubclass(thing, base) and "kind" in thing.model_fields
        and thing.__module__ == f"podusv_cli.components.{room}.{path.stem}"
    ]  # fmt: skip
    assert len(classes) == len(EVERY)
    for room in ROOMS:
        mine = [c for c in classes if c.__module__.startswith(f"podusv_cli.components.{room}.")]
        kinds_here = Counter(c.model_fields["kind"].default for c in mine)
        assert kinds_here == Counter(kinds(room).keys())
    assert set(Counter(c.__name__ for c in classes).values()) == {1}


@pytest.mark.parametrize("kind", kinds("controllers").values(), ids=kinds("controllers"))
def test_a_law_s_own_constants_do_not_hide_the_vessel_s(kind):
    law = example(kind)
    assert not set(law.constants()) & set(NONLINEAR.constants())
    assert law.constants_with(NONLINEAR) == NONLINEAR.constants() | law.constants()


@pytest.mark.parametrize("kind", kinds("controllers").values(), ids=kinds("controllers"))
def test_a_law_s_memory_has_the_declared_size_and_is_made_anew(kind):
    law = example(kind)
    at = next(situations(law, 1))
    one, other = (law.start(at.x, at.target, NONLINEAR) for _ in range(2))
    assert len(one) == sum(size for _, size in law.slots())
    assert not np.shares_memory(one, other)
    np.testing.assert_array_equal(one, other)
    before = one.copy()
    other += 1.0
    np.testing.assert_array_equal(law.start(at.x, at.target, NONLINEAR), before)


@every_kind
def test_every_logged_column_has_one_meaning(room, kind):
    loop = corrected(**{room[:-1]: example(kind)})
    own = Counter([*loop.actuator.states, *loop.actuator.signals])
    wide = {part.name: size for part, size in (dict(loop.controller.slots()) | own).items()}
    about = loop.about()
    for name, count in Counter(names(loop)).items():
        assert count == wide.get(name, 1), f"{name} is logged twice"
        if name not in TARGET[2:]:
            vector = name.startswith("W_hat") or name in POD_VECTORS
            assert bool(about[name].axes) == vector
            assert about[name] in signals(), f"`explain {name}` does not find it"


def test_every_vessel_has_the_same_constants_in_the_same_order():
    for vessel in VESSELS.values():
        assert tuple(vessel.constants()) == COEFFICIENTS
        assert vessel.source
        assert vessel.validity
        assert Vessel.model_validate(vessel.model_dump()) == vessel


def test_the_registry_is_sorted_and_leaves_out_what_has_no_kind():
    for room, base in ROOMS.items():
        found = registry.kinds(f"podusv_cli.components.{room}", base)
        assert list(found) == sorted(found)
        assert base not in found.values()
        assert all(kind.model_fields["kind"].default == name for name, kind in found.items())


FEEDBACK = [
    kind for kind in kinds("controllers").values() if not issubclass(kind, Manoeuvre | Schedule)
]


@pytest.mark.parametrize("kind", FEEDBACK, ids=lambda kind: kind.__name__)
def test_the_file_of_a_law_tells_its_source_what_is_proved_and_what_stops_windup(kind):
    module = inspect.getmodule(kind)
    told = " ".join(module.__doc__.split())
    for word in ("Source", "Proved", "Not proved:", "Anti-windup:"):
        assert word in told, word
    assert len(inspect.getsource(module).splitlines()) <= 150
