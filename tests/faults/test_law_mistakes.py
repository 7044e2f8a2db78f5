"""A mistake in somebody's own law is refused before the run: where it is, and what to write."""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from command_samples import BASE, write
from conftest import Constant, adrift

from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.errors import LawError
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.registry import kinds, scan_package
from podusv_cli.core.signal import Signal
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.check import check_law
from podusv_cli.engine.running.simulate import marcher
from podusv_cli.engine.step.grid import TimeGrid


def logged(name: str, *axes: str, fixed: bool = False) -> Signal:
    return Signal(name, "m", "a quantity of this law", axes=axes, fixed=fixed)


class Undeclared(Constant):
    signals: Any = ("my_error",)


class Text(Constant):
    signals: Any = "psi_e"


class Twice(Constant):
    signals: ClassVar[tuple[Signal, ...]] = (logged("u"),)


class Slots(Constant):
    def slots(self) -> Any:
        return (("my_integral", 1),)


class Wide(Constant):
    def slots(self) -> tuple[tuple[Signal, int], ...]:
        return ((logged("integral_u"), 2),)


class Fixed(Constant):
    def fixed_signals(self) -> Any:
        return {"my_centre": np.zeros(3)}


class Flat(Constant):
    def fixed_signals(self) -> dict[Signal, Vector]:
        return {logged("rbf_center", "node", "input", fixed=True): np.zeros(3)}


class Uneven(Constant):
    def fixed_signals(self) -> dict[Signal, Vector]:
        names = {"W_star_u": 3, "W_star_r": 4}
        return {logged(name, "node", fixed=True): np.zeros(n) for name, n in names.items()}


class Single(Constant):
    def fixed_signals(self) -> dict[Signal, Vector]:
        return {logged("my_number", fixed=True): np.array(3.0)}


class Axis(Constant):
    def fixed_signals(self) -> dict[Signal, Vector]:
        return {logged("my_row", "x", fixed=True): np.zeros(3)}


class Nothing(Constant):
    def fixed_signals(self) -> dict[Signal, Vector]:
        return {logged("my_row", "mode", fixed=True): np.zeros(0)}


class Starting(Constant):
    def start(self, x: Vector, target: Vector, nominal: Vessel) -> Vector:
        return np.full(1, {}["trim"])


class Worded(Constant):
    def constants_with(self, nominal: Vessel) -> dict[str, Any]:
        return {"surge": "much", "yaw": 0.0}


class Short(Constant):
    def table(self) -> Vector:
        return np.zeros(3, np.float32)  # type: ignore[return-value]


class Sampling(Constant):
    def sample_period(self) -> float:
        return 0.1

    @staticmethod
    @kernel
    def sample(t: float, x: Vector, memory: Vector, target: Vector, k: Any, table: Vector) -> None:
        memory[3] = 1.0


class Settling(Constant):
    def wants_loads(self) -> bool:
        return True


DECLARED: dict[type[Controller], str] = {
    Undeclared: "it declares 'my_error', which is no Signal; write Signal(\"my_error\", unit, "
    "meaning)",
    Text: "its signals are no tuple; write (Signal(...),)",
    Twice: "logs 'u', a quantity of this law [m], and the closed loop logs surge velocity [m/s] "
    "under this name; give one of them another name",
    Slots: "it declares 'my_integral', which is no Signal",
    Wide: "signal integral_u: its values have the shape (2,) at an instant and its axes are ()",
    Fixed: "it declares 'my_centre', which is no Signal",
    Flat: "signal rbf_center: its values have the shape (3,) at an instant and its axes are "
    "('node', 'input'); name one axis for each dimension",
    Uneven: "signal W_star_r: it has 4 values along 'node', and W_star_u has 3; name their axes "
    "differently",
    Single: "signal my_number: it is fixed and has no axis; name one",
    Axis: "signal my_row: its axis 'x' cannot stand in a log; choose another",
    Nothing: "signal my_row: its name or its shape (0,) cannot stand in a log; choose another",
    Worded: "its constant surge = 'much' is no named number",
    Short: "its table is no vector of float64; write np.array([1.0])",
}


def begun(loop: ClosedLoop) -> None:
    """All that is done before a run."""
    plan = Plan(loop, TimeGrid(0.01, 1))
    check_law(plan)
    marcher(plan, compiled=True)


def refused(law: type[Controller]) -> str:
    """Why a law is refused before its run."""
    with pytest.raises(LawError) as found:
        begun(adrift(controller=law()))
    assert found.value.exit_code == 2
    return str(found.value)


@pytest.mark.parametrize("law", DECLARED)
def test_what_it_declares_is_checked(law):
    line = _line(law.__name__)
    told = refused(law)
    assert told.startswith(f"law constant (test_law_mistakes.py, line {line}): ")
    assert DECLARED[law] in told


def _line(name: str) -> int:
    lines = Path(__file__).read_text().splitlines()
    return 1 + next(i for i, line in enumerate(lines) if line.startswith(f"class {name}("))


