"""What every registered component promises, asked of each by being registered."""

import inspect
import math
from collections import Counter
from collections.abc import Iterator
from importlib import import_module

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
from podusv_cli.core.kernel import is_kernel
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.scenario.explain import signals
from podusv_cli.testing import is_finite, keeps_its_declaration, remembers_nothing

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


@every_kind
@pytest.mark.parametrize("check", [keeps_its_declaration, is_finite, remembers_nothing])
def test_podusv_s_own_keep_the_contract_of_plug_ins(room, kind, check):
    """Its other checks, of runs: test_testing_seeing.py and faults/test_determinism.py."""
    if kind is not Exact:  # which has no kernel
        check(example(kind))


@every_kind
def test_the_kernels_are_marked_for_the_compiler(room, kind):
    component = example(kind)
    if component == Exact():  # nothing is called
        return
    assert is_kernel(getattr(kind, KERNELS[room]))
    assert room != "estimators" or is_kernel(kind.correct)
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
        if isinstance(thing, type)
        and issubclass(thing, base)
        and "kind" in thing.model_fields
        and thing.__module__ == f"podusv_cli.components.{room}.{path.stem}"
    ]
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
    own = NONLINEAR.constants() | law.constants()  # a law may derive more from both
    assert own.items() <= law.constants_with(NONLINEAR).items()


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
    for name, count in Counter(Plan(loop, TimeGrid(0.01, 1)).names).items():
        assert count == wide.get(name, 1), f"{name} is logged twice"
        if name not in TARGET[2:] and (loop.has_target or name != "z_e"):
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
    # The formatter gives the one signature of all laws ten lines.
    assert len(inspect.getsource(module).splitlines()) <= 160
