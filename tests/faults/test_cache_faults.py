"""Whatever becomes of compiled code on disk, a run computes what its source says.

Edited sources, torn writes, old caches: tests/engine/test_cache.py.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from ctypes import CFUNCTYPE, c_double
from pathlib import Path
from typing import Any

import pytest
from command_samples import BASE, ROOT, write

from podusv_cli.core.kinematics import wrap
from podusv_cli.engine.machine import compile, object_cache
from podusv_cli.process import code_folder
from podusv_cli.process.temporary_names import temporary_name

FRESH = code_folder.code_folder
NAME = "0123456789abcdef"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
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
        [sys.executable, "-m", "podusv_cli", *words],
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**other, "PYTHONPATH": str(ROOT), **environment},
    )


def log(process: subprocess.Popen[str], said: str = "") -> bytes:
    """What the run logged; on stderr it began its one line like this."""
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0
    assert err.startswith(said)
    assert err.count("\n") == bool(said)
    return (Path(out.strip()) / "log.h5").read_bytes()


def spoil(content: bytes) -> Iterator[bytes]:
    """The content, damaged in different ways, again and again."""
    middle = len(content) // 2
    while True:
        yield b""
        yield content[:middle]
        yield content[:middle] + bytes([content[middle] ^ 4]) + content[middle + 1 :]
        yield bytes(len(content))


@pytest.mark.slow  # compiles everything anew
def test_damage_races_and_missing_places_change_no_byte(folder):
    cache = folder / "cache"
    together = [begun(out, PODUSV_CACHE=str(cache)) for out in ("a", "b")]
    first, second = map(log, together)
    assert first == second
    pieces = sorted(cache.rglob("*.code"))
    assert len(pieces) >= 8
    found = {path for path in cache.rglob("*") if path.is_file()}
    assert [path.name for path in found - {*pieces}] == [code_folder.MARK]  # no half-written part
    assert log(begun("c", PODUSV_CACHE=str(cache))) == first
    damage = spoil(pieces[0].read_bytes())
    for path in pieces[1:]:
        path.write_bytes(next(damage))
    pieces[0].unlink()
    pieces[0].mkdir()  # where the piece should be: no reading, no replacing
    assert log(begun("d", PODUSV_CACHE=str(cache))) == first
    assert all(object_cache._read(path) for path in pieces[1:])  # mended on the way


def test_without_any_place_it_compiles_leaves_nothing_and_says_so(folder, monkeypatch, caplog):
    (folder / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder / "tmp"))
    for name in ("PODUSV_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, "/dev/null/nowhere")
    assert compile.compile_piece(compile.Piece(wrap, CFUNCTYPE(c_double, c_double)))(7.0) == wrap(
        7.0
    )
    (told,) = caplog.messages
    assert told.startswith("podusv: compiled code is not kept, so each command compiles anew; set")
    assert {path.name for path in folder.rglob("*")} == {"a.yaml", "tmp"}


@pytest.mark.parametrize("home", ["~", "relative", ""])
def test_without_a_home_no_folder_is_made_here(folder, home, monkeypatch, caplog):
    monkeypatch.delenv("PODUSV_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", home)
    if home != "relative":
        monkeypatch.delenv("XDG_CACHE_HOME")
        monkeypatch.setattr(os.path, "expanduser", lambda path: path)  # who runs it has no entry
    assert FRESH(NAME) is None
    assert caplog.text.count("there is no home folder") == 1
    assert [path.name for path in folder.iterdir()] == ["a.yaml"]


def refused(place: Path, monkeypatch: pytest.MonkeyPatch, caplog: Any) -> str:
    """Why a place is not used, after the place itself; nothing is made there."""
    FRESH.cache_clear()
    caplog.clear()
    monkeypatch.setenv("PODUSV_CACHE", str(place))
    monkeypatch.setenv("XDG_CACHE_HOME", f"{place.anchor}dev/null")
    before = sorted(place.parent.rglob("*"))
    assert FRESH(NAME) is None
    assert sorted(place.parent.rglob("*")) == before
    (text,) = caplog.messages
    return text.partition(f"({place}: ")[2].partition(";")[0]


def test_a_folder_that_is_not_ones_own_is_not_used(folder, monkeypatch, caplog):
    """Code that somebody else could have put there would be run."""
    (folder / "theirs").mkdir()
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    said = refused(folder / "theirs", monkeypatch, caplog)
    assert said.startswith("another user owns /")


@pytest.mark.parametrize("mode", [0o777, 0o707, 0o770])
def test_a_folder_that_others_can_write_to_is_not_used(folder, mode, monkeypatch, caplog):
    """Neither the place nor the folder of the code in it, nor a link to such a one."""
    (folder / "cache").mkdir()
    for place in (folder / "shared", folder / "cache" / NAME):
        place.mkdir()
        place.chmod(mode)
    (folder / "link").symlink_to(folder / "shared")
    for place in (folder / "shared", folder / "link"):
        remedy = f"others can write to {place}: chmod go-w {place}"
        assert refused(place, monkeypatch, caplog) == remedy
    said = refused(folder / "cache", monkeypatch, caplog)
    assert said.startswith(f"others can write to {folder / 'cache' / NAME}")


def test_a_folder_that_podusv_makes_is_for_nobody_else(folder, monkeypatch, caplog):
    FRESH.cache_clear()
    monkeypatch.setenv("PODUSV_CACHE", str(folder / "mine"))
    assert FRESH(NAME) == folder / "mine" / NAME
    for made in (folder / "mine", folder / "mine" / NAME):
        assert made.stat().st_mode & 0o777 == 0o700
    assert not caplog.messages


# --- folders of former states of the source


def code_kept(number: int) -> Path | None:
    """Where code of the n-th state of the source is kept, asked anew each time."""
    FRESH.cache_clear()
    return FRESH(f"{number:016x}")


MANY = code_folder.KEPT + 4


def test_a_cache_among_other_folders_leaves_what_is_not_its_own(tmp_path, monkeypatch):
    """Also where their names are those of caches.

    A cache has a mark: what has none, another program's, or is a link, only looks like one.
    """
    cache = tmp_path / "cache"
    cache.mkdir(mode=0o700)
    monkeypatch.setenv("PODUSV_CACHE", str(cache))
    for number in range(MANY):
        theirs, empty, other, link = (cache / f"{n + number:016x}" for n in (0, 300, 400, 500))
        for made in (theirs, empty, other):
            made.mkdir()
        (theirs / "thesis.tex").touch()
        (theirs / "of-mine.code").touch()
        (other / code_folder.MARK).write_bytes(b"Signature: 8a477f597d28d172789f06886806bc55")
        link.symlink_to(code_kept(600))
        code_kept(200 + number)
    for name in ("thesis.tex", "of-mine.code"):
        assert len(list(cache.glob(f"*/{name}"))) == MANY
    names = {path.name for path in cache.iterdir()}
    assert names >= {f"{n + k:016x}" for n in (0, 300, 400, 500) for k in range(MANY)}
    assert len(names) < 4 * MANY + code_folder.KEPT + 2  # the others are forgotten


def test_old_caches_are_forgotten(tmp_path, monkeypatch):
    cache = tmp_path / "cache"
    cache.mkdir(mode=0o700)
    monkeypatch.setenv("PODUSV_CACHE", str(cache))
    for number in range(MANY):
        folder = code_kept(number)
        (folder / "law_entry_1.code").touch()
        (folder / temporary_name()).touch()
        os.utime(folder, (number, number))
    assert code_kept(MANY - 1) == folder
    left = sorted(int(path.name, 16) for path in cache.iterdir())
    assert left == list(range(MANY))[-code_folder.KEPT - 1 :]


def test_the_oldest_pieces_of_very_many_are_forgotten(tmp_path, monkeypatch):
    monkeypatch.setattr(code_folder, "PIECES", 6)
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path))
    folder = code_kept(1)
    for number in range(7):
        (folder / f"piece_{number}.code").touch()
        os.utime(folder / f"piece_{number}.code", (number, number))
    code_kept(1)
    left = sorted(path.stem for path in folder.glob("*.code"))
    assert left == ["piece_4", "piece_5", "piece_6"]


def test_a_folder_that_cannot_be_written_is_passed_over_and_that_is_told(
    tmp_path, monkeypatch, caplog
):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path / "file"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    assert code_kept(1) == tmp_path / "home/podusv" / f"{1:016x}"
    assert caplog.messages == [
        f"podusv: compiled code is kept in {tmp_path}/home/podusv "
        f"({tmp_path}/file: {tmp_path}/file is not a folder)"
    ]
