"""Laws from files side by side: files that change or are gone, and loops of laws."""

from __future__ import annotations

import importlib.util
import linecache
import threading
from pathlib import Path

import numpy as np
import pytest
from plugin_samples import LAW
from plugin_samples import SCENARIO as SCENARIO_OF_LAW
from test_lanes import same

from benchmarks.variants import variants
from podusv_cli.core.kernel import LANES
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine.kernel_source import OtherSource, source
from podusv_cli.engine.running.batch import simulate_many
from podusv_cli.engine.running.lanes import why_alone
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.scenario.load import load

TEXT = """
from podusv_cli.core.kernel import kernel

@kernel
def twice(x):
    return 0.5 * x + x
"""
ENDLESS = """
        rest = abs(x[3])
        while rest > 1.0:
            rest *= 0.5
        tau[1] += rest
        if x[0] < 0.0 and x[3] > 0.3 and x[int(x[0] > -5.0)] < 0.0:
            tau[0] += 1.0
"""


@pytest.mark.parametrize(("old", "new"), [("x + x", "x - x"), ("0.5", "0.75"), ("0.5 *", "1 *")])
def test_a_file_that_was_edited_is_not_read(tmp_path: Path, old: str, new: str) -> None:
    """Its kernel may be another one by now than the one that is loaded."""
    path = tmp_path / "edited.py"
    path.write_text(TEXT)
    spec = importlib.util.spec_from_file_location("edited", path)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert source(module.twice).name == "twice"
    path.write_text(TEXT.replace(old, new))
    linecache.checkcache()
    with pytest.raises(OtherSource, match=r"edited.py was edited since twice was loaded"):
        source(module.twice)


def test_a_plug_in_whose_file_is_gone_marches_side_by_side(tmp_path: Path) -> None:
    """A study keeps the text of its plug-ins, so it needs none of their files."""
    (tmp_path / "laws").mkdir()
    law, config = tmp_path / "laws/my_law.py", tmp_path / "mine.yaml"
    law.write_text(f"{LAW}# {tmp_path}\n")  # so that no other test has loaded it
    config.write_text(SCENARIO_OF_LAW)
    written = load(config).scenario.singles()["cross_track"]
    law.unlink()
    linecache.checkcache()
    assert why_alone(Plan(written.closed_loop(), TimeGrid(0.01, 1))) == ""


def test_a_run_that_has_diverged_holds_up_no_loop_of_the_others(tmp_path: Path) -> None:
    """Its state is not finite any more, and a law's `while` need not end for that.

    The others have the bits of runs alone; the second part of a condition of three decides in them.
    """
    (tmp_path / "laws").mkdir()
    (tmp_path / "laws/my_law.py").write_text(f"{LAW}{ENDLESS}")
    (tmp_path / "mine.yaml").write_text(SCENARIO_OF_LAW)
    base = load(tmp_path / "mine.yaml").scenario.closed_loop()
    speeds, grid = [1e301, *np.linspace(0.1, 0.5, LANES - 1)], TimeGrid(0.01, 20)
    before = set(threading.enumerate())
    loops = variants(base, {"start.u": speeds})
    done = simulate_many(loops, grid, side_by_side=True)
    same(done, simulate_many(loops, grid, side_by_side=False))
    assert done.status.tolist() == ["diverged", *["finished"] * (LANES - 1)]
    for thread in set(threading.enumerate()) - before:
        thread.join(5.0)  # s; the batch's own thread ends by itself
    assert set(threading.enumerate()) <= before, "none is still in a loop"
