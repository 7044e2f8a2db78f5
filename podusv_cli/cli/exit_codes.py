"""What failures look like: a line for what was foreseen, a trace for what was not."""

from __future__ import annotations

import io
import os
import resource
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
INTERRUPTED = 130
PIPE_CLOSED = 141  # what a shell reports for a program that SIGPIPE ended
BUG = 1
# At once: a run has up to 18 open, and a comparison two more for each run that it makes at a time.
LEAST_OPEN_FILES, OPEN_FILES = 64, 1024
PLEASE_REPORT = "This is a bug in podusv. Please report it with the lines above."


def with_exit_codes(command: Callable[Given, None]) -> Callable[Given, None]:
    """The command, ending with an exit code and, where one helps, a message on stderr."""

    @wraps(command)
    def run(*args: Given.args, **kwargs: Given.kwargs) -> None:
        with interrupts_caught() as interrupts:
            code = _code_of(lambda: command(*args, **kwargs), interrupts)
            interrupts.ending = interrupts.number > 0
            # What was interrupted says so in one way; which signal it was, the shell wants to know.
            signalled = code == INTERRUPTED and interrupts.number
            raise typer.Exit(SIGNALLED + interrupts.number if signalled else code)

    return run


def _code_of(command: Callable[[], None], interrupts: Interrupts) -> int:
    try:
        _raise_limit_of_open_files()
        command()
    except (typer.Abort, typer.BadParameter):
        raise
    except typer.Exit as end:
        return end.exit_code
    except (Exception, KeyboardInterrupt) as error:
        unforeseen = not isinstance(error, (PodusvError, OSError, KeyboardInterrupt))
        if interrupts.number and unforeseen:  # a library may have turned an interrupt into anything
            _say(f"podusv: interrupted, and then {type(error).__name__}: {error}")
            return INTERRUPTED
        return told(error)
    return 0


def _raise_limit_of_open_files() -> None:
    """Allow as many open files as commands need; StorageError where the system does not.

    A run that finds out in the end would lack figures, or be lost.
    """
    allowed, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    if allowed != resource.RLIM_INFINITY and allowed < OPEN_FILES:
        if most != resource.RLIM_INFINITY and most < LEAST_OPEN_FILES:
            raise StorageError(
                f"at most {most} files may be open at once, podusv needs {LEAST_OPEN_FILES}; "
                f"allow more with `ulimit -n {OPEN_FILES}`"
            )
        wanted = OPEN_FILES if most == resource.RLIM_INFINITY else min(most, OPEN_FILES)
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))


def told(error: BaseException) -> int:
    """Tell about an error; the exit code it stands for."""
    if isinstance(error, KeyboardInterrupt):
        _say(str(error) or "interrupted")
        return INTERRUPTED
    if isinstance(error, BrokenPipeError):
        _silence(sys.stdout)
        return PIPE_CLOSED
    if isinstance(error, PodusvError):
        _say(*error.lines())
        return error.exit_code
    if isinstance(error, OSError):
        _say(f"podusv: {error}")
        return StorageError.exit_code
    _say(*"".join(traceback.format_exception(error)).splitlines(), PLEASE_REPORT)
    return BUG


def _say(*lines: str) -> None:
    with suppress(OSError):  # nobody is left to tell that stderr cannot be written to
        echo(*lines, err=True)


def replace_closed_streams() -> None:
    """Where the caller closed stdin, stdout or stderr (`>&-`), nothing stands in its place.

    Otherwise the next file that is opened would, and messages would go into it.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= STDERR:  # the lowest that is free
        os.set_inheritable(number, True)
    os.close(number)
    sys.stdout = _whole(sys.stdout or open(os.devnull, "w"))  # noqa: SIM115
    sys.stderr = _whole(sys.stderr or open(os.devnull, "w"))  # noqa: SIM115


def _whole(stream: TextIO) -> TextIO:
    """The stream with a buffer: Python drops, unseen, what a full disk takes no more without one.

    There is none where PYTHONUNBUFFERED is set.
    """
    raw = getattr(stream, "buffer", None)
    if not isinstance(raw, io.RawIOBase):
        return stream
    buffered = io.BufferedWriter(raw)
    return io.TextIOWrapper(buffered, stream.encoding, stream.errors, line_buffering=True)


def flush_streams(code: str | int | None) -> str | int | None:
    """The exit code after everything is printed; another one where printing failed."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            _silence(stream)
            if code != StorageError.exit_code:  # or it has been told, as far as that was possible
                code = told(error)
    return code


def _silence(stream: TextIO) -> None:
    """Nothing gets out there any more; keep Python from trying and complaining at the very end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
