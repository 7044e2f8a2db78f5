"""Shared libraries from C and object files: by zig for any platform, by cc for this machine."""

from __future__ import annotations

import platform as platform_of_python
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from podusv_cli.core.errors import UsageError
from podusv_cli.export.objects import Platform

# The arithmetic of the C files is that of the run: no product is merged with a sum.
OPTIONS = ("-shared", "-O2", "-ffp-contract=off")
MACHINES = {
    ("Linux", "x86_64"): "linux64",
    ("Linux", "aarch64"): "aarch64-linux",
    ("Windows", "AMD64"): "win64",
    ("Darwin", "x86_64"): "darwin64",
    ("Darwin", "arm64"): "aarch64-darwin",
}
NO_ZIG = (
    "there is no linker for {0}: install a C compiler, or zig with pip install "
    "'podusv[export]'; --no-fmu exports without a linker"
)


def shared_library(files: Mapping[str, bytes], name: str, platform: Platform) -> bytes:
    """The bytes of a shared library of C files (*.c, with headers) and object files (*.o).

    `files` are contents by name, `name` is the platform's in an FMU. Raises UsageError where no
    linker is there, or it fails.
    """
    command = linker(name, platform)
    with TemporaryDirectory() as folder:
        for file, content in files.items():
            (Path(folder) / file).write_bytes(content)
        sources = [file for file in files if not file.endswith(".h")]
        out = f"law{platform.library}"
        done = subprocess.run(
            [*command, *OPTIONS, "-o", out, *sources, "-lm"],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise UsageError(f"the law cannot be linked for {name}: {done.stderr.strip()[-500:]}")
        return (Path(folder) / out).read_bytes()


def this_machine() -> str:
    """The platform that this is, "" for none that there is an export for."""
    return MACHINES.get((platform_of_python.system(), platform_of_python.machine()), "")


def waiting(name: str, platform: Platform) -> str:
    """Why linking may take long, "" where it does not."""
    of_zig = "ziglang" in linker(name, platform)
    return (
        "; the first time, zig builds the platform's C library, a minute or two" if of_zig else ""
    )


def linker(name: str, platform: Platform) -> Sequence[str]:
    """The command that links for a platform. Raises UsageError where there is none."""
    if find_spec("ziglang") and platform.zig:
        return (sys.executable, "-m", "ziglang", "cc", "-target", platform.zig)
    if name == this_machine() and (compiler := shutil.which("cc")):
        return (compiler, "-fPIC")
    raise UsageError(NO_ZIG.format(name))
