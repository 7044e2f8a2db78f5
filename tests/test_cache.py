"""Machine code on disk: found again, and never older than the source it was made from."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
from ctypes import CFUNCTYPE, c_double
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest
from conftest import PACKAGE, Constant, adrift, run

from podusv_cli.engine import compiling, machine_code
from podusv_cli.kernels import Vector, kernel, specialise
from podusv_cli.kinematics import wrap

SCRIPT = """
import json, sys
from pathlib import Path
import numpy as np
from podusv_cli.actuators.ideal import Ideal
from podusv_cli.controllers.pid import Pid
from podusv_cli.disturbances.calm import Calm
from podusv_cli.engine.grid import TimeGrid
from podusv_cli.engine.simulate import ClosedLoop, simulate
from podusv_cli.paths.line import Line
from podusv_cli.vessels.vessel import Vessel

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
    """A copy of the package with its own cache, run in processes of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.kinematics = folder / "podusv_cli/kinematics.py"
        self.cache = folder / "cache"
        shutil.copytree(
            PACKAGE, folder / "podusv_cli", ignore=shutil.ignore_patterns("__pycache__")
        )

    def simulate(self, *edits: str) -> dict[str, Any]:
        paths = {"PYTHONPATH": str(self.folder), "PODUSV_CACHE": str(self.cache)}
        out = subprocess.run(
            [sys.executable, "-c", SCRIPT, *edits], cwd=self.folder, env=os.environ | paths,
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        result: dict[str, Any] = json.loads(out.stdout)
        return result

    def edit(self, old: str, new: str) -> None:
        text = self.kinematics.read_text()
        assert old in text
        self.kinematics.write_text(text.replace(old, new))

    def files(self) -> set[tuple[str, int]]:
        return {(p.name, p.stat().st_mtime_ns) for p in self.cache.rglob("*.*")}


@pytest.fixture
def copy(tmp_path: Path) -> Copy:
    return Copy(tmp_path)


@pytest.mark.slow
def test_a_second_process_finds_the_code_and_a_changed_helper_is_noticed(copy: Copy) -> None:
    first = copy.simulate()
    made = copy.files()
    assert first["translated"]
    assert made
    again = copy.simulate()
    assert not again["translated"]
    assert copy.files() == made
    assert again["fast"] == first["fast"] == first["slow"]
    copy.edit(*FASTER)
    changed = copy.simulate()
    assert changed["fast"] == changed["slow"] != first["slow"]


@pytest.mark.slow
def test_code_compiled_after_its_source_was_edited_is_not_left_for_the_new_source(
    copy: Copy,
) -> None:
    # The process has imported the old source when the file changes under it.
    old = copy.simulate("|".join([str(copy.kinematics), *FASTER]))
    assert old["fast"] == old["slow"]
    new = copy.simulate()
    assert new["fast"] == new["slow"] != old["slow"]


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


def test_kernels_of_the_same_name_are_not_taken_for_each_other() -> None:
    for force in (1.0, 7.0):
        out = run(adrift(controller=constant_law(force)), 0.05)
        np.testing.assert_array_equal(out["tau_u_cmd"], force)


def test_kernels_that_read_different_constants_are_not_taken_for_each_other() -> None:
    class Padded(Constant):
        offset: float = 0.0

        def informed(self, nominal: Any) -> dict[str, float]:
            return {"offset": 9.0} | super().informed(nominal)

    for law in (Constant(surge=2.0), Padded(surge=2.0)):
        out = run(adrift(controller=law), 0.05)
        np.testing.assert_array_equal(out["tau_u_cmd"], 2.0)


@pytest.fixture
def fresh_folder() -> Any:
    machine_code.cache_folder.cache_clear()
    yield machine_code.cache_folder
    machine_code.cache_folder.cache_clear()


def test_a_cache_in_a_shared_folder_leaves_what_is_not_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh_folder: Any
) -> None:
    for number in range(machine_code.KEPT + 4):
        (tmp_path / f"measurements-{number}").mkdir()
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path))
    assert fresh_folder() is not None
    assert len(list(tmp_path.glob("measurements-*"))) == machine_code.KEPT + 4


def test_old_caches_are_forgotten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh_folder: Any
) -> None:
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path))
    for number in range(machine_code.KEPT + 4):
        monkeypatch.setattr(machine_code, "source_digest", lambda n=number: f"{n:016x}")
        fresh_folder.cache_clear()
        folder = fresh_folder()
        os.utime(folder, (number, number))
    fresh_folder.cache_clear()
    assert fresh_folder() == folder
    left = sorted(int(path.name, 16) for path in tmp_path.iterdir() if path.is_dir())
    assert left == list(range(machine_code.KEPT + 4))[-machine_code.KEPT - 1 :]


def test_a_folder_that_cannot_be_written_is_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh_folder: Any
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path / "file"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    assert fresh_folder() == tmp_path / "home/podusv" / machine_code.source_digest()


def test_machine_code_is_what_the_kernel_computes() -> None:
    code = compiling.compiled(wrap, CFUNCTYPE(c_double, c_double))
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


SHIFT = np.array([1.0, 2.0])


@kernel
def shifted(x: float) -> float:
    """A number out of a table."""
    return x + float(SHIFT[1])


def test_what_a_name_stands_for_is_in_the_fingerprint() -> None:
    """The same code, with other kernels, functions or tables behind its names."""
    variants = [
        one_after_the_other,
        specialise(one_after_the_other, "one_after_the_other", ready=doubled),
        specialise(one_after_the_other, "one_after_the_other", ready=halved),
        specialise(one_after_the_other, "one_after_the_other", ready=math.sin),
        specialise(one_after_the_other, "one_after_the_other", ready=math.cos),
        shifted,
        specialise(shifted, "shifted", SHIFT=np.array([1.0, 3.0])),
        specialise(ready, "ready", FORCE=1.0),
        specialise(ready, "ready", FORCE=2.0),
    ]
    marks = [machine_code.fingerprint(variant) for variant in variants]
    assert len(set(marks)) == len(variants)
    again = specialise(one_after_the_other, "one_after_the_other", ready=halved)
    assert machine_code.fingerprint(again) == marks[2]


def pieces(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


ONE_TO_ONE = CFUNCTYPE(c_double, c_double)


def test_a_damaged_piece_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh_folder: Any
) -> None:
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path))
    assert compiling.compiled(ready, ONE_TO_ONE)(2.5) == 2.5
    (path,) = tmp_path.rglob("ready_*")
    whole = path.read_bytes()
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
    for damaged in (b"", whole[:-1], whole[:300], flipped, whole + b"."):
        path.write_bytes(damaged)
        assert compiling.compiled(ready, ONE_TO_ONE)(2.5) == 2.5
        assert machine_code._read(path) is not None


def test_pieces_are_whole_when_several_processes_write_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh_folder: Any
) -> None:
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path))
    code = machine_code.Code("symbol", bytes(range(256)) * 4000)
    path = tmp_path / "piece"
    torn = []

    def write() -> None:
        for _ in range(20):
            machine_code._write(path, code)
            torn.append(machine_code._read(path) != code)

    threads = [Thread(target=write) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(torn) == 80
    assert not any(torn)
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_costs_time_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh_folder: Any
) -> None:
    def full(*paths: Any) -> None:
        raise OSError("no space left on device")

    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path))
    monkeypatch.setattr(os, "replace", full)
    assert compiling.compiled(ready, ONE_TO_ONE)(2.5) == 2.5
    assert not pieces(tmp_path)


def test_another_processor_or_version_gets_a_piece_of_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    here = machine_code.fingerprint(ready)
    assert machine_code.fingerprint(ready) == here
    monkeypatch.setattr(machine_code, "_circumstances", lambda: ("another processor",))
    assert machine_code.fingerprint(ready) != here


def test_a_kernel_that_allocates_is_refused_and_not_left_to_end_the_process() -> None:
    @kernel
    def allocating(x: float) -> float:
        """The rules forbid this."""
        room = np.zeros(int(x))
        return float(room[0])

    with pytest.raises(TypeError, match=r"allocating needs \w+: kernels allocate"):
        compiling.compiled(allocating, ONE_TO_ONE)


def test_rooms_whose_source_is_left_out_of_the_digest_hold_no_kernel() -> None:
    for room in machine_code.APART:
        apart = PACKAGE / room
        assert apart.exists()
        for path in apart.rglob("*.py") if apart.is_dir() else [apart]:
            text = path.read_text()
            assert "@kernel" not in text, path
            assert "specialise(" not in text, path


def test_loading_takes_no_compiler_and_a_run_no_tables_or_plots(tmp_path: Path) -> None:
    script = """
import sys
from podusv_cli.cli import main
try:
    main()
finally:
    print(*sys.modules, file=sys.stderr)
"""
    scenario = PACKAGE.parent / "configs/paper/corrected.yaml"

    def modules(out: str) -> set[str]:
        words = ["run", str(scenario), "--set", "simulation.duration=1.0", "--no-figures"]
        done = subprocess.run(
            [sys.executable, "-c", script, *words, "--out", str(tmp_path / out)],
            check=True, capture_output=True, text=True,
        )  # fmt: skip
        return set(done.stderr.split())

    modules("first")  # fills the cache where it is empty
    heavy = {"numba", "pandas", "matplotlib", "scipy", "rich", "numpy.ma"}
    assert not modules("second") & heavy
