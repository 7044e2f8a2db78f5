"""Machine code on disk: found again, and never older than the source it was made from."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import PACKAGE, Constant, adrift, run

from podusv_cli.engine import compiling
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
from podusv_cli.engine.simulate import ClosedLoop, Observer, entries, simulate
from podusv_cli.paths.line import Line
from podusv_cli.vessels.vessel import Vessel

hull = Vessel(preset="box", length=1.0, beam=0.5, m=20.0, I_z=2.0, X_u=-1.0, Y_v=-2.0, N_r=-1.0)
start = (-4.0, -3.0, 0.2, 0.1, 0.0, 0.0)
loop = ClosedLoop(hull, hull, Line(), Calm(), Ideal(), Pid(), start)
for edit in sys.argv[1:]:  # of the source, behind the back of this process
    name, old, new = edit.split("|")
    Path(name).write_text(Path(name).read_text().replace(old, new))
fast, slow = (simulate(loop, TimeGrid(0.01, 50), compiled=c)["x"][-1] for c in (True, False))
from podusv_cli.engine import compiling
codes = [compiling.march(), *(compiling.entry(*part) for part in entries(loop, Observer()))]
hits = sum(sum(code.stats.cache_hits.values()) for code in codes)
print(json.dumps({"fast": fast, "slow": slow, "hits": hits, "codes": len(codes)}))
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
        return {(p.name, p.stat().st_mtime_ns) for p in self.cache.rglob("*.nb*")}


@pytest.fixture
def copy(tmp_path: Path) -> Copy:
    return Copy(tmp_path)


@pytest.mark.slow
def test_a_second_process_finds_the_code_and_a_changed_helper_is_noticed(copy: Copy) -> None:
    first = copy.simulate()
    made = copy.files()
    assert first["hits"] == 0
    assert made
    again = copy.simulate()
    assert again["hits"] == again["codes"]
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
    compiling.cache_folder.cache_clear()
    yield compiling.cache_folder
    compiling.cache_folder.cache_clear()


def test_a_cache_in_a_shared_folder_leaves_what_is_not_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh_folder: Any
) -> None:
    for number in range(compiling.KEPT + 4):
        (tmp_path / f"measurements-{number}").mkdir()
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path))
    assert fresh_folder() is not None
    assert len(list(tmp_path.glob("measurements-*"))) == compiling.KEPT + 4


def test_old_caches_are_forgotten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh_folder: Any
) -> None:
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path))
    for number in range(compiling.KEPT + 4):
        monkeypatch.setattr(compiling, "source_digest", lambda n=number: f"{n:016x}")
        fresh_folder.cache_clear()
        folder = fresh_folder()
        os.utime(folder, (number, number))
    fresh_folder.cache_clear()
    assert fresh_folder() == folder
    left = sorted(int(path.name, 16) for path in tmp_path.iterdir() if path.is_dir())
    assert left == list(range(compiling.KEPT + 4))[-compiling.KEPT - 1 :]


def test_a_folder_that_cannot_be_written_is_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh_folder: Any
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path / "file"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    assert fresh_folder() == tmp_path / "home/podusv" / compiling.source_digest()


def test_machine_code_is_what_the_kernel_computes() -> None:
    code = compiling.machine(wrap)
    for angle in np.random.default_rng(1).uniform(-50, 50, 100):
        assert code(angle) == wrap(angle)
