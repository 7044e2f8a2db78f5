"""Work in a forked process: killed, limited, without rights, without Python's start each time."""

import multiprocessing
import os
import signal
import traceback
from collections.abc import Callable
from ctypes import CDLL, c_char_p, c_ulong, get_errno
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

import pytest
from command_samples import gone

Result = TypeVar("Result")
FORK = multiprocessing.get_context("fork")
PATIENCE = 60.0  # s
NOBODY = 65534
NEW_NAMESPACE, PRIVATE = 0x20000, 0x44000  # CLONE_NEWNS; MS_REC | MS_PRIVATE


class Died(Exception):
    """The process ended without a result."""


@dataclass
class Child:
    """A forked process in a session of its own, at work."""

    process: BaseProcess
    channel: Connection

    def result(self) -> Any:
        """What its work returned; Died where it was killed.

        All that it started has to end with it, or soon after it.
        """
        try:
            assert self.channel.poll(PATIENCE), "the process hangs"
            done, result = self.channel.recv()
        except EOFError:
            raise Died from None
        finally:
            _end(self.process)
        assert done, result
        return result


def begun(work: Callable[[], object]) -> Child:
    """A process that has begun to work."""
    ours, theirs = FORK.Pipe(duplex=False)
    process = FORK.Process(target=_work, args=(work, theirs))
    process.start()
    theirs.close()
    return Child(process, ours)


def in_a_child(work: Callable[[], Result]) -> Result:
    """What `work` returns in a process of its own."""
    return begun(work).result()  # type: ignore[no-any-return]


def _work(work: Callable[[], Any], channel: Connection) -> None:
    os.setsid()
    try:
        channel.send((True, work()))
    except BaseException:
        channel.send((False, traceback.format_exc()))


def _end(process: BaseProcess) -> None:
    process.join(PATIENCE)
    process.kill()
    process.join()
    left = not gone(process)
    if left:
        os.killpg(process.pid, signal.SIGKILL)
    assert not left, "a process was left behind"


def give_up_rights() -> None:
    """Become a user who owns nothing; permissions mean nothing to root."""
    if os.geteuid() == 0:
        os.setgroups([])
        os.setgid(NOBODY)
        os.setuid(NOBODY)


def small_disk(place: str, size: int) -> None:
    """Mount a file system of `size` bytes that this process alone sees, and that ends with it.

    PermissionError or the like where the system does not let us.
    """
    libc = CDLL(None, use_errno=True)
    types = c_char_p, c_char_p, c_char_p, c_ulong, c_char_p
    libc.mount.argtypes = types
    _done(libc.unshare(NEW_NAMESPACE))
    _done(libc.mount(b"none", b"/", None, PRIVATE, None))
    _done(libc.mount(b"none", os.fsencode(place), b"tmpfs", 0, b"size=%d" % size))


def _done(result: int) -> None:
    if result != 0:
        raise OSError(get_errno(), os.strerror(get_errno()))


def _can_mount() -> bool:
    def attempt() -> bool:
        try:
            small_disk("/tmp", 4096)
        except OSError:
            return False
        return True

    return in_a_child(attempt)


CAN_MOUNT = hasattr(os, "fork") and os.path.isdir("/proc/self/ns") and _can_mount()
needs_mount = pytest.mark.skipif(
    not CAN_MOUNT, reason="mounting a small disk needs root and a mount namespace of one's own"
)
