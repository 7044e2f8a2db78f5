"""Logs larger than memory: they go to the disk in pieces, and come out as the very same file."""

from __future__ import annotations

import errno
import io
import math
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from conftest import Constant, adrift, corrected, kinds
from scenario_samples import loaded
from storage_samples import ENVIRONMENT, PYTHON, assert_same, files, log, recording, write_log

from podusv_cli.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.controllers.base import Controller
from podusv_cli.controllers.pid import Pid
from podusv_cli.core.errors import StorageError
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import InMemory
from podusv_cli.engine.grid import TimeGrid
from podusv_cli.engine.simulate import ClosedLoop, simulate
from podusv_cli.process.interrupts import interrupts_caught
from podusv_cli.storage.columns import ColumnFiles
from podusv_cli.storage.stream import Stream
from podusv_cli.workflows.execute import Room, Task, execute

STEPS = 60
LAWS = {f"{kind} {period}": (kind, period) for kind in kinds("controllers") for period in (0, 0.05)}
SCENARIO = """
vessel: {{preset: paper_nonlinear}}
path: {{kind: line_circle}}
disturbance: {{kind: harmonic}}
actuator: {actuator}
controller: {{kind: {law}}}
start: {{x: -5.0, y: -2.0, u: 0.3}}
simulation: {{duration: 0.4, compiled: {compiled}}}
control: {{period: {period}}}
"""
POD = "{kind: pod, preset: cybership2_pod}"
DATED = {"provenance.json", "manifest.json", "metrics.json", "metrics.csv"}  # times, law_ns


def made(place: Path, text: str, room: Room, figures: bool = False) -> dict[str, bytes]:
    """The files of a run of this scenario, less those that clocks are in."""
    names = ("controls", "trajectory", "errors") if figures else ()
    folder = execute(Task(loaded(text).scenario, text, place, room=room, figures=names)).folder
    assert [path.name for path in place.parent.iterdir()] == [place.name]
    return {name: content for name, content in files(folder).items() if name not in DATED}


def same_files(place: Path, text: str, piece: int, **options: Any) -> None:
    """In pieces as in one."""
    whole = made(place / "whole" / "run", text, Room(), **options)
    pieces = made(place / "pieces" / "run", text, Room(log=0, piece=piece), **options)
    assert whole.keys() == pieces.keys()
    assert all(whole[name] == pieces[name] for name in whole)


@pytest.mark.parametrize("law", LAWS)
def test_every_law_leaves_the_same_files(tmp_path: Path, law: str) -> None:
    kind, period = LAWS[law]
    text = SCENARIO.format(actuator="{kind: saturated}", law=kind, period=period, compiled="false")
    same_files(tmp_path, text, 5000)


@pytest.mark.parametrize("law", ["adaptive_neural", "pid"])
def test_pods_leave_the_same_files(tmp_path: Path, law: str) -> None:
    same_files(tmp_path, SCENARIO.format(actuator=POD, law=law, period=0, compiled="false"), 5000)


def test_machine_code_leaves_the_same_files_and_figures(tmp_path: Path) -> None:
    text = SCENARIO.format(actuator="{kind: saturated}", law="pid", period=0, compiled="true")
    same_files(tmp_path, text.replace("duration: 0.4", "duration: 60.0"), 30_000, figures=True)


def both(place: Path, loop: ClosedLoop, grid: TimeGrid, piece: int, **options: Any) -> Any:
    """A recording made in memory and one made in pieces on the disk."""
    columns = ColumnFiles(place / "columns")
    whole = simulate(loop, grid, compiled=False, **options)
    return whole, simulate(loop, grid, compiled=False, columns=columns, piece=piece, **options)


@pytest.mark.parametrize("every", [1, 7, STEPS])
@pytest.mark.parametrize("piece", [1, 1000, 5432, 2**40])
def test_pieces_of_every_size_join(tmp_path: Path, piece: int, every: int) -> None:
    grid = TimeGrid(0.01, STEPS, log_every=every)
    whole, pieces = both(tmp_path, corrected(controller=Pid()), grid, piece)
    assert len(whole["time"]) == STEPS // every + 1
    assert_same(whole, pieces)


