"""The same scenario gives the same bits: again, elsewhere, beside others, compiled or not."""

import ast
import json
import os
import platform
import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOMS, corrected, example, kinds, needed_by
from rotation import one_in
from scenario_samples import SOUND

from podusv_cli.comparison.log_difference import compare
from podusv_cli.comparison.run_difference import CLOCKED
from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.actuators.saturated_full import SaturatedFull
from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.full_backstepping import FullBackstepping
from podusv_cli.components.paths.line_circle import LineCircle
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.metrics.table import metrics_probe
from podusv_cli.process.workers import run_all
from podusv_cli.scenario.load import load, load_text
from podusv_cli.storage.files import fingerprint
from podusv_cli.storage.log_reader import read_log
from podusv_cli.workflows.execute import RunTask, execute

ROOT = Path(__file__).parents[2]
CORRECTED = str(ROOT / "configs/mu_2017/corrected.yaml")
INTEL = pytest.mark.skipif(
    platform.machine() not in ("x86_64", "AMD64"), reason="names instruction sets of x86"
)
ASTERN = (9.0, -9.0, -2.0, 0.3, 0.1, 0.0)
PARTS: dict[str, dict[str, Any]] = {
    **{
        f"{room[:-1]} {name}": {room[:-1]: example(kind)}
        for room in ROOMS
        for name, kind in kinds(room).items()
    },
    "difference": {"controller": AdaptiveNeural(rate="difference", B_u=5.0)},
    "held direction": {"controller": AdaptiveNeural(hold_below=20.0)},
    "folded": {"controller": FullBackstepping(fold="printed"), "start": ASTERN},
    "literal path": {"path": LineCircle(switch=0.05, reading="literal")},
}

# Runs a scenario as if on another processor and leaves its log. Arguments: the scenario, the
# folder, the processor as LLVM calls it (- for this one), overrides.
ELSEWHERE = """
import sys
from pathlib import Path
config, folder, processor, *overrides = sys.argv[1:]
asked = []
if processor != "-":
    import llvmlite.binding as llvm
    llvm.get_host_cpu_name = lambda: asked.append(processor) or processor
    llvm.get_host_cpu_features = llvm.FeatureMap
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import run
run(Path(config), Request(overrides, Path(folder), figures=False))
assert asked or processor == "-", "the compiler did not ask what it compiles for"
"""


def python(*words: str, **settings: str) -> subprocess.CompletedProcess[str]:
    """A Python process of its own."""
    return subprocess.run(
        [sys.executable, *words],
        env={**os.environ, "PYTHONPATH": str(ROOT), **settings},
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )


def repeatable(folder: Path) -> dict[str, Any]:
    """What must be the same of a run: digests of two files, metrics but for a clock's."""
    metrics = json.loads((folder / "metrics.json").read_text())["metrics"]
    return {
        "log": fingerprint(folder / "log.h5"),
        "resolved": fingerprint(folder / "resolved.yaml"),
        "metrics": {name: number for name, number in metrics.items() if name not in CLOCKED},
    }


# --- compiled or not


def both(loop: ClosedLoop, hold_every: int) -> tuple[Any, Any]:
    """The loop's recording from machine code and from plain Python."""
    grid = TimeGrid(0.002, 60, hold_every=hold_every)
    probe = metrics_probe(Plan(loop, grid), steady_fraction=0.25, settling_radius=2.0)
    one, other = (simulate(loop, grid, probe=probe, compiled=c) for c in (True, False))
    return one, other


@pytest.mark.parametrize("part", one_in(3, [*PARTS]))
def test_machine_code_and_plain_python_agree_to_the_last_bit(part):
    law = PARTS[part].get("controller", AdaptiveNeural())
    needed = needed_by(law, SaturatedFull())
    loop = corrected(**{"actuator": Saturated(), **needed, **PARTS[part]})
    for hold_every in (0, 5) if "controller" in PARTS[part] else (0,):
        compiled, plain = both(loop, hold_every)
        assert compiled.status == "finished"
        difference = compare(compiled, plain)
        assert difference.same, difference.first
        assert compiled.seen.tobytes() == plain.seen.tobytes()


# --- again, elsewhere, beside others


