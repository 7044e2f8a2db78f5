"""Old results of every kind, and whether they are still there, or new ones, whole."""

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import pytest
from command_samples import BASE, TWO, Command, Said, commanded, one_line, write
from storage_samples import files

from podusv_cli.figures import drawing
from podusv_cli.figures.sheet import Sheet
from podusv_cli.storage import manifest
from podusv_cli.workflows import plot

SET = ("--set", "controller.K_Pu=50.0", "--no-figures", "-q")
# What is made or replaced, and the command that does it; the last leaves nothing.
COMMANDS = [
    ("new", ("run", "a.yaml", "--out", "new", "--force", *SET)),
    ("x", ("run", "a.yaml", "--out", "x", "--force", *SET)),
    ("new", ("compare", "two.yaml", "--out", "new", "--force", *SET)),
    ("both", ("compare", "two.yaml", "--out", "both", "--force", *SET)),
    ("again", ("rerun", "both", "--out", "again", "--force")),
    ("figures", ("plot", "both", "--out", "figures")),
    ("v.json", ("verify", "a.yaml", "--out", "v.json", "-q")),
    ("", ("rerun", "x")),
]
SUCCESS = {"verify": 3}  # else 0; what these scenarios verify is not converged


def draw_quickly(patch: pytest.MonkeyPatch) -> None:
    """Make figures of which only the bytes matter."""

    def draw(
        shown: object, sheets: Sequence[Sheet], forms: Sequence[str], *more: object, **how: object
    ) -> object:
        names = [sheet.name for sheet in sheets]
        return {f"{name}.{form}": name.encode() * 1000 for name in names for form in forms}

    for room in (drawing, plot):
        patch.setattr(room, "draw_in_parallel", draw)


def among_old_results(
    old: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Command:
    """The command line in a folder like `old`, which is filled the first time."""
    podusv = commanded(monkeypatch, capsys)
    draw_quickly(monkeypatch)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "passing"))
    (tmp_path / "passing").mkdir()
    if not any(old.iterdir()):
        monkeypatch.chdir(old)
        _make(podusv)
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    bring_back(old)
    return podusv


def _make(podusv: Command) -> None:
    write("a.yaml", BASE)
    write("two.yaml", TWO)
    assert podusv("run", "a.yaml", "--out", "x", "--no-figures").code == 0
    assert podusv("compare", "two.yaml", "--out", "both", "--no-figures").code == 0
    assert podusv("rerun", "both", "--out", "again").code == 0
    assert podusv("verify", "a.yaml", "--out", "v.json").code == 3
    Path("figures").mkdir()
    for name in ("controls", "trajectory"):
        Path(f"figures/{name}.png").write_bytes(b"old")


def bring_back(old: Path) -> None:
    """Make this folder as it was."""
    for path in Path().iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    shutil.copytree(old, ".", dirs_exist_ok=True)


def left_over() -> list[Path]:
    """What is in the making, or was, here and where things pass."""
    return [path for path in Path("..").rglob("*") if ".podusv-" in path.name]


def _parted(found: dict[str, bytes], made: str) -> tuple[dict[str, bytes], dict[str, bytes]]:
    """Of what is not hidden, what is part of `made`, and what is not."""
    parts = {name: part for name, part in found.items() if ".podusv-" not in name}
    inside = {name: part for name, part in parts.items() if Path(name).parts[0] == made}
    return inside, {name: part for name, part in parts.items() if name not in inside}


def assert_whole(made: str, old: dict[str, bytes], new: dict[str, bytes]) -> None:
    """Nothing else has changed, and what was to be made is as it was or wholly new."""
    was, others_were = _parted(old, made)
    now, others_are = _parted(files(Path()), made)
    assert others_are == others_were
    if made in ("figures", "v.json"):  # file by file
        assert was.keys() <= now.keys()
        assert all(part in (was.get(name), new.get(name)) for name, part in now.items())
    elif now != was:
        assert not manifest.foreign(Path(made), manifest.check(Path(made)))
        assert now.keys() == _parted(new, made)[0].keys()


def assert_nothing_lost(
    made: str, old: dict[str, bytes], new: dict[str, bytes], said: Said
) -> None:
    """A command that could not write says so in a line, and old results are what they were.

    Or new, where only the last step failed. What was made of a comparison is kept.
    """
    if said.code == 3:
        _assert_without_a_run(made, old, one_line(said.err))
    else:
        assert said.code == 5
        _assert_kept_beside(made, one_line(said.err))
        assert_whole(made, old, new)
    assert not left_over()


def _assert_without_a_run(made: str, old: dict[str, bytes], line: str) -> None:
    """A comparison lacks a run that could not be written, says so, and took no other's place."""
    assert f"{made}/manifest.json" not in old
    assert manifest.check(Path(made)).status == "finished"
    assert "cannot" in line


def _assert_kept_beside(made: str, line: str) -> None:
    """What lacks a run is whole where the line says, and taken away."""
    other = Path(f"{made}-2")
    assert other.exists() == (f"in {other} instead" in line)
    if other.exists():
        assert manifest.check(other).status == "finished"
        assert "left as it is" in line
        shutil.rmtree(other)
