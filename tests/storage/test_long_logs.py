"""Logs larger than memory: they are made on the disk, and come out as the very same file."""

import errno
import io
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REQUIRED, kinds
from rotation import one_in
from scenario_samples import loaded
from storage_samples import ENVIRONMENT, PYTHON, TEXTS, files, log, recording

from podusv_cli.core.errors import StorageError
from podusv_cli.storage import log as log_file
from podusv_cli.storage.files import disk_array
from podusv_cli.workflows.execute import HELD, RunTask, execute

GIVEN = {
    "schedule": ', rows: "0, 1, 0\\n200, 2, 0.5\\n"',
    "zigzag": ", check_every: 0.05",
    "policy": f", content: {REQUIRED['policy']['content']}",
}
LAWS = {f"{kind} {period}": (kind, period) for kind in kinds("controllers") for period in (0, 0.05)}
SCENARIO = """
vessel: {{preset: paper_nonlinear}}
path: {path}
disturbance: {{kind: harmonic}}
actuator: {actuator}
controller: {{kind: {law}}}
start: {{x: -5.0, y: -2.0, u: 0.3}}
simulation: {{duration: 0.4, compiled: {compiled}}}
control: {{period: {period}}}
"""


def scenario(compiled: str = "false", path: str = "{kind: line_circle}", **parts: Any) -> str:
    """A short scenario with these parts."""
    return SCENARIO.format(compiled=compiled, path=path, **parts)


POD = "{kind: pod, preset: cybership2_pod}"
DATED = {"provenance.json", "manifest.json", "metrics.json", "metrics.csv"}  # times, law_ns


def made(place: Path, text: str, held: int, figures: bool = False) -> dict[str, bytes]:
    """The files of a run of this scenario, less those that clocks are in."""
    names = ("errors",) if figures else ()
    folder = execute(RunTask(loaded(text).scenario, text, place, held=held, figures=names)).folder
    assert [path.name for path in place.parent.iterdir()] == [place.name]
    return {name: content for name, content in files(folder).items() if name not in DATED}


def same_files(place: Path, text: str, **options: Any) -> None:
    """On the disk as in memory."""
    held = made(place / "held" / "run", text, HELD, **options)
    mapped = made(place / "mapped" / "run", text, 0, **options)
    assert held.keys() == mapped.keys()
    assert all(held[name] == mapped[name] for name in held)


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_every_law_leaves_the_same_files(tmp_path, law):
    kind, period = LAWS[law]
    law = kind + GIVEN.get(kind, "")
    parts = {"actuator": "{kind: saturated}"}
    if kind.startswith("pose"):
        poses = "[[0, 0, 0], [2, 1, 0.5]]"
        parts = {"actuator": "{kind: saturated_full}", "path": f"{{kind: poses, poses: {poses}}}"}
    same_files(tmp_path, scenario(law=law, period=period, **parts))


@pytest.mark.slow
def test_pods_leave_the_same_files(tmp_path):
    same_files(tmp_path, scenario(actuator=POD, law="pid", period=0))


@pytest.mark.long
def test_machine_code_leaves_the_same_files_and_figures(tmp_path):
    text = scenario(actuator="{kind: saturated}", law="pid", period=0, compiled="true")
    same_files(tmp_path, text.replace("duration: 0.4", "duration: 60.0"), figures=True)


@pytest.mark.parametrize("law", ["adaptive_neural", "pid"])
def test_runs_that_diverge_leave_the_same_files(tmp_path, law):
    gain = {"pid": "K_Pu: 2e+4", "adaptive_neural": "k_ue: 1e+7"}[law]
    text = scenario(actuator="{kind: ideal}", law=f"{law}, {gain}", period=0)
    same_files(tmp_path, text)
    assert "diverged" in (tmp_path / "held/run/manifest.json").read_text()


def test_room_on_the_disk_has_no_name_and_reads_as_it_was_written(tmp_path):
    room = disk_array(tmp_path, 10_000)
    room[:] = np.arange(10_000.0)
    assert list(tmp_path.iterdir()) == []
    assert room.sum() == 49_995_000.0


