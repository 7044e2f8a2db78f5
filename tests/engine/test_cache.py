"""Machine code on disk: found again, and never older than the source it was made from."""

import errno
import json
import math
import multiprocessing
import os
import re
import shutil
import subprocess
import sys
from ctypes import CFUNCTYPE, c_double
from enum import Enum
from pathlib import Path
from threading import Thread
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from conftest import PACKAGE, Constant, adrift, example, kinds, run
from numba import njit

from podusv_cli.core.kernel import Vector, kernel, specialise
from podusv_cli.core.kinematics import wrap
from podusv_cli.engine.loop.closed_loop import nothing
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine import compile, object_cache
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.process import code_folder, workers

FORCE = 0.0


@kernel
def push(
    t: float,
    x: Vector,
    memory: Vector,
    target: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
    work: Vector,
) -> None:
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
    parts = [Plan(adrift(controller=law), TimeGrid(0.01, 1)).functions for law in laws]
    for part in ("sample", "after_saturation"):
        idle = {(k, names) for one in parts for p, k, names in one if p == part and is_idle(k)}
        assert len(idle) == 1


def is_idle(function: Any) -> bool:
    """Whether a kernel is the loop's own, which stands where a law has none."""
    return bool(function.__module__ == nothing.__module__)


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
    code = compile.compile_piece(compile.Piece(wrap, CFUNCTYPE(c_double, c_double)))
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
    ids=[
        "module",
        "numba",
        "float32",
        "complex",
        "tuple",
        "enumeration",
        "inside",
        "float",
        "table",
        "function",
    ],
)
def test_whatever_a_kernel_reads_is_in_the_fingerprint(variants):
    marks = {object_cache.fingerprint(variant) for variant in variants}
    assert len(marks) == len(variants)
    assert object_cache.fingerprint(calling(halved)) == object_cache.fingerprint(calling(halved))


ONE_TO_ONE = CFUNCTYPE(c_double, c_double)


def test_a_piece_that_is_damaged_or_anothers_is_made_anew(cache, monkeypatch):
    for function in (ready, doubled):
        assert compile.compile_piece(compile.Piece(function, ONE_TO_ONE))(2.5) == function(2.5)
    (path,), (other,) = (list(cache.rglob(f"{name}_*")) for name in ("ready", "doubled"))
    whole = path.read_bytes()
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
    for damaged in (b"", whole[:-1], whole[:300], flipped, whole + b".", other.read_bytes()):
        path.write_bytes(damaged)
        assert compile.compile_piece(compile.Piece(ready, ONE_TO_ONE))(2.5) == 2.5
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


@pytest.mark.parametrize("processes", [1, 2])
def test_what_is_missing_is_compiled_before_it_is_asked_for(cache, monkeypatch, processes):
    """By several processes where there is enough of it; what cannot be compiled stops nothing."""

    @kernel
    def listing(x: float) -> float:
        """The rules forbid this."""
        return float(len([x]))

    monkeypatch.setattr(compile, "available_workers", lambda: processes)
    monkeypatch.setattr(compile, "SHARE", 1)
    pieces = [compile.Piece(function, ONE_TO_ONE) for function in (listing, ready, doubled)]
    fractions: list[float] = []
    compile.prepare(pieces, fractions.append)
    assert fractions[0] == 0.0
    assert fractions[-1] == pytest.approx(1.0)
    assert fractions == sorted(fractions)
    assert [object_cache.is_cached(piece.name) for piece in pieces] == [False, True, True]
    monkeypatch.setattr(compile.Piece, "compile", lambda piece: pytest.fail("compiled again"))
    assert [compile.compile_piece(piece)(2.5) for piece in pieces[1:]] == [ready(2.5), doubled(2.5)]
    fractions.clear()
    compile.prepare(pieces[1:], fractions.append)
    assert not fractions


def _prepare_two() -> None:
    compile.prepare([compile.Piece(function, ONE_TO_ONE) for function in (ready, doubled)])


def test_a_worker_of_a_pool_which_may_start_no_process_compiles_by_itself(cache, monkeypatch):
    monkeypatch.setattr(workers, "usable_cores", lambda: 2)
    monkeypatch.setattr(compile, "SHARE", 1)
    with multiprocessing.get_context("fork").Pool(1) as pool:
        pool.apply(_prepare_two)
    assert object_cache.is_cached(compile.Piece(doubled, ONE_TO_ONE).name)


def test_a_full_disk_costs_time_only(cache, monkeypatch):
    def full(*paths: Any, **folders: Any) -> None:
        raise OSError("no space left on device")

    assert code_folder.code_folder(object_cache.translators())
    monkeypatch.setattr(os, "replace", full)
    assert compile.compile_piece(compile.Piece(ready, ONE_TO_ONE))(2.5) == 2.5
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
        compile.compile_piece(compile.Piece(allocating, ONE_TO_ONE))


# --- machine code on disk is never older than the source it was made from