@pytest.mark.long
def test_processes_that_differ_in_all_but_the_scenario_write_the_same_bytes(tmp_path):
    config = tmp_path / "a.yaml"
    config.write_text(SOUND + "simulation: {duration: 5.0}\n")
    surroundings: Sequence[dict[str, str]] = (
        {"PYTHONHASHSEED": "1", "TZ": "UTC", "LC_ALL": "C.UTF-8", "OPENBLAS_NUM_THREADS": "1"},
        {"PYTHONHASHSEED": "2", "TZ": "Asia/Tokyo", "LC_ALL": "C", "OPENBLAS_NUM_THREADS": "4"},
    )
    folders = [tmp_path / "here", tmp_path / "there"]
    for folder, settings in zip(folders, surroundings, strict=True):
        python("-c", ELSEWHERE, str(config), str(folder), "-", **settings)
    assert repeatable(folders[0]) == repeatable(folders[1])


@pytest.mark.long
def test_one_worker_and_many_write_the_same_bytes(tmp_path):
    gains = [50.0, 100.0, 200.0, 400.0, 800.0]
    scenarios = [
        load_text(SOUND, "a.yaml", [f"controller.K_Pu={gain}", "simulation.duration=5"]).scenario
        for gain in gains
    ]
    for workers in (1, 4):
        folders = [tmp_path / str(workers) / str(i) for i in range(len(gains))]
        tasks = [RunTask(s, SOUND, folder) for s, folder in zip(scenarios, folders, strict=True)]
        outcomes = run_all([partial(execute, task) for task in tasks], workers=workers)
        assert not any(outcome.failure for outcome in outcomes)
    for i in range(len(gains)):
        assert repeatable(tmp_path / "1" / str(i)) == repeatable(tmp_path / "4" / str(i))


# --- other processors


@pytest.mark.parametrize(
    "processor",
    [
        "x86-64",  # vectors of two numbers, nothing fused
        "haswell",  # of four; could fuse multiply and add
    ],
)
@pytest.mark.slow  # compiles everything anew
@INTEL
def test_code_for_other_instruction_sets_writes_the_same_bytes(processor, tmp_path):
    words = ["simulation.duration=20"]
    scenario = load(CORRECTED, words).scenario.alone()
    here = execute(RunTask(scenario, Path(CORRECTED).read_text(), tmp_path / "here")).folder
    cache = str(tmp_path / "cache")
    there = tmp_path / "there"
    python("-c", ELSEWHERE, CORRECTED, str(there), processor, *words, PODUSV_CACHE=cache)
    assert repeatable(here) == repeatable(there)


ANGLES = "import math; print([f(x / 777) for f in (math.sin, math.cos) for x in range(9000)])"
WITHOUT_FMA = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2,-AVX,-FMA,-FMA4"}


@pytest.mark.slow
@INTEL
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("mu_2017/corrected", ["path.reading=sine", "path.switch=1"]),
        ("pod/single", ["controllers=null", "controller={kind: pid}"]),
    ],
)
def test_a_c_library_that_rounds_otherwise_changes_no_number_of_a_run(name, words, tmp_path):
    if python("-c", ANGLES).stdout == python("-c", ANGLES, **WITHOUT_FMA).stdout:
        pytest.skip("this C library rounds alike with and without fused instructions")
    config = str(ROOT / f"configs/{name}.yaml")
    words = [*words, "simulation.duration=60"]
    for folder, settings in (("here", {}), ("there", WITHOUT_FMA)):
        python("-c", ELSEWHERE, config, str(tmp_path / folder), "-", *words, **settings)
    here, there = tmp_path / "here", tmp_path / "there"
    difference = compare(read_log(here / "log.h5"), read_log(there / "log.h5"))
    assert difference.same, difference.first
    assert repeatable(here)["metrics"] == repeatable(there)["metrics"]


# What is rounded correctly everywhere.
EXACT = {
    "math.sqrt",
    "math.copysign",
    "math.floor",
    "math.ceil",
    "math.fabs",
    "math.isfinite",
    "math.isnan",
    "math.pi",
    "math.inf",
    "math.nan",
    "np.ceil",
    "np.float64",
    "np.int64",
    "np.empty",
}


@pytest.mark.long
def test_kernels_take_nothing_from_the_c_library_that_it_may_round_otherwise():
    called = {
        name for path in (ROOT / "podusv_cli").rglob("*.py") for name in _calls_in_kernels(path)
    }
    assert "math.sqrt" in called
    assert called <= EXACT


def _calls_in_kernels(path: Path) -> list[str]:
    """Functions of math and np, and ** for powers."""
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef) and any(
            isinstance(d, ast.Name) and d.id == "kernel" for d in node.decorator_list
        ):
            for inner in ast.walk(node):
                if isinstance(inner, ast.Attribute) and isinstance(inner.value, ast.Name):
                    found += [f"{inner.value.id}.{inner.attr}"] * (inner.value.id in ("math", "np"))
                found += ["**"] * isinstance(inner, ast.Pow)
    return found
