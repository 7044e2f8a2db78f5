"""Kernels that would compute from what happens to be in memory are refused; sound ones are not."""

from __future__ import annotations

import ast
import importlib
import pkgutil
from collections.abc import Iterator
from functools import partial
from types import FunctionType
from typing import Any

import pytest

import podusv_cli
from podusv_cli.core.errors import LawError
from podusv_cli.core.kernel import _globals_read, is_kernel, kernel
from podusv_cli.engine.machine.kernel_faults import (
    check_arguments,
    check_kernel,
    faults,
    unsupported_construct,
)
from podusv_cli.engine.machine.kernel_source import has_source, source

SOUND = {
    "set in both branches": "if x[0] > 0.0:\n q = 1.0\nelse:\n q = 2.0\ny = q",
    "the other branch returns": "if x[0] > 0.0:\n return\nelse:\n q = 2.0\ny = q",
    "set before": "q = 0.0\nif x[0] > 0.0:\n q = 1.0\ny = q",
    "a loop with rounds": "for i in range(3):\n q = x[i]\ny = q + i",
    "a loop that is left once it is set": "while True:\n q = x[0]\n if q > 1.0:\n  break\ny = q",
    "set before each continue": "for i in range(2):\n q = x[i]\n if q > 0.0:\n  continue\ny = q",
    "an assignment in a condition": "if (q := x[0]) > 0.0:\n y = q",
    "a condition that is always true": "if True:\n q = x[0]\ny = q",
    "a loop downwards": "for i in range(2, -1, -1):\n q = x[i]\ny = q",
    "a count of the module": "for i in range(COUNT):\n q = x[i]\ny = q",
    "numbers of the module": "for q in PAIR:\n y = q\ny = q",
    "a number with its kind": "q: float = x[0]\ny = q",
    "a variable of a generator": "y = sum(x[j] for j in range(3))",
    "an index from the front": "y = x[5 - 1]",
    "the end of a tuple": "pair = (x[0], x[1])\ny = pair[-1]",
}
UNSET = {
    "one branch": "if x[0] > 0.0:\n q = 1.0\ny = q",
    "elif without else": "if x[0] > 0.0:\n q = 1.0\nelif x[1] > 0.0:\n q = 2.0\ny = q",
    "a loop that need not run": "while x[0] > 9.0:\n q = x[0]\ny = q",
    "a count that need not run": "n = int(x[0])\nfor i in range(n):\n q = x[i]\ny = q",
    "a loop left before": "for i in range(3):\n if x[i] > 0.0:\n  break\n q = x[i]\ny = q",
    "a round passed over": "for i in range(3):\n if x[i] > 0.0:\n  continue\n q = x[i]\ny = q",
    "a kind without a number": "if x[0] > 0.0:\n q: float\nelse:\n q = 1.0\ny = q",
    "no rounds at all": "for i in range(0):\n q = 1.0\ny = q",
    "added to": "if x[0] > 0.0:\n q = 1.0\nq += 1.0",
    "read in its own assignment": "y = (q := q + x[0])",
    "read in its own loop": "for i in range(3):\n if x[i] > 0.0:\n  y = q\n q = x[i]",
}


def found(body: str) -> list[tuple[int, str]]:
    lines = "".join(f"    {line}\n" for line in body.splitlines())
    (node,) = ast.parse(f"def kernel(x):\n{lines}").body
    assert isinstance(node, ast.FunctionDef)
    return list(faults(node, {"COUNT": 2, "PAIR": (1.0, 2.0), "LAST": -1}))


@pytest.mark.parametrize("body", SOUND.values(), ids=list(SOUND))
def test_a_sound_kernel_passes(body: str) -> None:
    assert found(body) == []


@pytest.mark.parametrize("body", UNSET.values(), ids=list(UNSET))
def test_a_variable_that_may_be_unset_is_named_with_its_line(body: str) -> None:
    (fault,) = found(body)
    line = 2 + next(i for i, text in enumerate(body.splitlines()) if reads_q(text))
    assert fault[0] == line
    assert fault[1].startswith("q may have no value here")


def reads_q(text: str) -> bool:
    return text.strip() in ("y = q", "q += 1.0", "y = (q := q + x[0])")


@pytest.mark.parametrize(
    "body", ["y = x[-1]", "y = x[LAST]", "y = tail(x, 1)[-2]", "v = tail(x, 2)\ny = v[-1]"]
)
def test_every_index_from_the_end_of_a_vector_is_found(body: str) -> None:
    (fault,) = found(body)
    assert "counts from the end" in fault[1]


def test_an_index_from_the_end_of_a_vector_is_named() -> None:
    assert found("y = x[0]\ny = x[-1]") == [
        (
            3,
            "x[-1] counts from the end, and a kernel does not know where a vector ends; count from "
            "the front",
        )
    ]


def shipped() -> Iterator[Any]:
    """Every kernel of podusv that is in a file."""
    for part in pkgutil.walk_packages(podusv_cli.__path__, "podusv_cli."):
        if not part.name.endswith("__main__"):
            module = vars(importlib.import_module(part.name))
            classes = [thing for thing in module.values() if isinstance(thing, type)]
            inner = [getattr(f, "__func__", f) for cls in classes for f in vars(cls).values()]
            for thing in (*module.values(), *inner):
                if isinstance(thing, FunctionType) and is_kernel(thing) and has_source(thing):
                    yield thing


def test_no_kernel_of_podusv_has_such_a_fault() -> None:
    """Kernels from outside are looked at before they are compiled; these here."""
    kernels = set(shipped())
    assert len(kernels) > 200
    told = {
        kernel.__qualname__: list(faults(source(kernel), kernel.__globals__)) for kernel in kernels
    }
    assert {name: found for name, found in told.items() if found} == {}


square = kernel(lambda a: a * a)


@kernel
def deeper(n: float) -> float:
    """It calls itself, which plain Python can."""
    return 1.0 if n < 1.0 else deeper(n - 1.0)


@kernel
def harmless(a: float) -> float:
    """It calls a lambda."""
    return float(square(a))


def test_kernels_that_have_no_source_or_call_themselves_are_looked_at_as_far_as_may_be() -> None:
    made: dict[str, Any] = {"kernel": kernel}
    exec("@kernel\ndef plain(a):\n    return a", made)  # noqa: S102  as a notebook may
    for one in (square, harmless, deeper, made["plain"], partial(harmless, 1.0)):
        check_kernel(one)
    assert unsupported_construct(deeper) == "deeper calls itself; write a loop"


@kernel
def writing(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def]
    tau[0] = x[2]
    if t > 1.0:
        x[2] += 1.0


def test_an_argument_that_may_only_be_read_is_not_written_at_any_time() -> None:
    with pytest.raises(LawError, match=r"it writes x\[2\], which it may only read"):
        check_arguments(writing, ("x", "memory", "target", "table"))
    check_arguments(writing, ("memory", "target", "table"))


def test_the_globals_of_code_are_those_of_its_instructions():
    """With more than 128 names, too, where an argument needs two instructions."""
    names = [f"name_{i}" for i in range(300)]
    code = compile(" + ".join(f"{name}.of.{name}" for name in names), "", "eval")
    inside = compile("lambda: " + " + ".join(names), "", "eval").co_consts[0]
    assert _globals_read(inside) == set(names)
    assert _globals_read(code) == set()  # read by name, not from globals