@pytest.mark.parametrize("surge", [1e308, 1e200, 1e150])
@pytest.mark.parametrize("piece", [1, 700, 10**6])
def test_a_run_that_diverges_keeps_all_rows_before(
    tmp_path: Path, piece: int, surge: float
) -> None:
    loop = adrift(controller=Constant(surge=surge))
    whole, pieces = both(tmp_path, loop, TimeGrid(0.01, STEPS), piece)
    assert whole.status == "diverged"
    assert len(whole["time"]) < STEPS
    assert_same(whole, pieces)


@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize("last", range(13))
def test_logs_with_vectors_end_wherever_they_end(tmp_path: Path, last: int, every: int) -> None:
    """At a border of pieces, which have four rows, too."""

    class Ending(AdaptiveNeural):
        @staticmethod
        def law(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def, override]
            AdaptiveNeural.law(t, x, memory, target, k, table, tau, rate, signals, work)
            if t > 0.01 * last - 0.005:
                tau[0] = math.nan

    loop, grid = corrected(controller=Ending()), TimeGrid(0.01, STEPS, log_every=every)
    whole, pieces = both(tmp_path, loop, grid, 4 * 8 * loop.layout(grid).width)
    assert whole.status == "diverged"
    assert len(whole["time"]) <= -(-last // every)
    assert_same(whole, pieces)


class Striking(ColumnFiles):
    """Columns that interrupt the process when they get their n-th piece."""

    def __init__(self, place: Path, nth: int) -> None:
        super().__init__(place)
        self.left = nth

    def append(self, rows: Mapping[str, Vector]) -> None:
        super().append(rows)
        self.left -= 1
        if self.left == 0:
            os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.parametrize("law", [Pid(), AdaptiveNeural()], ids=type)
@pytest.mark.parametrize("nth", [1, 3])
def test_an_interrupt_while_a_piece_is_handed_on_loses_and_doubles_nothing(
    tmp_path: Path, nth: int, law: Controller
) -> None:
    loop, grid, rows = corrected(controller=law), TimeGrid(0.01, STEPS), 8
    whole = simulate(loop, grid, compiled=False)
    with interrupts_caught():
        cut = simulate(
            loop, grid, compiled=False, columns=Striking(tmp_path / "c", nth),
            piece=rows * 8 * loop.layout(grid).width,
        )  # fmt: skip
    assert cut.status == "interrupted"
    assert len(cut["time"]) == nth * rows
    for name, array in cut.signals.items():
        assert array.tobytes() == whole[name][: nth * rows].tobytes(), name


def test_an_interrupt_within_a_piece_keeps_its_rows(tmp_path: Path) -> None:
    loop, grid = corrected(controller=Pid()), TimeGrid(0.01, 10**6)

    def stop(fraction: float) -> None:
        if fraction > 2e-5:
            raise KeyboardInterrupt

    cut = simulate(
        loop, grid, compiled=False, columns=ColumnFiles(tmp_path / "c"), piece=5432, progress=stop
    )
    whole = simulate(loop, TimeGrid(0.01, len(cut["time"]) - 1), compiled=False)
    assert cut.status == "interrupted"
    assert_same(cut, replace(whole, status=cut.status, message=cut.message))


def test_what_columns_raise_ends_the_run(tmp_path: Path) -> None:
    class Full(InMemory):
        def append(self, rows: Mapping[str, Vector]) -> None:
            raise StorageError("full")

    with pytest.raises(StorageError, match="full"):
        simulate(corrected(controller=Pid()), TimeGrid(0.01, STEPS), compiled=False, columns=Full(),
                 piece=1000)  # fmt: skip


class Limited(io.BytesIO):
    """A file of which the disk takes so many writes and no more; a write may take a part only."""

    def __init__(self, writes: int) -> None:
        super().__init__()
        self.left = writes

    def write(self, content: Any) -> int:
        self.left -= 1
        if self.left < 0:
            raise OSError(errno.ENOSPC, "full")
        return super().write(content[: 1 + len(content) // 2])


def test_a_log_written_bit_by_bit_is_the_same() -> None:
    content = Limited(10**9)
    write_log(Stream(content), recording())
    assert content.getvalue() == log()


def test_a_stream_keeps_the_first_error_and_goes_on_as_if_nothing_were() -> None:
    stream = Stream(Limited(2))
    assert stream.write(b"abcd") == 4  # in two writes
    assert (stream.error, stream.tell(), stream.size) == (None, 4, 4)
    assert stream.write(b"efgh") == 4
    assert (stream.seek(0), stream.read(8)) == (0, b"abcd" + bytes(4))
    assert (stream.tell(), stream.seek(0, os.SEEK_END), stream.truncate(6)) == (8, 8, 6)
    with pytest.raises(OSError, match="full"):
        stream.check()


SABOTAGE = """
import sys
sys.path[:0] = [{tests!r}]
from itertools import count
from test_long_logs import *
for n in count():
    stream = Stream(Limited(n))
    try:
        write_log(stream, recording(rows=300))
    except Exception as error:
        assert error is stream.error, error
    else:
        assert not stream.error
        break
print(n)
"""


def test_hdf5_survives_a_disk_that_is_full_from_any_write_on() -> None:
    script = SABOTAGE.format(tests=str(Path(__file__).parent))
    done = subprocess.run(
        [PYTHON, "-c", script], env=ENVIRONMENT, capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert int(done.stdout) > 100


LIMITED = """
import resource, sys
from pathlib import Path
from podusv_cli.cli.exit_codes import told
from podusv_cli.scenario.load import load_text
from podusv_cli.core.errors import StorageError
from podusv_cli.workflows.execute import Room, Task, execute, warm_up
text, limit, log, piece, kind = sys.argv[1], *map(int, sys.argv[2:5]), sys.argv[5]
scenario = load_text(text, "a.yaml").scenario
warm_up(scenario)
if kind == "RLIMIT_DATA":  # what the process has now is not the log's
    status = Path("/proc/self/status").read_text()
    limit += 1024 * int(status.partition("VmData:")[2].split()[0])
resource.setrlimit(getattr(resource, kind), (limit, limit))
try:
    execute(Task(scenario, text, Path("run"), room=Room(log, piece)))
except (StorageError, MemoryError) as error:
    sys.exit(told(error))
"""


def under_limit(place: Path, text: str, kind: str, limit: int, room: Room) -> Any:
    """A run in a process of its own that has no more than this."""
    words = [text, str(limit), str(room.log), str(room.piece), kind]
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
    "pieces of the march": (2000, Room(0, 5000), "cannot keep the log in "),
    "the log": (20_000, Room(), "cannot write "),
    "the log of pieces": (20_000, Room(0, 5000), "cannot write "),
}


@pytest.mark.parametrize("case", FULL)
def test_what_cannot_be_written_is_an_error_in_one_line(tmp_path: Path, case: str) -> None:
    limit, room, says = FULL[case]
    text = SCENARIO.format(actuator="{kind: ideal}", law="pid", period=0, compiled="false")
    text = text.replace("duration: 0.4", "duration: 3.0")
    done = under_limit(tmp_path, text, "RLIMIT_FSIZE", limit, room)
    assert (done.returncode, done.stdout) == (5, "")
    assert done.stderr.startswith(says)
    assert done.stderr.endswith("larger than the file size limit of this session\n")
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere memory cannot be limited so")
def test_a_run_takes_far_less_memory_than_its_log(tmp_path: Path) -> None:
    law = {"law": "adaptive_neural", "period": 0, "compiled": "true"}
    text = SCENARIO.format(actuator="{kind: saturated}", **law)
    text = text.replace("duration: 0.4", "duration: 2500.0")
    held = under_limit(tmp_path, text, "RLIMIT_DATA", FREE, Room())
    assert "MemoryError" in held.stderr
    pieces = under_limit(tmp_path, text, "RLIMIT_DATA", FREE, Room(0, 10**6))
    assert (pieces.returncode, pieces.stderr) == (0, "")
    assert (tmp_path / "run" / "log.h5").stat().st_size > 1.5 * FREE
