"""Machine code on disk is never older than the source it was made from."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import PACKAGE

from podusv_cli.engine.machine import object_cache

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
    """A copy of the package with its own cache, run in processes of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.kinematics = folder / "podusv_cli/core/kinematics.py"
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
    """Whatever imports numba or llvmlite, but for the thread that merely watches machine code."""
    files = {path for pattern in object_cache.TRANSLATORS for path in PACKAGE.glob(pattern)}
    marks = re.compile("^(from|import) (numba|llvmlite)", re.M)
    found = {path for path in PACKAGE.rglob("*.py") if marks.search(path.read_text())}
    assert len(found) > 2
    assert found <= files


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
