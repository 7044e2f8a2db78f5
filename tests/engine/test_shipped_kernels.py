"""Kernels that come with podusv as bitcode: right, never older than their source, and optional."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import linecache
import lzma
import os
import re
import subprocess
import sys
import warnings
from ctypes import CFUNCTYPE, c_double
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import pytest
from conftest import kinds

from benchmarks import ship_kernels
from podusv_cli.core.kernel import kernel, specialise
from podusv_cli.engine.machine import compile, object_cache, shipped

GAIN = 2.0
ROOT = Path(__file__).parents[2]
SCENARIO = "podusv:own_vessel.yaml"
ALONE = compile.ALONE_BY


@kernel
def doubled(x: float) -> float:
    """A number that another module has, times x."""
    return GAIN * x


@kernel
def caller(t: float, x: Any, k: Any, table: Any, b: Any, again: float, stage: float) -> float:
    """Calls another kernel."""
    b[0] = doubled(x[0])
    return 0.0


@pytest.fixture
def file(monkeypatch, tmp_path):
    """Another file of kernels, which is read anew after each change."""
    path = tmp_path / "kernels.xz"
    monkeypatch.setattr(shipped, "FILE", path)
    shipped._kernels.cache_clear()
    yield path
    shipped._kernels.cache_clear()


def found(file: Path, content: bytes | None) -> int:
    """How many kernels are found in a file of this content."""
    if content is not None:
        file.write_bytes(content)
    shipped._kernels.cache_clear()
    return len(shipped._kernels())


def test_a_damaged_or_foreign_file_gives_no_kernels(file: Path) -> None:
    shipped.write({"a": b"123", "b": b"45678"})
    whole = file.read_bytes()
    assert found(file, None) == 2
    assert shipped._kernels()["b"] == b"45678"
    head, _, body = lzma.decompress(whole).partition(b"\n")
    makers, version, sizes = json.loads(head)
    newer = json.dumps([makers, [version[0] + 1, 0, 0], sizes]).encode() + b"\n" + body
    others = json.dumps(["another", version, sizes]).encode() + b"\n" + body
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 1
    damaged = [
        whole[:-1],
        whole[: len(whole) // 2],
        bytes(flipped),
        b"",
        b"kernels",
        lzma.compress(body),
        lzma.compress(newer),
        lzma.compress(others),
    ]
    assert [found(file, content) for content in damaged] == [0] * len(damaged)
    file.unlink()
    assert found(file, None) == 0


@pytest.mark.long
def test_how_many_kernels_come_with_podusv_and_that_they_are_what_numba_makes_now() -> None:
    """That some are missing is no failure: they are made anew at the end of a change."""
    command = [sys.executable, "-m", "benchmarks.ship_kernels", "--check", "--again", "4"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    said = re.match(
        r"(\d+) of (\d+) kernels are in kernels.xz; of 4 made anew (\d+) differ", done.stdout
    )
    assert said, done.stdout + done.stderr
    warnings.warn(said[0], stacklevel=1)  # which the log of the tests shows
    there, wanted, other = map(int, said.groups())
    assert other == 0, done.stdout
    assert done.returncode == (there < wanted)
    assert wanted > 200


def code_of(piece: compile.Piece) -> bytes:
    made = piece.translator().bitcode(piece.function, piece.prototype)
    assert isinstance(made, bytes)
    return made


def test_bitcode_suits_any_machine() -> None:
    """No processor, no path and no name of this machine is in it."""
    code = code_of(compile.adapter("disturbance", caller, ()))
    text = str(llvm.parse_bitcode(code))
    assert "target-cpu" not in text
    assert str(Path.home()) not in text
    assert "_ZN" not in text


@pytest.mark.parametrize("room", ["controllers", "paths", "disturbances", "actuators"])
def test_a_kernel_that_is_edited_has_another_name(room: str) -> None:
    """By its text, by a number that it reads, by a kernel that it calls."""
    kernel_of = {"controllers": "law", "actuators": "drive"}.get(room, "evaluate")
    for kind in kinds(room).values():
        inner = getattr(kind, kernel_of)
        before = [*object_cache.ingredients(inner, {}, shipped.source_of)]
        numbers = {n: v for n, v in inner.__globals__.items() if type(v) in (int, float)}
        read = {n: v for n, v in numbers.items() if n in inner.__code__.co_names}
        for name, number in read.items():
            other = specialise(inner, "other", **{name: number + 1})
            assert [*object_cache.ingredients(other, {}, shipped.source_of)][2:] != before[2:], name


def test_a_number_that_a_called_kernel_reads_is_part_of_the_name(monkeypatch) -> None:
    piece = compile.adapter("disturbance", caller, ())
    before = shipped.digest(piece.function, piece.prototype, ALONE)
    shipped.digest.cache_clear()
    monkeypatch.setitem(globals(), "GAIN", 3.0)
    assert shipped.digest(piece.function, piece.prototype, ALONE) != before
    monkeypatch.undo()
    shipped.digest.cache_clear()
    assert shipped.digest(piece.function, piece.prototype, ALONE) == before


@pytest.mark.parametrize("edit", ["2.0 * x", "GAIN * x", ""])
def test_a_kernel_whose_file_was_edited_since_it_was_loaded_takes_no_bitcode(
    tmp_path: Path, edit: str
) -> None:
    """The digest is of the text, and the byte code of before would run."""
    file = tmp_path / "edited_kernels.py"
    file.write_text(f"GAIN = 3.0\n{FORCE.format('3.0 * x')}")
    spec = importlib.util.spec_from_file_location("edited_kernels", file)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    name = (module.force, CFUNCTYPE(c_double, c_double), ALONE)
    before = shipped.digest(*name)
    assert before
    file.write_text(f"GAIN = 3.0\n{FORCE.format(edit)}" if edit else "")
    linecache.clearcache()
    shipped.digest.cache_clear()
    assert shipped.digest(*name) == ""
    file.write_text(f"# Elsewhere.\nGAIN = 3.0\n{FORCE.format('3.0 * x')}")
    linecache.clearcache()
    shipped.digest.cache_clear()
    assert shipped.digest(*name) == ""  # its line is another one's


FORCE = """
from podusv_cli.core.kernel import kernel


