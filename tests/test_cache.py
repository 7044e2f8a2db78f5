"""Machine code on disk: found again, and never older than the source it was made from."""

import math
import os
from ctypes import CFUNCTYPE, c_double
from enum import Enum
from threading import Thread
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from conftest import Constant, adrift, example, kinds, run
from numba import njit

from podusv_cli.core.kernel import Vector, kernel, specialise
from podusv_cli.core.kinematics import wrap
from podusv_cli.engine.loop.closed_loop import Observer, entries
from podusv_cli.engine.machine import code_folder, compile, object_cache

FORCE = 0.0


@kernel
def push(
    t: float, x: Vector, memory: Vector, target: Vector, k: Any, table: Vector,
    tau: Vector, rate: Vector, signals: Vector, work: Vector,
) -> None:  # fmt: skip
    """FORCE, whatever happens."""
    tau[0] = FORCE
    tau[1] = 0.0


def constant_law(force: float) -> Constant:
    """Two of these have kernels of one name in one module that differ in a number they read."""
    same_name = specialise(push, "push", FORCE=force)
    law: type[Constant] = type("Pushing", (Constant,), {"law": staticmethod(same_name)})
    return law()


def test_kernels_of_the_same_name_are_not_taken_for_each_other():
    for force in (1.0, 7.0):
        out = run(adrift(controller=constant_law(force)), 0.05)
        np.testing.assert_array_equal(out["tau_u_cmd"], force)


def test_what_does_nothing_has_the_same_code_for_every_law():
    """Laws without samples, and that do not hear of limits, whose constants differ."""
    laws = (example(kind) for kind in kinds("controllers").values())
    parts = [list(entries(adrift(controller=law), Observer())) for law in laws]
    for part in ("sample", "after_saturation"):
        idle = {(k, names) for one in parts for p, k, names in one if p == part and is_idle(k)}
        assert len(idle) == 1


def is_idle(function: Any) -> bool:
    """Whether a kernel is the loop's own, which stands where a law has none."""
    return bool(function.__module__ == entries.__module__)


def test_kernels_that_read_different_constants_are_not_taken_for_each_other():
    class Padded(Constant):
        offset: float = 0.0

        def constants_with(self, nominal: Any) -> dict[str, float]:
            return {"offset": 9.0} | super().constants_with(nominal)

    for law in (Constant(surge=2.0), Padded(surge=2.0)):
        out = run(adrift(controller=law), 0.05)
        np.testing.assert_array_equal(out["tau_u_cmd"], 2.0)


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """The folder where code is kept, empty."""
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path))
    code_folder.code_folder.cache_clear()
    yield tmp_path
    code_folder.code_folder.cache_clear()


def test_machine_code_is_what_the_kernel_computes():
    code = compile.compiled(wrap, CFUNCTYPE(c_double, c_double))
    for angle in np.random.default_rng(1).uniform(-50, 50, 100):
        assert code(angle) == wrap(angle)


@kernel
def ready(x: float) -> float:
    """A number that is not there before it is asked for."""
    return x + FORCE


@kernel
def doubled(x: float) -> float:
    """Twice x."""
    return 2.0 * x


@kernel
def halved(x: float) -> float:
    """Half of x."""
    return 0.5 * x


@kernel
def one_after_the_other(x: float) -> float:
    """Stand-ins that `specialise` replaces."""
    return doubled(x) + halved(x) + ready(x)


def calling(function: Any) -> Any:
    """The kernel that calls another, with this one in the other's place."""
    return specialise(one_after_the_other, "one_after_the_other", ready=function)


SHIFT = np.array([1.0, 2.0])
SETTINGS = ModuleType("settings")


@kernel
def shifted(x: float) -> float:
    """A number out of a table."""
    return x + float(SHIFT[1])


@kernel
def tuned(x: float) -> float:
    """A number of a module, and one of a module in it."""
    module = SETTINGS
    return x * module.GAIN + SETTINGS.inner.OFFSET


@kernel
def tuned_twice(x: float) -> float:
    """The module's numbers are read by a kernel and by the one that it calls."""
    return tuned(x) * SETTINGS.OTHER


def settings(gain: object = 1.0, offset: float = 1.0, other: float = 1.0) -> ModuleType:
    """A module with these numbers."""
    module, module.inner = ModuleType("settings"), ModuleType("inner")
    module.GAIN, module.inner.OFFSET, module.OTHER = gain, offset, other
    return module


