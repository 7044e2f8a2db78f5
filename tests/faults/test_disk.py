"""Full disks, limits of file sizes, streams that take nothing: a line, and nothing is lost."""

import os
import re
import resource
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from children import in_a_child, needs_mount, small_disk
from command_samples import BASE, ROOT, Said, one_line, write
from counts import count, few
from old_results import COMMANDS, SUCCESS, assert_nothing_lost, assert_whole, bring_back, left_over
from storage_samples import deadline, files

from podusv_cli.storage import manifest

FULL = Path("/dev/full")
needs_full = pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full")
WRITING = [(made, words) for made, words in COMMANDS if made]
# The log alone is larger than the last of these, and what compares the runs is not.
LIMITS = [1000, 0, 40_000][:: count(2, 1)]


@pytest.fixture
def podusv(beside_old_results):
    return beside_old_results


@pytest.mark.slow
@pytest.mark.parametrize("limit", LIMITS)
@pytest.mark.parametrize(("made", "words"), few(WRITING), ids=str)
def test_past_the_file_size_limit(podusv, made, words, limit):
    if limit > 1000 and words[0] in ("plot", "verify"):
        pytest.skip("what it writes is smaller than the limit")
    old = files(Path())

    def limited() -> Said:
        sys.dont_write_bytecode = True  # Python takes no notice of what does not fit
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        return podusv(*words)

    said = in_a_child(limited)
    assert said.code == 5
    place = r"cannot write \S*{}\S* \((more than )?\d+ bytes\): "
    place += "larger than the file size limit of this session"
    assert re.fullmatch(place.format(made), one_line(said.err))
    assert files(Path()) == old
    assert not left_over()


@needs_mount
@pytest.mark.parametrize("free", [150_000, 4096][: count(1, 2)])
@pytest.mark.parametrize(("made", "words"), few(WRITING), ids=str)
def test_on_a_full_disk(podusv, before, made, words, free):
    """With old results on it, where only the child sees it."""

    def on_a_small_disk() -> object:
        small_disk(".", 4 * 2**20)
        os.chdir(os.getcwd())  # to what is mounted there now
        bring_back(before)
        old = files(Path())
        fill(free)
        said = podusv(*words)
        Path("filler").unlink()
        if said.code == SUCCESS.get(words[0], 0):
            assert free > 4096
        else:
            assert_nothing_lost(made, old, {}, said)
        return said.code

    in_a_child(on_a_small_disk)


def fill(free: int) -> None:
    """Leave that many bytes on this disk."""
    disk = os.statvfs(".")
    Path("filler").write_bytes(bytes(disk.f_bavail * disk.f_bsize - free))


@needs_full
@pytest.mark.parametrize(("made", "words"), few(COMMANDS), ids=str)
def test_stdout_that_takes_nothing(podusv, made, words):
    """What is made is made all the same."""
    old = files(Path())

    def unheard() -> Said:
        sys.stdout = FULL.open("w")
        return podusv(*words, *["--json"] * (words[0] != "plot"))

    said = in_a_child(unheard)
    assert said.code == 5
    assert one_line(said.err) == "podusv: [Errno 28] No space left on device"
    assert_whole(made, old, files(Path()))
    assert not made or Path(made).exists()
    assert not left_over()


@pytest.mark.slow
@needs_full
@pytest.mark.parametrize("unbuffered", ["", "1"][: count(1, 2)])
@pytest.mark.parametrize("streams", ["out", "err", "out err"])
def test_streams_that_take_nothing_until_python_ends(podusv, streams, unbuffered):
    """When nothing can be told, the exit code is all there is, and it is not a bug's."""
    write("a.yaml", BASE.replace("silence", "# silence"))  # so that there is something to say
    words = ["run", "a.yaml", "--out", "new", "--no-figures", "--json"]
    extra = {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": unbuffered}
    with FULL.open("w") as full:
        out, err = (full if name in streams else subprocess.PIPE for name in ("out", "err"))
        done = subprocess.run(
            [sys.executable, "-m", "podusv_cli", *words],
            text=True,
            timeout=60,
            check=False,
            env=os.environ | extra,
            stdout=out,
            stderr=err,
        )
    assert done.returncode == 5
    assert "Traceback" not in (done.stderr or "")
    assert "ignored" not in (done.stderr or "")
    assert not Path("new").exists() or manifest.check(Path("new")).status == "finished"


def a_device(path: str) -> None:
    """Another /dev/null: never the system's own, which faulty code run by root would replace."""
    try:
        os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 3))
    except PermissionError:
        pytest.skip("making a device needs root, and so does replacing one")


ODD: dict[str, Callable[[str], None]] = {
    "device": a_device,
    "pipe": os.mkfifo,
    "folder": os.mkdir,
    "link": lambda path: os.symlink("v.json", path),
}


@pytest.mark.parametrize("place", ODD)
def test_what_is_no_file_is_not_replaced_by_one(podusv, place):
    """As root even a device would be."""
    ODD[place](place)
    Path("figures/controls.png").unlink()
    Path("figures/controls.png").symlink_to(Path(place).absolute())
    kind = os.lstat(place).st_mode
    old = files(Path())
    for words in (("verify", "a.yaml", "--out", place), ("plot", "x", "--out", "figures")):
        with deadline():
            said = podusv(*words)
        assert said.code == 5
        assert said.out == ""
        assert "is there already and is not a file" in one_line(said.err)
    assert os.lstat(place).st_mode == kind
    assert files(Path()) == old