class Limited(io.FileIO):
    """A file of which the disk takes so many writes and no more; a write may take a part only."""

    left = 0

    def write(self, content: Any) -> int:
        self.left -= 1
        if self.left < 0:
            raise OSError(errno.ENOSPC, "full")
        return super().write(content[: 1 + len(content) // 2])


def writes_left(path: Path, monkeypatch: pytest.MonkeyPatch, writes: int) -> int:
    """Write the small log into a file like that."""
    path.unlink(missing_ok=True)
    opened: list[Limited] = []

    def limited(descriptor: int, *how: Any, **more: Any) -> Limited:
        opened.append(Limited(descriptor, "wb"))
        opened[0].left = writes
        return opened[0]

    with monkeypatch.context() as patch:
        patch.setattr(os, "fdopen", limited)
        log_file.write(path, recording(), log_file.Texts(**TEXTS))
    return opened[0].left


@pytest.mark.long
def test_a_disk_that_is_full_from_any_write_on_is_an_error_in_one_line(tmp_path, monkeypatch):
    path = tmp_path / "log.h5"
    total = 10**9 - writes_left(path, monkeypatch, 10**9)
    assert path.read_bytes() == log()
    for writes in range(total):
        with pytest.raises(StorageError, match=r"cannot write .* \(\d+ bytes\): the disk is full"):
            writes_left(path, monkeypatch, writes)
    assert total > 50


LIMITED = """
import resource, sys
from pathlib import Path
from podusv_cli.cli.exit_codes import report_error
from podusv_cli.scenario.load import load_text
from podusv_cli.core.errors import StorageError
from podusv_cli.scenario.case import Case
from podusv_cli.workflows.execute import RunTask, execute, warm_up
text, limit, held, kind = sys.argv[1], *map(int, sys.argv[2:4]), sys.argv[4]
scenario = load_text(text, "a.yaml").scenario
warm_up(Case.of(scenario))
if kind == "RLIMIT_DATA":  # what a short run imports and allocates is not the log's
    short = text.replace("duration: 2500.0", "duration: 1.0")
    execute(RunTask(load_text(short, "a.yaml").scenario, short, Path("short"), force=True))
    status = Path("/proc/self/status").read_text()
    limit += 1024 * int(status.partition("VmData:")[2].split()[0])
which = getattr(resource, kind)
before = resource.getrlimit(which)
resource.setrlimit(which, (limit, before[1]))
try:
    execute(RunTask(scenario, text, Path("run"), held=held))
except (StorageError, MemoryError) as error:
    resource.setrlimit(which, before)  # a profiler, say, may write files at the end
    sys.exit(report_error(error))
"""


def under_limit(place: Path, text: str, kind: str, limit: int, held: int) -> Any:
    """A run in a process of its own that has no more than this."""
    words = [text, str(limit), str(held), kind]
    return subprocess.run(
        [PYTHON, "-c", LIMITED, *words],
        # Each thread takes memory of its own; Python would write files that are cut off.
        env=ENVIRONMENT | {"OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        cwd=place,
        timeout=60,
    )


FREE = 75 * 10**6  # bytes, 32 of them for OpenBLAS; 52 are enough, however long the run

FULL = {
    "room for the march": (2000, 0, "cannot keep the log in "),
    "the log on top": (85_000, 0, "cannot write "),
    "the log": (20_000, HELD, "cannot write "),
}


@pytest.mark.parametrize("case", one_in(3, [*FULL]))
def test_what_cannot_be_written_is_an_error_in_one_line(tmp_path, case):
    limit, held, says = FULL[case]
    text = scenario(actuator="{kind: ideal}", law="pid", period=0)
    text = text.replace("duration: 0.4", "duration: 3.0")
    done = under_limit(tmp_path, text, "RLIMIT_FSIZE", limit, held)
    assert (done.returncode, done.stdout) == (5, "")
    assert done.stderr.startswith(says)
    assert done.stderr.endswith("larger than the file size limit of this session\n")
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere memory cannot be limited so")
def test_a_run_takes_far_less_memory_than_its_log(tmp_path):
    law = {"law": "adaptive_neural", "period": 0, "compiled": "true"}
    text = scenario(actuator="{kind: saturated}", **law)
    text = text.replace("duration: 0.4", "duration: 2500.0")
    held = under_limit(tmp_path, text, "RLIMIT_DATA", FREE, HELD)
    assert "MemoryError" in held.stderr
    mapped = under_limit(tmp_path, text, "RLIMIT_DATA", FREE, 0)
    assert (mapped.returncode, mapped.stderr) == (0, "")
    assert (tmp_path / "run" / "log.h5").stat().st_size > 1.5 * FREE
