"""Nobody listens, no terminal, a plain one: no traceback, and codes for terminals only."""

import errno
import io
import os
import pty
import resource
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from command_samples import BASE, ROOT, write

from podusv_cli.cli import progress

ESCAPE = b"\x1b"
RUN = ("run", "a.yaml", "--out", "x", "--force", "--no-figures")
PLAIN = [{"TERM": "dumb"}, {"TERM": ""}, {"NO_COLOR": "1", "TERM": "xterm"}]
FULL = Path("/dev/full")


@pytest.fixture(autouse=True)
def scenario(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write("a.yaml", BASE)


def environment(extra: Mapping[str, str]) -> dict[str, str]:
    own = {name: text for name, text in os.environ.items() if name not in ("NO_COLOR", "TERM")}
    return {**own, "PYTHONPATH": str(ROOT), **extra}


def podusv(*words: str, extra: Mapping[str, str] | None = None, **streams: Any) -> Any:
    return subprocess.run(
        [sys.executable, "-m", "podusv_cli", *words],
        env=environment(extra or {}),
        timeout=60,
        check=False,
        **streams,
    )


@pytest.mark.slow
@pytest.mark.parametrize("words", [pytest.param(("nope",), marks=pytest.mark.slow), RUN])
def test_closed_streams_are_as_good_as_dev_null(words):
    """Also no file of the run gets the number of a stream, and messages with it."""
    wanted = podusv(*words, capture_output=True).returncode
    for closing in (">&-", "<&- >&- 2>&-"):
        script = f'exec "$@" {closing}'
        command = ["sh", "-c", script, "sh", sys.executable, "-m", "podusv_cli", *words]
        done = subprocess.run(
            command, env=environment({}), capture_output=True, timeout=60, check=False
        )
        assert done.returncode == wanted
        assert b"Traceback" not in done.stderr
    if words == RUN:
        assert podusv("diff", "x", "x", capture_output=True).returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_disk_that_fills_up_behind_stdout_is_a_line(unbuffered):
    """Half of the text is there, and it is known."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))

    # Python would cut off the compiled files that it writes, and take no notice.
    extra = {"PYTHONUNBUFFERED": unbuffered, "PYTHONDONTWRITEBYTECODE": "1"}
    with Path("schema.json").open("w") as file:
        done = podusv(
            "schema", extra=extra, stdout=file, stderr=subprocess.PIPE, text=True, preexec_fn=limit
        )
    assert (done.returncode, done.stderr) == (5, "podusv: [Errno 27] File too large\n")


@pytest.mark.slow
@pytest.mark.parametrize("words", [("schema",), ("validate", "a.yaml", "-v")])
def test_a_reader_that_leaves_ends_it_quietly(words):
    reading, writing = os.pipe()
    os.close(reading)
    done = podusv(*words, stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    assert (done.returncode, done.stderr) == (141, b"")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "extra"),
    [(("list",), {"LC_ALL": "C", "PYTHONUTF8": "0"}), (("schema",), PLAIN[0]), (RUN, {})],
    ids=str,
)
def test_pipes_get_no_codes(words, extra):
    done = podusv(*words, extra={"TERM": "xterm", **extra}, capture_output=True)
    assert done.returncode == 0
    assert ESCAPE not in done.stdout + done.stderr
    assert b"Traceback" not in done.stderr
    files = [path for path in Path("x").rglob("*") if path.is_file() and path.suffix != ".h5"]
    assert not any(ESCAPE in path.read_bytes() for path in files)


def on_a_terminal(extra: Mapping[str, str], *words: str) -> bytes:
    """What a terminal gets to see."""
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-m", "podusv_cli", *words],
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        env=environment(extra),
    ) as process:
        os.close(theirs)
        shown = b""
        while part := _read(ours):
            shown += part
    os.close(ours)
    assert process.returncode == 0, shown
    return shown


def _read(terminal: int) -> bytes:
    try:
        return os.read(terminal, 65536)
    except OSError:  # the other end is closed
        return b""


@pytest.mark.slow
def test_a_plain_terminal_gets_no_codes_and_another_one_does():
    for extra in PLAIN[1:]:
        assert ESCAPE not in on_a_terminal(extra, "list")
    assert ESCAPE in on_a_terminal({"TERM": "xterm"}, "list")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Lost(Terminal):
    """A terminal that goes away while something is written to it."""

    def write(self, text: str) -> int:
        raise OSError(errno.EIO, "Input/output error")


def test_a_terminal_that_is_lost_costs_the_bar_only(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress, "PATIENCE", -1.0)
    monkeypatch.setattr(sys, "stderr", Lost())
    with progress.progress_bars(wanted=True) as advance:
        assert advance is not None
        for part in range(3):
            advance("run", part / 2)


@pytest.mark.parametrize("extra", [*PLAIN, {"TERM": "xterm"}], ids=str)
def test_a_plain_terminal_gets_no_bar(monkeypatch, extra):
    monkeypatch.setattr(progress, "PATIENCE", -1.0)
    monkeypatch.delenv("NO_COLOR", raising=False)
    for name, text in extra.items():
        monkeypatch.setenv(name, text)
    monkeypatch.setattr(sys, "stderr", Terminal())
    with progress.progress_bars(wanted=True) as advance:
        if advance:
            advance("run", 0.5)
    assert (ESCAPE.decode() in sys.stderr.getvalue()) == (extra == {"TERM": "xterm"})