def tuned_by(**numbers: Any) -> Any:
    """The kernels that read the module, with these numbers in it."""
    inner = specialise(tuned, "tuned", SETTINGS=settings(**numbers))
    return specialise(tuned_twice, "tuned_twice", tuned=inner, SETTINGS=settings(**numbers))


class Slow(Enum):
    """An enumeration of the same name as another."""

    PACE = 1


Fast = Enum("Slow", {"PACE": 2}, module=__name__)


@pytest.mark.parametrize(
    "variants",
    [
        [tuned_by(), tuned_by(gain=2.0), tuned_by(offset=2.0), tuned_by(other=2.0)],
        [tuned_by(gain=njit(doubled)), tuned_by(gain=njit(halved))],
        [specialise(ready, "ready", FORCE=np.float32(n)) for n in (1, 2)],
        [specialise(ready, "ready", FORCE=complex(n)) for n in (1, 2)],
        [specialise(ready, "ready", FORCE=(1.0, np.arange(2000.0) == n)) for n in (900, 901)],
        [specialise(ready, "ready", FORCE=mode) for mode in (Slow, Fast)],
        [eval(f"lambda x: (lambda y: {n} * y)(x)") for n in (2, 3)],
        [specialise(ready, "ready", FORCE=n) for n in (1.0, 2.0)],
        [specialise(shifted, "shifted", SHIFT=np.array([1.0, n])) for n in (2.0, 3.0)],
        [calling(ready), calling(doubled), calling(halved), calling(math.sin), calling(math.cos)],
    ],
    ids=["module", "numba", "float32", "complex", "tuple", "enumeration", "inside", "float",
         "table", "function"],
)  # fmt: skip
def test_whatever_a_kernel_reads_is_in_the_fingerprint(variants):
    marks = {object_cache.fingerprint(variant) for variant in variants}
    assert len(marks) == len(variants)
    assert object_cache.fingerprint(calling(halved)) == object_cache.fingerprint(calling(halved))


ONE_TO_ONE = CFUNCTYPE(c_double, c_double)


def test_a_piece_that_is_damaged_or_anothers_is_made_anew(cache, monkeypatch):
    for function in (ready, doubled):
        assert compile.compiled(function, ONE_TO_ONE)(2.5) == function(2.5)
    (path,), (other,) = (list(cache.rglob(f"{name}_*")) for name in ("ready", "doubled"))
    whole = path.read_bytes()
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
    for damaged in (b"", whole[:-1], whole[:300], flipped, whole + b".", other.read_bytes()):
        path.write_bytes(damaged)
        assert compile.compiled(ready, ONE_TO_ONE)(2.5) == 2.5
        assert object_cache._read(path) is not None


def test_pieces_are_whole_when_several_processes_write_them(cache, monkeypatch):
    code = object_cache.Code("symbol", bytes(range(256)) * 4000)
    path = cache / "piece"
    torn = []

    def write() -> None:
        for _ in range(20):
            object_cache._write(path, code)
            torn.append(object_cache._read(path) != code)

    threads = [Thread(target=write) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(torn) == 80
    assert not any(torn)
    assert list(cache.iterdir()) == [path]


def test_a_full_disk_costs_time_only(cache, monkeypatch):
    def full(*paths: Any, **folders: Any) -> None:
        raise OSError("no space left on device")

    assert code_folder.code_folder(object_cache.translators())
    monkeypatch.setattr(os, "replace", full)
    assert compile.compiled(ready, ONE_TO_ONE)(2.5) == 2.5
    assert [path.name for path in cache.rglob("*.*")] == [code_folder.MARK]


def test_another_processor_or_version_gets_a_piece_of_its_own(monkeypatch):
    here = object_cache.fingerprint(ready)
    assert object_cache.fingerprint(ready) == here
    monkeypatch.setattr(object_cache, "_circumstances", lambda: ("another processor",))
    assert object_cache.fingerprint(ready) != here


def test_a_kernel_that_allocates_is_refused_and_not_left_to_end_the_process():
    @kernel
    def allocating(x: float) -> float:
        """The rules forbid this."""
        room = np.zeros(int(x))
        return float(room[0])

    with pytest.raises(TypeError, match=r"allocating needs \w+, which is no function"):
        compile.compiled(allocating, ONE_TO_ONE)
