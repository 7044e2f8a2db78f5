"""Exit codes and error messages: one line for a user's error, a traceback for a bug."""

from __future__ import annotations

import io
import os
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from functools import wraps
from typing import ParamSpec, TextIO

import typer

from podusv_cli.cli.terminal import echo
from podusv_cli.core.errors import PodusvError, StorageError
from podusv_cli.process.interrupts import SIGNALLED, STDERR, Interrupts, interrupts_caught

Given = ParamSpec("Given")
# What a shell reports for a program that SIGINT ended.
INTERRUPTED = 130
PIPE_CLOSED = 141  # what a shell reports for a program that SIGPIPE ended
BUG = 1
MEANINGS = {
    0: "done",
    1: "a bug in podusv",
    2: "wrong usage or scenario",
    3: "some of several runs failed (`compare`, `sweep`) or figures (`plot`), a number is not "
    "converged (`verify`, `optimum`) or there is no steady motion (`margins`), a hull is no "
    "improvement on the vessel that was given (`identify`), or runs differ (`rerun`, "
    "`diff`, kept logs of `sweep`)",
    4: "the simulation diverged; what was computed is kept",
    5: "input or output failed",
    129: "the terminal was closed",
    130: "interrupted with Ctrl-C",
    141: "the reader of a pipe closed it",
    143: "terminated",
}
PLEASE_REPORT = "This is a bug in {}. Please report it with the lines above."


def with_exit_codes(
    command: Callable[Given, None], package: str = "podusv"
) -> Callable[Given, None]:
    """Wrap a command so that its errors become an exit code and a message on stderr.

    `package` is what the command comes from, which has to know of a bug in it.
    """

    @wraps(command)
    def run(*args: Given.args, **kwargs: Given.kwargs) -> None:
        """The command as typer calls it; it always ends by typer.Exit."""
        with interrupts_caught() as interrupts:
            code = _exit_code(lambda: command(*args, **kwargs), interrupts, package)
            interrupts.ending = interrupts.number > 0
            # Code inside raises one code for all interrupts; the shell expects the signal's own.
            signalled = code == INTERRUPTED and interrupts.number
            raise typer.Exit(SIGNALLED + interrupts.number if signalled else code)

    return run


def _exit_code(command: Callable[[], None], interrupts: Interrupts, package: str) -> int:
    """Run a command; 0, or the exit code of its error, which is printed.

    typer's own errors pass: it prints them itself. `interrupts` counts the signals that came.
    `package` is whose code a traceback blames.
    """
    try:
        command()
    except (typer.Abort, typer.BadParameter):
        raise
    except typer.Exit as end:
        return end.exit_code
    except (Exception, KeyboardInterrupt) as error:
        is_bug = not isinstance(error, (PodusvError, OSError, KeyboardInterrupt))
        if interrupts.number and is_bug:  # a library may turn an interrupt into any exception
            _print_error(f"podusv: interrupted, and then {type(error).__name__}: {error}")
            return INTERRUPTED
        return report_error(error, package)
    return 0


def report_error(error: BaseException, package: str = "podusv") -> int:
    """Print an error and return its exit code.

    Users' errors are a line, without a traceback; anything unexpected is a bug of `package`.
    """
    if isinstance(error, KeyboardInterrupt):
        _print_error(str(error) or "interrupted")
        return INTERRUPTED
    # Before OSError, of which it is one: that `head` has read enough is no failure.
    if isinstance(error, BrokenPipeError):
        _discard_output(sys.stdout)
        return PIPE_CLOSED
    if isinstance(error, PodusvError):
        _print_error(*error.lines())
        return error.exit_code
    if isinstance(error, OSError):
        _print_error(f"podusv: {error}")
        return StorageError.exit_code
    _print_error(
        *"".join(traceback.format_exception(error)).splitlines(), PLEASE_REPORT.format(package)
    )
    return BUG


def _print_error(*lines: str) -> None:
    with suppress(OSError):  # stderr itself cannot be written to
        echo(*lines, err=True)


def replace_closed_streams() -> None:
    """Open /dev/null in place of a closed stdin, stdout or stderr (`>&-`).

    Otherwise the next file that is opened would get its number, and messages would go into it.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= STDERR:  # the lowest free number
        os.set_inheritable(number, True)
    os.close(number)
    sys.stdout = _with_buffer(sys.stdout or open(os.devnull, "w"))  # noqa: SIM115
    sys.stderr = _with_buffer(sys.stderr or open(os.devnull, "w"))  # noqa: SIM115


def _with_buffer(stream: TextIO) -> TextIO:
    """The stream with a buffer, which PYTHONUNBUFFERED removes.

    Without one, Python ignores that a full disk took only a part of the text.
    """
    raw = getattr(stream, "buffer", None)
    if not isinstance(raw, io.RawIOBase):
        return stream
    buffered = io.BufferedWriter(raw)
    return io.TextIOWrapper(buffered, stream.encoding, stream.errors, line_buffering=True)


def flush_streams(code: str | int | None) -> str | int | None:
    """Flush stdout and stderr; `code`, or the exit code of a failure to print."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            _discard_output(stream)
            if code != StorageError.exit_code:  # else it was reported already
                code = report_error(error)
    return code


def _discard_output(stream: TextIO) -> None:
    """Send the rest of a stream to /dev/null, so that Python does not fail again at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