ASKED: dict[type[Controller], str] = {
    Starting: "KeyError: 'trim' (test_law_mistakes.py, line ",
    Sampling: "IndexError: index 3 is out of bounds for axis 0 with size 0 (test_law_mistakes.py, ",
}


@pytest.mark.parametrize("law", ASKED)
def test_all_its_functions_are_asked(law):
    place = f"law constant (test_law_mistakes.py, line {_line(law.__name__)})"
    assert refused(law).startswith(f"{place}, evaluated once before the run: {ASKED[law]}")


def test_a_kernel_that_is_not_there_is_named():
    place = f"law constant (test_law_mistakes.py, line {_line('Settling')})"
    assert refused(Settling).startswith(f"{place}: no kernel `after_saturation`; write one below")


def test_a_kernel_that_is_a_method_is_told_what_it_lacks():
    class Bound(Constant):
        law = kernel(lambda self, tau: None)  # type: ignore[assignment]

    assert "is a method; write @staticmethod above it" in refused(Bound)


def helper(t: float) -> float:
    """Not marked as a kernel."""
    return 2.0 * t


def no_kernel(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def]
    tau[0] = tau[1] = 0.0


@kernel
def helped(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def]
    tau[0] = helper(t)
    tau[1] = 0.0


@kernel
def slicing(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def]
    tau[:] = 0.0


@kernel
def numpy_inside(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def]
    tau[0] = np.dot(x, x)
    tau[1] = 0.0


@kernel
def allocating(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def]
    both = np.array([x[0], x[1]])
    tau[0] = tau[1] = both[0]


@kernel
def raising(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def]
    tau[0] = tau[1] = 0.0
    if t > math.pi:
        raise ValueError("late")


@kernel
def text(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def]
    tau[0] = tau[1] = "much"


COMPILED: dict[Callable[..., None], str] = {
    no_kernel: "no_kernel is no kernel; write @kernel above it",
    helped: "test_law_mistakes.py, line {2}: helper is no kernel; write @kernel above it",
    slicing: "test_law_mistakes.py, line {2}: a slice: take tail(vector, n), or a loop",
    numpy_inside: "test_law_mistakes.py, line {2}: np.dot: numpy works on arrays; take math",
    allocating: "test_law_mistakes.py, line {2}: a list: take variables, or scratch(n)",
    raising: "test_law_mistakes.py, line {4}: raise: machine code knows no errors; write a number",
    text: "Cannot cast Literal[str](much) to float64",
}


@pytest.mark.parametrize("inner", COMPILED)
def test_what_cannot_become_machine_code_is_its_kernels_fault(inner):
    class Own(Constant):
        law = staticmethod(inner)

    line, told = inner.__code__.co_firstlineno, refused(Own)
    place = (
        f"kernel {inner.__name__} (test_law_mistakes.py, line {line}) cannot become machine code"
    )
    assert told.startswith(f"{place}: ")
    assert COMPILED[inner].replace("{2}", str(line + 2)).replace("{4}", str(line + 4)) in told
    assert ("a kernel is marked with @kernel" in told) == (inner is text)
    assert "\n" not in told


def test_a_command_refuses_it_in_a_line(podusv, monkeypatch):
    monkeypatch.setattr(Pid, "signals", (*Pid.signals, "my_error"))
    for command in ("run", "compare", "verify"):
        said = podusv(command, write("a.yaml", BASE), "--out", "x")
        assert (said.code, said.out) == (2, "")
        assert "law pid (pid.py, line" in said.err
        assert "it declares 'my_error', which is no Signal; write Signal(" in said.err
        assert said.err.count("\n") == 1
        assert not Path("x").exists()


PID = "podusv_cli.components.controllers.pid"
IMPORTED = {
    "def (": "own_laws.mine cannot be imported: SyntaxError: invalid syntax (mine.py, line 1)",
    # No import: where one is wrapped, as by some debuggers, that wrapper is the last place.
    "gain = nothing_of_this_name": "own_laws.mine cannot be imported: NameError: name "
    "'nothing_of_this_name' is not defined (mine.py, line 1)",
    f"from {PID} import Pid\nclass Mine(Pid):\n    kind: str = 'mine'": (
        'own_laws.mine.Mine: its kind is no fixed word; write kind: Literal["mine"] = "mine"'
    ),
    f"from {PID} import Pid\nclass Mine(Pid): pass": (
        f"own_laws.mine.Mine: its kind pid is that of {PID}, too; take another name"
    ),
}


@pytest.mark.parametrize("text", IMPORTED)
def test_a_file_that_cannot_be_imported_is_named(tmp_path, monkeypatch, text):
    package = tmp_path / "own_laws"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "mine.py").write_text(text + "\n")
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("own_laws", "own_laws.mine"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    scan_package.cache_clear()  # the package has other content now
    with pytest.raises(LawError) as found:
        kinds("own_laws", Controller)
    assert str(found.value) == IMPORTED[text]