@kernel
def force(x):
    return {}
"""


def log_digest(folder: Path, cache: Path, *, numba: bool, law: str = "") -> str:
    """Of log.h5 of a run in a process of its own with an empty cache, or what it said."""
    hidden = "" if numba else "import sys; sys.modules['numba'] = None\n"
    ours = (
        "from podusv_cli.engine.machine import shipped\n"
        "shipped.FILE = shipped.FILE.with_name('-')\n"
    )
    code = (
        hidden + (ours if numba else "") + "from podusv_cli.__main__ import main\n"
        "import sys\nsys.argv = ['podusv', 'run', *sys.argv[1:]]\nmain()"
    )
    options = [law or SCENARIO, "--no-figures", "--out", str(folder)]
    short = ["--set", "simulation.duration=5.0"]
    done = subprocess.run(
        [sys.executable, "-c", code, *options, *short],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PODUSV_CACHE": str(cache)},
        timeout=300,
    )
    if done.returncode:
        return done.stderr
    return hashlib.sha256((folder / "log.h5").read_bytes()).hexdigest()


@pytest.mark.long
def test_without_numba_runs_have_the_same_bytes_and_a_law_of_ones_own_is_told(tmp_path) -> None:
    if not ship_kernels.pieces_of([podusv_loaded()]).keys() <= shipped._kernels().keys():
        pytest.skip("no kernels.xz with the kernels of this scenario")
    with_numba = log_digest(tmp_path / "a", tmp_path / "x", numba=True)
    assert log_digest(tmp_path / "b", tmp_path / "y", numba=False) == with_numba
    law = tmp_path / "own.py"
    law.write_text(OWN)
    scenario = tmp_path / "own.yaml"
    scenario.write_text(f"extends: {SCENARIO}\nplugins: [own.py]\ncontroller: {{kind: own}}\n")
    said = log_digest(tmp_path / "c", tmp_path / "z", numba=False, law=str(scenario))
    assert "numba, which makes it, cannot be imported" in said
    assert said.rstrip().endswith("; pip install numba")
    assert "Traceback" not in said


OWN = '''
from typing import Any, Literal

from podusv_cli.plugin import Controller, Vector, kernel


class Own(Controller):
    """Nothing."""

    kind: Literal["own"] = "own"

    @staticmethod
    @kernel
    def law(t, x, memory, target, k, table, tau, rate, signals, work):
        """Nothing."""
        tau[0] = 0.0
        tau[1] = 0.0
'''


def podusv_loaded() -> Any:
    from podusv_cli.interface.scenarios import load_scenario

    return load_scenario(SCENARIO, {"simulation.duration": 5.0})