SCRIPT = """
import json, sys
from pathlib import Path
import numpy as np
from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.components.paths.line import Line
from podusv_cli.components.vessels.vessel import Vessel

hull = Vessel(preset="box", length=1.0, beam=0.5, m=20.0, I_z=2.0, X_u=-1.0, Y_v=-2.0, N_r=-1.0)
start = (-4.0, -3.0, 0.2, 0.1, 0.0, 0.0)
loop = ClosedLoop(hull, hull, Line(), Calm(), Ideal(), Pid(), start)
for edit in sys.argv[1:]:  # of the source, behind the back of this process
    name, old, new = edit.split("|")
    Path(name).write_text(Path(name).read_text().replace(old, new))
fast, slow = (simulate(loop, TimeGrid(0.01, 50), compiled=c)["x"][-1] for c in (True, False))
print(json.dumps({"fast": fast, "slow": slow, "translated": "numba" in sys.modules}))
"""
FASTER = ("rate[0] = x[3] * cos_psi", "rate[0] = 2.0 * x[3] * cos_psi")


class Copy:
    """A copy of the package with its own cache and no shipped kernels, run in its own processes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.kinematics = folder / "podusv_cli/core/kinematics.py"
        self.cache = folder / "cache"
        shutil.copytree(
            PACKAGE,
            folder / "podusv_cli",
            ignore=shutil.ignore_patterns("__pycache__", "kernels.xz"),
        )

    def simulate(self, *edits: str) -> dict[str, Any]:
        paths = {"PYTHONPATH": str(self.folder), "PODUSV_CACHE": str(self.cache)}
        out = subprocess.run(
            [sys.executable, "-c", SCRIPT, *edits],
            cwd=self.folder,
            env=os.environ | paths,
            capture_output=True,
            text=True,
            check=True,
        )
        result: dict[str, Any] = json.loads(out.stdout)
        return result

    def edit(self, old: str, new: str) -> None:
        text = self.kinematics.read_text()
        assert old in text
        self.kinematics.write_text(text.replace(old, new))

    def files(self) -> set[tuple[str, int]]:
        return {(p.name, p.stat().st_mtime_ns) for p in self.cache.rglob("*.*")}


@pytest.fixture
def copy(tmp_path):
    return Copy(tmp_path)


@pytest.mark.slow
def test_a_comment_compiles_nothing_anew_and_a_changed_helper_is_noticed(copy):
    first = copy.simulate()
    made = copy.files()
    assert first["translated"]
    assert made
    again = copy.simulate()
    assert not again["translated"]
    assert copy.files() == made
    assert again["fast"] == first["fast"] == first["slow"]
    copy.edit("rate[0] = x[3]", "# A remark.\n    rate[0] = x[3]")
    assert not copy.simulate()["translated"]
    copy.edit(*FASTER)
    changed = copy.simulate()
    assert changed["fast"] == changed["slow"] != first["slow"]


@pytest.mark.slow
def test_code_compiled_after_its_source_was_edited_is_not_left_for_the_new_source(copy):
    # The process has imported the old source when the file changes under it.
    old = copy.simulate("|".join([str(copy.kinematics), *FASTER]))
    assert old["fast"] == old["slow"]
    new = copy.simulate()
    assert new["fast"] == new["slow"] != old["slow"]


def test_what_translates_is_in_the_digest_of_the_folder():
    """Whatever imports numba or llvmlite, but for what exports laws and keeps no code there."""
    files = {path for pattern in object_cache.TRANSLATORS for path in PACKAGE.glob(pattern)}
    marks = re.compile("^(from|import) (numba|llvmlite)", re.M)
    found = {path for path in PACKAGE.rglob("*.py") if marks.search(path.read_text())}
    assert len(found) > 2
    assert found <= files | {PACKAGE / "export/objects.py"}


def test_without_one_of_them_the_digest_is_another():
    for pattern in object_cache.TRANSLATORS:
        assert object_cache.translators((pattern,)) != object_cache.translators()


@pytest.mark.slow
def test_loading_takes_no_compiler_and_a_run_no_tables_or_plots(tmp_path):
    script = """
import sys
from podusv_cli.cli import main
try:
    main()
finally:
    print(*sys.modules, file=sys.stderr)
"""
    scenario = PACKAGE.parent / "configs/mu_2017/corrected.yaml"

    def modules(out: str) -> set[str]:
        words = ["run", str(scenario), "--set", "simulation.duration=1.0", "--no-figures"]
        done = subprocess.run(
            [sys.executable, "-c", script, *words, "--out", str(tmp_path / out)],
            check=True,
            capture_output=True,
            text=True,
        )
        return set(done.stderr.split())

    modules("first")  # fills the cache where it is empty
    heavy = {"numba", "pandas", "matplotlib", "scipy", "rich", "numpy.ma"}
    assert not modules("second") & heavy


def test_a_disk_that_takes_no_code_costs_time_and_nothing_else(tmp_path, monkeypatch):
    def full(path, code):
        raise OSError(errno.ENOSPC, "no space left on device")

    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path))
    monkeypatch.setattr(object_cache, "_write", full)
    monkeypatch.setattr(object_cache, "_load_code", lambda prototype, code: code)
    made = object_cache.Code("law", b"code")
    assert object_cache.load_or_translate(None, "law_that_is_not_kept", lambda: made) == made
