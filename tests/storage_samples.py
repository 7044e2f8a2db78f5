"""A small recording, its log, its folder, and ways to break them, for the tests of the logbook."""

import io
import itertools
import os
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import h5py
import numpy as np
import pytest
from known_signals import ABOUT
from numpy.testing import assert_array_equal

import podusv_cli
from podusv_cli.core.recording import Recording
from podusv_cli.storage import log as log_file
from podusv_cli.storage import manifest
from podusv_cli.storage.run_folder import RunWriter

YAML = "name: kleine Fähre\nstart: {x: -10.0}\n"
TEXTS = {"resolved_yaml": YAML, "title": "Größe ψ_e", "source": "a towing tank", "version": "1.2.3"}
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(podusv_cli.__file__).parents[1])}
PYTHON = sys.executable
Deed = Callable[[], None]
# Two small folders, for tests in which one replaces the other.
OLD = {"log.h5": b"old log", "figures/old.png": b"old figure"}
NEW = {"log.h5": b"new log", "figures/new.png": b"new figure", "metrics.csv": b""}


def recording(rows: int = 50, nodes: int = 8, **changes: Any) -> Recording:
    """Signals with and without an axis of nodes, and what is fixed; `changes` replace its parts."""
    random = np.random.default_rng(5)
    signals = {
        "time": np.arange(rows) * 0.01,
        "x": random.normal(size=rows),
        "tau_u_cmd": random.normal(size=rows),
        "W_hat_u": random.normal(size=(rows, nodes)),
        "z_e": np.linspace(14.0, 0.5, rows),
    }
    fixed = {"rbf_center": random.normal(size=(nodes, 3)), "rbf_width": np.array([0.7, 0.5, 0.25])}
    parts = {"status": "finished", "controller": "pid", "signals": signals, "fixed": fixed}
    return Recording(**parts | {"about": ABOUT} | changes)


def log(recorded: Recording | None = None, *, compress: bool = False, **texts: str) -> bytes:
    """log.h5 of a recording, the small one if none is given."""
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "log.h5"
        told = log_file.Texts(**TEXTS | texts)
        log_file.write(path, recorded or recording(), told, compress=compress)
        return path.read_bytes()


def rewritten(change: Callable[[h5py.File], object]) -> bytes:
    """The small log after `change` has worked on it as any program with HDF5 could."""
    content = io.BytesIO(log())
    with h5py.File(content, "r+") as file:
        change(file)
    return content.getvalue()


def assert_same(one: Recording, other: Recording) -> None:
    """Equal in everything that is logged, order included."""
    for part in ("status", "controller", "message"):
        assert getattr(one, part) == getattr(other, part)
    assert list(one.signals) == list(other.signals)
    assert list(one.fixed) == list(other.fixed)
    for name, array in {**one.signals, **one.fixed}.items():
        assert other[name].dtype == np.float64
        assert_array_equal(other[name], array, err_msg=name)
        assert other.about[name] == one.about[name]
        assert other[name].tobytes() == array.tobytes(), f"{name}: the sign of a zero or a NaN"


def files(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, hidden ones too."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


class Saboteur:
    """Stands in for functions of `os` and does a deed before the n-th call of any of them."""

    def __init__(self, deed: Deed, nth: int) -> None:
        self.deed, self.left = deed, nth

    def watch(self, patch: pytest.MonkeyPatch, *names: str) -> None:
        for name in names:
            patch.setattr(os, name, self._instead_of(getattr(os, name)))

    @property
    def struck(self) -> bool:
        return self.left <= 0

    def _instead_of(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            self.left -= 1
            if self.left == 0:
                self.deed()
            return function(*arguments, **options)

        return call


def until_nothing_breaks(attempt: Callable[[Saboteur], None], deed: Deed) -> Iterator[int]:
    """Attempt with the first call sabotaged, the second, ... ; yields n after each attempt."""
    for nth in itertools.count(1):
        saboteur = Saboteur(deed, nth)
        attempt(saboteur)
        if not saboteur.struck:
            assert nth > 1, "nothing was sabotaged"
            return
        yield nth


def write(final: Path, content: dict[str, bytes], *, force: bool = False) -> Path:
    """Make a finished folder of these files."""
    with RunWriter(final, force=force) as writer:
        for name, part in content.items():
            writer.add(name, part)
        return writer.finish("finished")


def content(folder: Path) -> dict[str, bytes]:
    """The files of a finished folder, without its manifest; StorageError for any other folder."""
    manifest.check(folder)
    found = files(folder)
    del found["manifest.json"]
    return found


def beside(folder: Path) -> set[str]:
    """What else is in the folder above, hidden or not."""
    return {path.name for path in folder.parent.iterdir()} - {folder.name}


@contextmanager
def deadline(seconds: int = 60) -> Iterator[None]:
    """Fail instead of waiting for ever, as for the writer of a named pipe."""

    def stop(number: int, frame: FrameType | None) -> None:
        pytest.fail("hangs")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def durable_steps(patch: pytest.MonkeyPatch) -> list[tuple[str, str]]:
    """Grows by ("sync", path) and ("name", new path) as files and folders are synced and named."""
    steps: list[tuple[str, str]] = []
    fsync, replace, rename = os.fsync, os.replace, os.rename

    def note_sync(descriptor: int) -> None:
        steps.append(("sync", os.readlink(f"/proc/self/fd/{descriptor}")))
        fsync(descriptor)

    def note_name(move: Callable[..., None]) -> Callable[..., None]:
        return lambda old, new, **at: (steps.append(("name", str(new))), move(old, new, **at))[1]

    patch.setattr(os, "fsync", note_sync)
    patch.setattr(os, "replace", note_name(replace))
    patch.setattr(os, "rename", note_name(rename))
    return steps


def fails(number: int) -> Deed:
    """A deed: raise the OSError of this number."""

    def deed() -> None:
        raise OSError(number, os.strerror(number))

    return deed


def interrupts() -> None:
    """A deed: the user presses Ctrl-C."""
    raise KeyboardInterrupt


def kills() -> None:
    """A deed: the process dies on the spot."""
    os.kill(os.getpid(), signal.SIGKILL)
