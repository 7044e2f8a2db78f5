"""Whatever becomes of compiled code on disk, a run computes what its source says.

Edited sources, torn writes, old caches: tests/test_cache.py.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from command_samples import BASE, ROOT, write

from podusv_cli.engine import machine_code

FRESH = machine_code.cache_folder


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    write("a.yaml", BASE)
    FRESH.cache_clear()
    yield tmp_path
    FRESH.cache_clear()


def begun(out: str, **environment: str) -> subprocess.Popen[str]:
    """A run under way, with these variables of where caches can be and no others."""
    names = ("PODUSV_CACHE", "XDG_CACHE_HOME", "HOME")
    other = {name: text for name, text in os.environ.items() if name not in names}
    words = ["run", "a.yaml", "--out", out, "--no-figures", "-q"]
    return subprocess.Popen(
        [sys.executable, "-m", "podusv_cli", *words], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env={**other, "PYTHONPATH": str(ROOT), **environment},
    )  # fmt: skip


def log(process: subprocess.Popen[str]) -> bytes:
    """What the run logged."""
    out, err = process.communicate(timeout=120)
    assert (process.returncode, err) == (0, "")
    return (Path(out.strip()) / "log.h5").read_bytes()


def spoil(content: bytes) -> Iterator[bytes]:
    """The content, damaged in different ways, again and again."""
    middle = len(content) // 2
    while True:
        yield b""
        yield content[:middle]
        yield content[:middle] + bytes([content[middle] ^ 4]) + content[middle + 1 :]
        yield bytes(len(content))


def test_damage_races_and_missing_places_change_no_byte(folder: Path) -> None:
    cache = folder / "cache"
    together = [begun(out, PODUSV_CACHE=str(cache)) for out in ("a", "b")]
    first, second = map(log, together)
    assert first == second
    pieces = [path for path in cache.rglob("*") if path.is_file()]
    assert len(pieces) >= 8
    assert all(path.suffix == ".code" for path in pieces)  # nothing half-written is left
    assert log(begun("c", PODUSV_CACHE=str(cache))) == first
    damage = spoil(pieces[0].read_bytes())
    for path in pieces[1:]:
        path.write_bytes(next(damage))
    pieces[0].unlink()
    pieces[0].mkdir()  # where the piece should be: no reading, no replacing
    assert log(begun("d", PODUSV_CACHE=str(cache))) == first
    assert all(machine_code._read(path) for path in pieces[1:])  # mended on the way


def test_pieces_swapped_are_not_taken_for_each_other(folder: Path) -> None:
    """Each is whole; only its name is another's."""
    cache = folder / "cache"
    first = log(begun("a", PODUSV_CACHE=str(cache)))
    pieces = sorted(cache.rglob("law_entry*.code")) + sorted(cache.rglob("actuator_entry*.code"))
    one, other = pieces[0].read_bytes(), pieces[1].read_bytes()
    pieces[0].write_bytes(other)
    pieces[1].write_bytes(one)
    assert log(begun("b", PODUSV_CACHE=str(cache))) == first


def test_without_any_place_it_compiles_and_leaves_nothing(folder: Path) -> None:
    nowhere = "/dev/null/nowhere"
    before = {path.name for path in folder.iterdir()}
    process = begun("x", PODUSV_CACHE=nowhere, XDG_CACHE_HOME=nowhere, TMPDIR=str(folder / "tmp"))
    (folder / "tmp").touch()
    assert log(process)
    assert {path.name for path in folder.iterdir()} == before | {"tmp", "x"}


@pytest.mark.parametrize("home", ["~", "relative", ""])
def test_without_a_home_no_folder_is_made_here(
    folder: Path, home: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PODUSV_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", home)
    if home != "relative":
        monkeypatch.delenv("XDG_CACHE_HOME")
        monkeypatch.setattr(os.path, "expanduser", lambda path: path)  # who runs it has no entry
    (folder / "temporary").mkdir()
    monkeypatch.setattr(machine_code.tempfile, "gettempdir", lambda: str(folder / "temporary"))
    found = FRESH()
    assert found is not None
    assert found.is_relative_to(folder / "temporary")
    assert sorted(path.name for path in folder.iterdir()) == ["a.yaml", "temporary"]


def test_a_folder_that_is_not_ones_own_is_not_used(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Code that somebody else could have put there would be run."""
    monkeypatch.setenv("PODUSV_CACHE", str(folder / "theirs"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "theirs too"))
    monkeypatch.setattr(machine_code.tempfile, "gettempdir", lambda: str(folder))
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    assert FRESH() is None
